//! Scenarios: a text file, a line a step. `scenarios/README.md` lists the steps.

mod bench;
mod expect;
mod steps;
mod words;

use bench::Bench;

/// Runs a scenario; an error names the line and what was wrong with it.
pub fn run(text: &str) -> Result<(), String> {
    let mut bench = Bench::new()?;
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = words::without_comment(line).split_whitespace().collect();
        if words.is_empty() {
            continue;
        }
        bench.step(&words).map_err(|error| format!("line {number}: {line}\n  {error}\n{}", bench.story()))?;
    }
    Ok(())
}
