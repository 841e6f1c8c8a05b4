//! All pairs in all prepared states, deeper and deeper.

use super::alphabet::alphabet;
use super::pairs::{PAIRS, Pair};
use super::prepared::{Prepared, prepare};
use super::search::{Found, Search};
use crate::shrink::shrink;
use crate::text;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Prefixes that a run over all prepared states must have judged; one over a part of them its share
/// of a quarter of that, as the states are unlike.
const WANTED: u64 = 10_000_000;
const UNLIKE: u64 = 4;
const THREADS: usize = 2;
/// So many times its time a depth may take while too little has been judged.
const PATIENCE: u32 = 4;
/// The clock's low 32 bits wrap around soon after the preparation.
const START_US: u64 = (1 << 32) - 250_000;
/// After the last step of a counterexample, µs, and runs that the search for a shorter one may
/// take.
const SETTLE_US: u64 = 400_000;
const SHRINK_RUNS: u32 = 500;

/// How far a run goes.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Letters of the longest sequences.
    pub depth: u8,
    /// Time.
    pub time: Duration,
    /// Only a part of the prepared states, but whole: however long that takes.
    pub part: Option<Part>,
}

/// The prepared states of a run: this one of so many parts of them.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    number: usize,
    of: usize,
}

impl Part {
    /// Reads `2/8`; `None` where that is no part.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (number, of) = text.split_once('/')?;
        let part = Self { number: number.parse().ok()?, of: of.parse().ok()? };
        (1..=part.of).contains(&part.number).then_some(part)
    }

    fn has(self, place: usize) -> bool {
        place % self.of + 1 == self.number
    }
}

/// What one depth of all searches comes to.
#[derive(Debug, Default)]
struct Level {
    /// Prepared states whose sequences were all judged.
    finished: usize,
    judged: u64,
    states: u64,
    cut: u64,
    found: Vec<(Pair, Prepared, Found)>,
}

/// Searches until a limit is reached, and prints what it comes to. Whether enough was judged and
/// nothing found.
#[must_use]
pub fn run(limits: Limits) -> bool {
    let begun = Instant::now();
    let stop = AtomicBool::new(false);
    let judged = AtomicU64::new(0);
    let mut is_clean = true;
    let (all, wanted) = match limits.part {
        None => (Part { number: 1, of: 1 }, WANTED),
        Some(part) => (part, WANTED / UNLIKE / u64::try_from(part.of).unwrap_or(u64::MAX)),
    };
    let scenes: Vec<(Pair, Prepared)> = PAIRS
        .iter()
        .flat_map(|pair| Prepared::ALL.map(|prepared| (*pair, prepared)))
        .enumerate()
        .filter_map(|(place, scene)| all.has(place).then_some(scene))
        .collect();
    let letters: usize = PAIRS.iter().map(|pair| alphabet(pair).len()).max().unwrap_or(0);
    println!(
        "{} pairs in {} prepared states, {} of them here, up to {letters} letters",
        PAIRS.len(),
        Prepared::ALL.len(),
        scenes.len()
    );
    for depth in 1..=limits.depth {
        // What is wanted is judged on a slow machine too.
        let missing = judged.load(Ordering::Relaxed) < wanted;
        let time = if missing { limits.time * PATIENCE } else { limits.time };
        let is_over = || limits.part.is_none() && begun.elapsed() >= time;
        let level = search_all(&scenes, depth, &stop, &is_over);
        judged.fetch_add(level.judged, Ordering::Relaxed);
        let is_whole = !stop.load(Ordering::Relaxed);
        println!(
            "depth {depth} of {} of {} prepared states: {} prefixes judged, \
             {} distinct states gone on from, {} cut off, {} s",
            level.finished,
            scenes.len(),
            level.judged,
            level.states,
            level.cut,
            begun.elapsed().as_secs()
        );
        report_all(&level.found);
        is_clean &= level.found.is_empty();
        if !is_whole {
            break;
        }
    }
    let judged = judged.into_inner();
    println!("{judged} prefixes judged in {} s", begun.elapsed().as_secs());
    if judged < wanted {
        eprintln!("too few: {wanted} are wanted");
    }
    is_clean && judged >= wanted
}

fn search_all(
    scenes: &[(Pair, Prepared)],
    depth: u8,
    stop: &AtomicBool,
    is_over: &(dyn Fn() -> bool + Sync),
) -> Level {
    let next = AtomicUsize::new(0);
    let level = Mutex::new(Level::default());
    let is_done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..THREADS)
            .map(|_| {
                scope.spawn(|| {
                    while let Some((pair, prepared)) =
                        scenes.get(next.fetch_add(1, Ordering::Relaxed))
                    {
                        let (world, _) = match prepare(START_US, pair, *prepared) {
                            Ok(ready) => ready,
                            Err(error) => panic!("{error}"),
                        };
                        let letters = alphabet(pair);
                        let axes = pair.axes.map(usize::from).into_iter().max().unwrap_or(0) + 1;
                        let mut search = Search::new(&letters, axes, stop);
                        search.run(&world, depth);
                        let states = u64::try_from(search.states()).unwrap_or(u64::MAX);
                        let Ok(mut level) = level.lock() else { return };
                        level.finished += usize::from(!stop.load(Ordering::Relaxed));
                        level.judged += search.judged;
                        level.states += states;
                        level.cut += search.cut;
                        level.found.extend(
                            search.found.into_iter().map(|found| (*pair, *prepared, found)),
                        );
                    }
                })
            })
            .collect();
        scope.spawn(|| {
            while !is_done.load(Ordering::Relaxed) {
                if is_over() {
                    stop.store(true, Ordering::Relaxed);
                }
                std::thread::sleep(Duration::from_millis(50));
            }
        });
        workers.into_iter().for_each(|worker| drop(worker.join()));
        is_done.store(true, Ordering::Relaxed);
    });
    level.into_inner().unwrap_or_default()
}

/// Prints one counterexample for each promise as a file that can be replayed, and where else there
/// are some.
fn report_all(found: &[(Pair, Prepared, Found)]) {
    for (index, (pair, prepared, this)) in found.iter().enumerate() {
        println!("# {}, {prepared:?}: {:?}", pair.name, this.what);
        println!("# {:?}", this.letters);
        if !found[..index].iter().any(|(.., before)| before.what.check() == this.what.check()) {
            print!("{}", replayable(pair, *prepared, this));
        }
    }
}

/// The shortest steps that are found to break the same promise.
fn replayable(pair: &Pair, prepared: Prepared, found: &Found) -> String {
    let before = prepare(START_US, pair, prepared).map(|(_, steps)| steps).unwrap_or_default();
    let steps = [before, found.steps.clone()].concat();
    let steps = match found.what.check() {
        Some(check) => shrink(START_US, steps, check, SETTLE_US, SHRINK_RUNS),
        None => steps,
    };
    text::write(START_US, &steps)
}
