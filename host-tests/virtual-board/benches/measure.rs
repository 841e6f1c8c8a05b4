//! Measures the image, prints the table and compares it with the committed one; `--renew` writes
//! that anew.
//!
//! `.ci/virtual-board measure [--board BOARD] [--renew]` builds the image and runs it. Everything
//! is counted in virtual time, so the figures are the same on every machine.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use virtual_board::board::Board;
use virtual_board::machine::image_path;
use virtual_board::measure::{LEGEND, Table, measure};
use virtual_board::sections;

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
    match run(renew) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether the committed table holds.
fn run(renew: bool) -> Result<bool, Box<dyn Error>> {
    let measured = measure(&image_path()?, renew)?;
    print!("{measured}");
    let (path, board) = (Path::new(COMMITTED), Board::chosen());
    let text = fs::read_to_string(path).map_err(|error| format!("{COMMITTED}: {error}"))?;
    if renew {
        let renewed = sections::renewed(&text, LEGEND, board, &measured.to_string());
        fs::write(path, renewed).map_err(|error| format!("{COMMITTED}: {error}"))?;
        println!("renewed {COMMITTED}");
        return Ok(true);
    }
    let section = sections::section(&text, board);
    let section = section.ok_or_else(|| format!("{COMMITTED}: nothing of {}", board.name()))?;
    let committed = Table::parse(section).map_err(|error| format!("{COMMITTED}: {error}"))?;
    let complaints = measured.complaints(&committed);
    for complaint in &complaints {
        eprintln!("{complaint}");
    }
    if complaints.is_empty() {
        println!("no value has grown by more than 5 % over {COMMITTED}");
    }
    Ok(complaints.is_empty())
}
