//! Measures the rates of free-running cycles, prints the table and compares it with the committed
//! one; `--renew` writes that anew, and `--profile` prints instead which functions and lines the
//! instructions of an axis and period are of.
//!
//! `.ci/virtual-board cycle [--board BOARD] [--only LINE | --renew | --profile [LINE]]` builds the image
//! and runs it, in virtual time.

use std::error::Error;
use std::process::ExitCode;

use virtual_board::cycle_rates::{Table, measure, profile};
use virtual_board::machine::image_path;
use virtual_board::sections::{exit_code, settle};

/// The committed table.
const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/cycle-rates.txt");

fn main() -> ExitCode {
    // `cargo bench` adds one of its own.
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => exit_code(run("", false)),
        ["--only", line] => exit_code(run(line, false)),
        ["--renew"] => exit_code(run("", true)),
        ["--profile"] => exit_code(print_profile(None)),
        ["--profile", line] => exit_code(print_profile(Some(line))),
        _ => {
            eprintln!("usage: cycle [--only LINE | --renew | --profile [LINE]]");
            ExitCode::from(2)
        }
    }
}

/// Whether the committed table holds.
fn run(only: &str, renew: bool) -> Result<bool, Box<dyn Error>> {
    let measured = measure(&image_path()?, only, renew)?;
    settle(COMMITTED, renew, &measured, |committed| {
        Ok(measured.complaints(&Table::parse(committed)?, only))
    })
}

/// It holds nothing: it is to be read.
fn print_profile(line: Option<&str>) -> Result<bool, Box<dyn Error>> {
    print!("{}", profile(&image_path()?, line)?);
    Ok(true)
}
