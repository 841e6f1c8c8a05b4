//! Plays a scenario by name and tells what went wrong; `cargo test -p host-tests --test scenarios`
//! plays them all. The seed is 1 unless told otherwise; a trace has every frame on the buses.
//!
//! ```text
//! cargo run -p host-tests --example scenario -- NAME [SEED] [--trace]
//! ```
#![forbid(unsafe_code)]

use std::path::Path;
use std::process::ExitCode;

use host_tests::scenario;

fn main() -> ExitCode {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let with_trace = arguments.iter().any(|argument| argument == "--trace");
    arguments.retain(|argument| argument != "--trace");
    let result = match arguments.as_slice() {
        [name] => play(name, "1", with_trace),
        [name, seed] => play(name, seed, with_trace),
        _ => Err("which scenario? A name of host-tests/scenarios".to_string()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn play(name: &str, seed: &str, with_trace: bool) -> Result<(), String> {
    let seed = seed.parse().map_err(|error| format!("the seed: {error}"))?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenarios/{name}.txt"));
    let text =
        std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let trace =
        scenario::trace(&text, seed).map_err(|error| format!("{name}, seed {seed}\n{error}"))?;
    if with_trace {
        println!("{trace}");
    }
    println!("{name}, seed {seed}: as it should be");
    Ok(())
}
