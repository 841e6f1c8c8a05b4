//! Plays scenarios by name and tells what went wrong.
//!
//! ```text
//! cargo run -p host-tests --example scenario -- NAME [SEED]          one scenario with one seed (default 1)
//! cargo run -p host-tests --example scenario -- NAME [SEED] --trace  the same, and every frame on the buses
//! cargo run -p host-tests --example scenario -- --all [SEEDS]        all of them with the seeds 1 to SEEDS (default 8)
//! ```
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use host_tests::scenario;

fn main() -> ExitCode {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let with_trace = arguments.iter().any(|argument| argument == "--trace");
    arguments.retain(|argument| argument != "--trace");
    let number = arguments.get(1).map(|text| text.parse::<u64>());
    let result = match (arguments.first().map(String::as_str), number.transpose()) {
        (_, Err(error)) => Err(format!("the seed: {error}")),
        (None, _) => Err("which scenario? A name of host-tests/scenarios, or --all".to_string()),
        (Some("--all"), Ok(seeds)) => play_all(seeds.unwrap_or(8)),
        (Some(name), Ok(seed)) => play(name, seed.unwrap_or(1), with_trace),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios")
}

fn read(name: &str) -> Result<String, String> {
    let path = folder().join(format!("{name}.txt"));
    std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
}

fn play(name: &str, seed: u64, with_trace: bool) -> Result<(), String> {
    let trace = scenario::trace(&read(name)?, seed)
        .map_err(|error| format!("{name}, seed {seed}\n{error}"))?;
    if with_trace {
        println!("{trace}");
    }
    println!("{name}, seed {seed}: as it should be");
    Ok(())
}

fn play_all(seeds: u64) -> Result<(), String> {
    let entries = std::fs::read_dir(folder()).map_err(|error| error.to_string())?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| {
            entry.ok()?.file_name().into_string().ok()?.strip_suffix(".txt").map(str::to_string)
        })
        .collect();
    names.sort();
    let mut failures = 0;
    for name in &names {
        for seed in 1..=seeds {
            if let Err(error) = play(name, seed, false) {
                eprintln!("{error}");
                failures += 1;
            }
        }
    }
    if failures == 0 {
        Ok(())
    } else {
        Err(format!("{failures} of {} runs failed", names.len() as u64 * seeds))
    }
}
