//! `mgw` itself, built with the same crates: the tests start its simulator, and compare with what
//! it prints.

use std::process::ExitCode;

fn main() -> ExitCode {
    mgw_cli::main()
}
