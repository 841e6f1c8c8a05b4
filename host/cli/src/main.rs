//! `mgw`: the command line of the motor gateway.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    mgw_cli::main()
}
