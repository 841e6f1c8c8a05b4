//! Plays what a flight recorder has kept to the image, and prints what came of it as JSON, for `mgw
//! replay --image`.
//!
//! `.ci/virtual-board replay FILE` builds the image and runs it, in virtual time.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use virtual_board::replay::{Images, replay};

fn main() -> ExitCode {
    // `cargo bench` adds one of its own.
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let [file] = &arguments[..] else {
        eprintln!("usage: replay FILE");
        return ExitCode::from(2);
    };
    match run(Path::new(file)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{file}: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(file: &Path) -> Result<(), Box<dyn Error>> {
    let played = replay(&Images::named()?, &std::fs::read(file)?)?;
    println!("{}", serde_json::to_string(&played)?);
    Ok(())
}
