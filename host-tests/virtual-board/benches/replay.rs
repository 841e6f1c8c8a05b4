//! Plays what a flight recorder has kept to the image of its board, and prints what came of it as
//! JSON, or why nothing did, for `mgw replay --image`.
//!
//! `.ci/virtual-board replay FILE` builds the images and runs that one, in virtual time.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use mgw_cli::flight::OnImage;
use virtual_board::replay::replay;

fn main() -> ExitCode {
    // `cargo bench` adds one of its own.
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let [file] = &arguments[..] else {
        eprintln!("usage: replay FILE");
        return ExitCode::from(2);
    };
    let played = run(Path::new(file)).map_err(|error| error.to_string());
    println!("{}", serde_json::to_string(&played).expect("it has words for all of it"));
    ExitCode::SUCCESS
}

fn run(file: &Path) -> Result<OnImage, Box<dyn Error>> {
    Ok(replay(&std::fs::read(file)?)?)
}
