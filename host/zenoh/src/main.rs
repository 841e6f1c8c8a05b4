//! `mgw-zenoh`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    mgw_zenoh::main()
}
