//! Measures the image, prints the table and compares it with the committed one; `--renew` writes
//! that anew.
//!
//! `.ci/virtual-board measure [--board BOARD] [--renew]` builds the image and runs it. Everything
//! is counted in virtual time, so the figures are the same on every machine.

use std::error::Error;
use std::process::ExitCode;

use virtual_board::machine::image_path;
use virtual_board::measure::{Table, measure};
use virtual_board::sections::{exit_code, settle};

/// The committed table.
const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/measurements.txt");
const RENEW: &str = "--renew";

fn main() -> ExitCode {
    // `cargo bench` adds one of its own.
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let renew = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        [RENEW] => true,
        _ => {
            eprintln!("usage: measure [{RENEW}]");
            return ExitCode::from(2);
        }
    };
    exit_code(run(renew))
}

/// Whether the committed table holds.
fn run(renew: bool) -> Result<bool, Box<dyn Error>> {
    let measured = measure(&image_path()?, renew)?;
    settle(COMMITTED, renew, &measured, |committed| {
        Ok(measured.complaints(&Table::parse(committed)?))
    })
}
