//! A folder of scenarios as tests.

use crate::scenario::seeds;
use libtest_mimic::{Arguments, Failed, Trial};
use std::path::Path;
use std::process::ExitCode;

/// Plays one scenario, its text and a seed, and says what went wrong.
type Run = fn(&str, u64) -> Result<(), String>;

/// The `main` of a test target: every `.txt` file of a folder of this crate is a test with the name
/// of the file. It takes the arguments of any test; `MGW_SEEDS=100` plays each with more seeds,
/// `MGW_SEED=7` with one.
///
/// # Panics
/// If the folder cannot be read.
pub fn play_all(folder: &str, target: &'static str, run: Run) -> ExitCode {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries =
        std::fs::read_dir(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut trials = Vec::new();
    for entry in entries {
        let path = entry.unwrap_or_else(|error| panic!("{}: {error}", path.display())).path();
        let Some(name) = path.file_stem().and_then(|name| name.to_str()).map(str::to_owned) else {
            continue;
        };
        if path.extension().is_some_and(|extension| extension == "txt") {
            trials.push(Trial::test(name.clone(), move || play(&path, &name, target, run)));
        }
    }
    assert!(!trials.is_empty(), "{}: no scenario", path.display());
    trials.sort_by(|one, other| one.name().cmp(other.name()));
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}

fn play(path: &Path, name: &str, target: &str, run: Run) -> Result<(), Failed> {
    let text = std::fs::read_to_string(path)?;
    for seed in seeds()? {
        run(&text, seed).map_err(|error| {
            let again =
                format!("MGW_SEED={seed} cargo test -p host-tests --test {target} -- {name}");
            format!("{name}, seed {seed}\n{error}\nagain: {again}")
        })?;
    }
    Ok(())
}
