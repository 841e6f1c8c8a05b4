//! Measures reaction times, prints the table and compares it with the committed one; `--renew`
//! writes that anew.
//!
//! `.ci/virtual-board reaction [--board BOARD] [--phases N] [--only LINE] [--trace | --renew]`
//! builds the image and runs it, in virtual time. `--trace` prints instead what the bus carried
//! about the slowest stop of each line.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use virtual_board::board::Board;
use virtual_board::machine::image_path;
use virtual_board::reaction::{Complaint, FEW_PHASES, LEGEND, Table, measure, traces};
use virtual_board::sections;

/// The committed table.
const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/reaction-times.txt");

/// What was asked for.
#[derive(Debug, Default)]
struct Arguments {
    phases: Option<u32>,
    /// Only the lines whose names contain it.
    only: Option<String>,
    renew: bool,
    trace: bool,
}

impl Arguments {
    fn read(arguments: impl Iterator<Item = String>) -> Option<Self> {
        let mut read = Self::default();
        // `cargo bench` adds one of its own.
        let mut arguments = arguments.filter(|argument| argument != "--bench");
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--phases" => {
                    read.phases = Some(arguments.next()?.parse().ok().filter(|phases| *phases > 0)?)
                }
                "--only" => read.only = Some(arguments.next()?),
                "--renew" => read.renew = true,
                "--trace" => read.trace = true,
                _ => return None,
            }
        }
        // A table of some lines is none.
        (!read.renew || read.only.is_none() && !read.trace).then_some(read)
    }
}

fn main() -> ExitCode {
    let Some(arguments) = Arguments::read(std::env::args().skip(1)) else {
        eprintln!("usage: reaction [--phases N] [--only LINE] [--trace | --renew]");
        return ExitCode::from(2);
    };
    match run(&arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether the committed table holds.
fn run(arguments: &Arguments) -> Result<bool, Box<dyn Error>> {
    let only = arguments.only.as_deref().unwrap_or_default();
    let phases = arguments.phases.map_or(FEW_PHASES, |phases| [phases; FEW_PHASES.len()]);
    if arguments.trace {
        print!("{}", traces(&image_path()?, phases, only)?);
        return Ok(true);
    }
    let measured = measure(&image_path()?, phases, only)?;
    print!("{measured}");
    let (path, board) = (Path::new(COMMITTED), Board::chosen());
    let text = fs::read_to_string(path).map_err(|error| format!("{COMMITTED}: {error}"))?;
    if arguments.renew {
        let renewed = sections::renewed(&text, LEGEND, board, &measured.to_string());
        fs::write(path, renewed).map_err(|error| format!("{COMMITTED}: {error}"))?;
        println!("renewed {COMMITTED}");
        return Ok(true);
    }
    let section = sections::section(&text, board);
    let section = section.ok_or_else(|| format!("{COMMITTED}: nothing of {}", board.name()))?;
    let committed = Table::parse(section).map_err(|error| format!("{COMMITTED}: {error}"))?;
    let mut complaints = measured.complaints(&committed);
    if arguments.only.is_some() {
        complaints.retain(|complaint| !matches!(complaint, Complaint::NotMeasured(_)));
    }
    for complaint in &complaints {
        eprintln!("{complaint}");
    }
    if complaints.is_empty() {
        println!("nothing is slower than {COMMITTED} says");
    }
    Ok(complaints.is_empty())
}
