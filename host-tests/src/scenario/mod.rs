//! Scenarios: a text file, a line a step. `scenarios/README.md` lists the steps.
//!
//! What a scenario leaves open is drawn from a seed: how long each motor takes to answer, when
//! exactly the host speaks, with which numbers it counts. The same text and seed give the same run;
//! the outcome must hold for every seed.

mod bench;
mod expect;
mod expect_cycle;
mod expect_gateway;
mod expect_stop;
mod expect_wire;
mod faults;
mod hosts;
pub(crate) mod images;
mod report;
mod requests;
mod steps;
pub(crate) mod words;

use bench::Bench;
use mgw_sim::{FlightWiring, Wiring};

/// With how many seeds each scenario runs unless `MGW_SEEDS` says otherwise.
const SEEDS: u64 = 8;

/// The seeds to run a scenario with: `MGW_SEED` names one, `MGW_SEEDS` says how many, from 1 on.
///
/// # Errors
/// One of the variables is not a number.
pub fn seeds() -> Result<Vec<u64>, String> {
    let number = |name: &str| match std::env::var(name) {
        Ok(text) => text.parse().map(Some).map_err(|_| format!("{name}={text} is no number")),
        Err(_) => Ok(None),
    };
    match number("MGW_SEED")? {
        Some(seed) => Ok(vec![seed]),
        None => Ok((1..=number("MGW_SEEDS")?.unwrap_or(SEEDS)).collect()),
    }
}

/// Runs a scenario with one seed.
///
/// # Errors
/// The line that was wrong, what was expected, what was seen, and what went over the wires about
/// that time.
pub fn run(text: &str, seed: u64) -> Result<(), String> {
    play(text, seed).map(drop)
}

/// Runs a scenario with one seed, and returns everything that went over the buses, a line a frame.
///
/// # Errors
/// As [`run`].
pub fn trace(text: &str, seed: u64) -> Result<String, String> {
    play(text, seed).map(|bench| bench.whole_trace())
}

/// Runs a scenario with one seed, and returns the memory of the gateway's flight recorder.
///
/// # Errors
/// As [`run`].
pub fn flight_recorder(text: &str, seed: u64) -> Result<Vec<u8>, String> {
    play(text, seed).map(|bench| bench.world.borrow().flight_record())
}

/// The same with another flight recorder.
///
/// # Errors
/// As [`run`].
pub fn other_flight_recorder(
    text: &str,
    seed: u64,
    flight: FlightWiring,
) -> Result<Vec<u8>, String> {
    let wiring = Wiring { flight, ..Wiring::four_motors() };
    play_on(wiring, text, seed).map(|bench| bench.world.borrow().flight_record())
}

fn play(text: &str, seed: u64) -> Result<Bench, String> {
    play_on(Wiring::four_motors(), text, seed)
}

fn play_on(wiring: Wiring, text: &str, seed: u64) -> Result<Bench, String> {
    let lines = (1..).zip(text.lines()).map(|(number, line)| {
        let words: Vec<&str> = words::without_comment(line).split_whitespace().collect();
        (number, line, words)
    });
    let mut steps = lines.filter(|(_, _, words)| !words.is_empty()).peekable();
    // What hangs on the buses must be known before the world begins.
    let mut wiring = Wiring { seed, ..wiring };
    if steps.next_if(|(_, _, words)| words == &["no-motors"]).is_some() {
        wiring.motors.clear();
    }
    while let Some((number, line, words)) =
        steps.next_if(|(_, _, words)| words.first() == Some(&"motor"))
    {
        wiring = words::motor(wiring, &words)
            .map_err(|error| format!("line {number}: {line}\n  {error}"))?;
    }
    let mut bench = Bench::new(wiring, seed)?;
    for (number, line, words) in steps {
        bench.think(&words);
        if let Err(error) = bench.step(&words) {
            return Err(format!("line {number}: {line}\n  {error}\n{}", bench.report()));
        }
    }
    Ok(bench)
}
