//! Measures reaction times, prints the table and compares it with the committed one; `--renew`
//! writes that anew.
//!
//! `.ci/virtual-board reaction [--board BOARD] [--phases N] [--only LINE] [--trace | --turns |
//! --turns-behind | --renew]` builds the image and runs it, in virtual time. `--trace` prints instead
//! what the bus carried about the slowest stop of each line, `--turns` the longest turns of the
//! tasks, `--turns-behind` every turn of them behind the cause of the latest stop.

use std::error::Error;
use std::process::ExitCode;

use virtual_board::machine::image_path;
use virtual_board::reaction::{FEW_PHASES, Look, Table, look, measure};
use virtual_board::sections::{exit_code, settle};

/// The committed table.
const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/reaction-times.txt");

/// What was asked for.
#[derive(Debug, Default)]
struct Arguments {
    phases: Option<u32>,
    /// Only the lines whose names contain it.
    only: Option<String>,
    renew: bool,
    look: Option<Look>,
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
                "--trace" => read.look = Some(Look::Trace),
                "--turns" => read.look = Some(Look::Turns),
                "--turns-behind" => read.look = Some(Look::TurnsBehind),
                _ => return None,
            }
        }
        // A table of some lines is none.
        (!read.renew || read.only.is_none() && read.look.is_none()).then_some(read)
    }
}

fn main() -> ExitCode {
    let Some(arguments) = Arguments::read(std::env::args().skip(1)) else {
        eprintln!(
            "usage: reaction [--phases N] [--only LINE] \
             [--trace | --turns | --turns-behind | --renew]"
        );
        return ExitCode::from(2);
    };
    exit_code(run(&arguments))
}

/// Whether the committed table holds.
fn run(arguments: &Arguments) -> Result<bool, Box<dyn Error>> {
    let only = arguments.only.as_deref().unwrap_or_default();
    let phases = arguments.phases.map_or(FEW_PHASES, |phases| [phases; FEW_PHASES.len()]);
    if let Some(at) = arguments.look {
        print!("{}", look(at, &image_path()?, phases, only)?);
        return Ok(true);
    }
    let measured = measure(&image_path()?, phases, only)?;
    settle(COMMITTED, arguments.renew, &measured, |committed| {
        Ok(measured.complaints(&Table::parse(committed)?, only))
    })
}
