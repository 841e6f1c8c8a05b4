//! Measures the image, prints the table and compares it with the committed one; `--renew` writes
//! that anew, and `--profile` prints instead which functions and lines the instructions are of.
//!
//! `.ci/virtual-board measure [--board BOARD] [--renew | --profile]` builds the image and runs it. Everything
//! is counted in virtual time, so the figures are the same on every machine.

use std::error::Error;
use std::process::ExitCode;

use virtual_board::machine::image_path;
use virtual_board::measure::{Table, measure, profile};
use virtual_board::sections::{exit_code, settle};

/// The committed table.
const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/measurements.txt");
const RENEW: &str = "--renew";
const PROFILE: &str = "--profile";

fn main() -> ExitCode {
    // `cargo bench` adds one of its own.
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => exit_code(run(false)),
        [RENEW] => exit_code(run(true)),
        [PROFILE] => exit_code(print_profile()),
        _ => {
            eprintln!("usage: measure [{RENEW} | {PROFILE}]");
            ExitCode::from(2)
        }
    }
}

/// Whether the committed table holds.
fn run(renew: bool) -> Result<bool, Box<dyn Error>> {
    let measured = measure(&image_path()?, renew)?;
    settle(COMMITTED, renew, &measured, |committed| {
        Ok(measured.complaints(&Table::parse(committed)?))
    })
}

/// It holds nothing: it is to be read.
fn print_profile() -> Result<bool, Box<dyn Error>> {
    print!("{}", profile(&image_path()?)?);
    Ok(true)
}
