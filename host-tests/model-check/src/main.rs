//! `model-check run [EVENTS [FIRST_SEED]]` runs random events until there were so many, on two
//! threads; `model-check bad-host` sends a million random frames between a trip and its
//! confirmation; `model-check survey EVENTS FIRST_SEED [CHECK...]` goes on, and prints the first
//! counterexample of each promise but these; `model-check replay FILE [CHECK...]` runs a
//! counterexample again, up to a broken promise other than these, and prints what was on the wires.

use model_check::exhaust::{self, Limits, Part};
use model_check::{Counts, Step, World, bad_host, broken_with, generate::Generator, shrink, text};
use promise_model::Violation;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Events of a run, unless told otherwise.
const EVENTS: u64 = 10_000_000;
/// Of them at least so many in a hundred must fall while an axis is armed, active or stopping.
const BUSY_PERCENT: u64 = 30;
const THREADS: usize = 2;
/// Steps of one seed: 5 to 10 s of gateway time.
const STEPS: usize = 20_000;
/// Frames of a bad host between a trip and its confirmation.
const BAD_FRAMES: u64 = 1_000_000;
/// After the last step, µs.
const SETTLE_US: u64 = 300_000;
/// Runs that the search for a shorter counterexample may take.
const SHRINK_RUNS: u32 = 2_000;

/// Letters of the longest sequences that are judged exhaustively, and how long that may take.
const DEPTH: u8 = 4;
const SECONDS: u64 = 240;

/// A list of steps that breaks a promise.
struct Counterexample {
    seed: u64,
    start_us: u64,
    steps: Vec<Step>,
    violation: Violation,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let number = |word: &str| word.replace('_', "").parse::<u64>().ok();
    match words.as_slice() {
        ["replay", file, known @ ..] => replay(file, known),
        ["bad-host"] => bad_host(),
        ["exhaust", limits @ ..] => exhaust(limits),
        ["survey", events, seed, known @ ..] if number(events).and(number(seed)).is_some() => {
            survey(number(events).unwrap_or(EVENTS), number(seed).unwrap_or(1), known)
        }
        ["run"] => run(EVENTS, 1),
        ["run", events] if number(events).is_some() => run(number(events).unwrap_or(EVENTS), 1),
        ["run", events, seed] if number(events).and(number(seed)).is_some() => {
            run(number(events).unwrap_or(EVENTS), number(seed).unwrap_or(1))
        }
        _ => usage(),
    }
}

fn usage() -> ExitCode {
    eprintln!(
        "usage: model-check run [EVENTS [FIRST_SEED]] | bad-host | \
         exhaust [--depth N] [--seconds N | --part K/N] | \
         survey EVENTS FIRST_SEED [CHECK...] | replay FILE [CHECK...]"
    );
    ExitCode::FAILURE
}

/// Every other run begins shortly before the clock's low 32 bits wrap around.
fn start_of(seed: u64) -> u64 {
    if seed.is_multiple_of(2) { 1_000 } else { (1 << 32) - 1_000_000 }
}

fn run(events: u64, first_seed: u64) -> ExitCode {
    let next = AtomicU64::new(first_seed);
    let stop = AtomicBool::new(false);
    let total = Mutex::new(Counts::default());
    let found = Mutex::new(None::<Counterexample>);
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    let (counts, broken) = run_seed(seed, &[]);
                    let Ok(mut total) = total.lock() else { return };
                    *total = total.plus(counts);
                    let is_broken = broken.is_some();
                    if let (Some(broken), Ok(mut found)) = (broken, found.lock()) {
                        found.get_or_insert(broken);
                    }
                    if is_broken || total.events >= events {
                        stop.store(true, Ordering::Relaxed);
                    }
                }
            });
        }
    });
    let total = total.into_inner().unwrap_or_default();
    let seeds = next.load(Ordering::Relaxed) - first_seed;
    let busy = total.busy * 100 / total.events.max(1);
    println!(
        "{} events of {seeds} seeds, {busy} % while an axis was armed, active or stopping; \
         {} motion frames, {} of them for several motors, {} frames behind a reply, {} armings, {} trips, \
         {} stops confirmed, {} starts",
        total.events,
        total.motions,
        total.started_together,
        total.behind_replies,
        total.armed,
        total.trips,
        total.confirmed,
        total.starts
    );
    if let Ok(Some(counterexample)) = found.into_inner() {
        return report(counterexample);
    }
    if busy < BUSY_PERCENT || total.events < events {
        eprintln!("too little has happened: {BUSY_PERCENT} % of {events} events are wanted");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// Runs seeds until there were so many events, and prints the first counterexample of each promise
/// that is not known to be broken.
fn survey(events: u64, first_seed: u64, known: &[&str]) -> ExitCode {
    let mut known: Vec<String> = known.iter().map(|check| (*check).to_owned()).collect();
    let mut total = Counts::default();
    for seed in first_seed.. {
        if total.events >= events {
            break;
        }
        let (counts, broken) = run_seed(seed, &known);
        total = total.plus(counts);
        if let Some(counterexample) = broken {
            println!("# after {} events", total.events);
            known.push(format!("{:?}", counterexample.violation.check));
            report(counterexample);
        }
    }
    println!("# {} events", total.events);
    ExitCode::SUCCESS
}

/// Runs one seed, up to the first broken promise that is not a known one.
fn run_seed(seed: u64, known: &[String]) -> (Counts, Option<Counterexample>) {
    let start_us = start_of(seed);
    let _told = ToldOnPanic(seed);
    let mut world = World::new(start_us);
    let mut generator = Generator::new(seed);
    let (mut steps, mut judged) = (Vec::new(), 0);
    for _ in 0..STEPS {
        let step = generator.next(&world);
        world.step(&step);
        steps.push(step);
        let is_new = |violation: &&Violation| {
            !known.iter().any(|known| violation.to_string().contains(known.as_str()))
        };
        let violations = world.oracle().violations();
        if let Some(violation) = violations.iter().skip(judged).find(is_new) {
            let violation = violation.clone();
            return (world.counts(), Some(Counterexample { seed, start_us, steps, violation }));
        }
        judged = violations.len();
    }
    let moving = world.not_at_rest_in_the_end();
    assert!(moving.is_empty(), "not at rest although everything works: {moving:?}");
    (world.counts(), None)
}

/// Tells which seed it was when the core panics.
struct ToldOnPanic(u64);

impl Drop for ToldOnPanic {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("in seed {}", self.0);
        }
    }
}

/// Shrinks a counterexample and prints it as a file.
fn report(counterexample: Counterexample) -> ExitCode {
    let Counterexample { seed, start_us, steps, violation } = counterexample;
    println!("# seed {seed}, {} steps: {violation}", steps.len());
    let check = violation.check;
    let steps = shrink(start_us, steps, check, SETTLE_US, SHRINK_RUNS);
    if let Some((violation, _)) = broken_with(start_us, &steps, SETTLE_US, Some(check)) {
        println!("# {violation}");
    }
    print!("{}", text::write(start_us, &steps));
    ExitCode::FAILURE
}

fn bad_host() -> ExitCode {
    match bad_host::run(1, BAD_FRAMES) {
        Ok(outcome) if outcome.frames == BAD_FRAMES && outcome.axes > 0 => {
            println!(
                "{} random frames between a trip and its confirmation: the stops of {} axes went \
                 on, at least {} times each, and were confirmed",
                outcome.frames, outcome.axes, outcome.fewest_stops
            );
            ExitCode::SUCCESS
        }
        Ok(outcome) => {
            eprintln!("too little has happened: {outcome:?}");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Every sequence up to a depth, as far as the time suffices.
fn exhaust(words: &[&str]) -> ExitCode {
    let mut limits = Limits { depth: DEPTH, time: Duration::from_secs(SECONDS), part: None };
    if words.contains(&"--seconds") && !words.contains(&"--depth") {
        // As deep as the time suffices.
        limits.depth = u8::MAX;
    }
    for pair in words.chunks(2) {
        match pair {
            ["--depth", depth] if depth.parse::<u8>().is_ok() => {
                limits.depth = depth.parse().unwrap_or(DEPTH)
            }
            ["--seconds", seconds] if seconds.parse::<u64>().is_ok() => {
                limits.time = Duration::from_secs(seconds.parse().unwrap_or(SECONDS));
            }
            ["--part", part] if Part::parse(part).is_some() => limits.part = Part::parse(part),
            _ => return usage(),
        }
    }
    if exhaust::run(limits) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn replay(file: &str, known: &[&str]) -> ExitCode {
    let read = std::fs::read_to_string(file).map_err(|error| error.to_string());
    let (start_us, steps) = match read.and_then(|content| text::read(&content)) {
        Ok(read) => read,
        Err(error) => {
            eprintln!("{file}: {error}");
            return ExitCode::FAILURE;
        }
    };
    let mut world = World::new(start_us);
    world.keep_trace();
    let is_new =
        |violation: &&Violation| !known.iter().any(|known| violation.to_string().contains(known));
    let broken = |world: &World| world.oracle().violations().iter().find(is_new).cloned();
    for step in &steps {
        world.step(step);
        if broken(&world).is_some() {
            break;
        }
    }
    let end = world.since_start_us() + SETTLE_US;
    while broken(&world).is_none() && world.since_start_us() < end {
        world.run_to(world.since_start_us() + 100);
    }
    world.trace().iter().for_each(|line| println!("{line}"));
    match broken(&world) {
        Some(violation) => {
            println!("{violation}");
            ExitCode::FAILURE
        }
        None => {
            println!("no promise is broken");
            ExitCode::SUCCESS
        }
    }
}
