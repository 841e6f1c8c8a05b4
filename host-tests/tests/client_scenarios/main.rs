//! Every file of `client-scenarios/` is a test of its own, played with several seeds.

use host_tests::{client_scenario, play_all};
use std::process::ExitCode;

fn main() -> ExitCode {
    play_all("client-scenarios", "client_scenarios", client_scenario::run)
}
