//! Every file of `scenarios/` is a test of its own, played with several seeds.

use host_tests::{play_all, scenario};
use std::process::ExitCode;

fn main() -> ExitCode {
    play_all("scenarios", "scenarios", scenario::run)
}
