//! The search from one prepared state.

use super::alphabet::Letter;
use crate::action::Step;
use crate::world::World;
use promise_model::{Check, Violation};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// What a sequence leads to that must not be.
#[derive(Debug, Clone, PartialEq)]
pub enum What {
    /// A promise is broken.
    Broken(Violation),
    /// The core or the model panics.
    Panic,
}

impl What {
    /// The promise.
    #[must_use]
    pub fn check(&self) -> Option<Check> {
        match self {
            Self::Broken(violation) => Some(violation.check),
            Self::Panic => None,
        }
    }
}

/// A sequence that must not be.
#[derive(Debug, Clone)]
pub struct Found {
    /// What it leads to.
    pub what: What,
    /// Its steps, behind those of the preparation.
    pub steps: Vec<Step>,
    /// Its letters.
    pub letters: Vec<Letter>,
}

/// A search: every sequence of so many letters, one behind another.
pub struct Search<'a> {
    letters: &'a [Letter],
    /// Axes from this number on are not used.
    axes: usize,
    stop: &'a AtomicBool,
    /// States from which the search went on, and how many letters it had to go.
    seen: HashMap<u128, u8>,
    text: String,
    path: Vec<usize>,
    steps: Vec<Step>,
    /// Sequences of exactly the wanted length that were judged.
    pub judged: u64,
    /// Sequences that were not gone on from, as their state had been reached before.
    pub cut: u64,
    /// What was found, one for each promise.
    pub found: Vec<Found>,
}

impl<'a> Search<'a> {
    /// A search with these letters, until it is told to stop.
    #[must_use]
    pub fn new(letters: &'a [Letter], axes: usize, stop: &'a AtomicBool) -> Self {
        Self {
            letters,
            axes,
            stop,
            seen: HashMap::new(),
            text: String::new(),
            path: Vec::new(),
            steps: Vec::new(),
            judged: 0,
            cut: 0,
            found: Vec::new(),
        }
    }

    /// Different states from which the search went on.
    #[must_use]
    pub fn states(&self) -> usize {
        self.seen.len()
    }

    /// Judges every sequence of `depth` letters that begins here.
    pub fn run(&mut self, world: &World, depth: u8) {
        let Some(left) = depth.checked_sub(1) else { return };
        let key = world.state_key(self.axes, &mut self.text);
        match self.seen.get(&key) {
            Some(before) if *before >= depth => {
                self.cut += 1;
                return;
            }
            _ => self.seen.insert(key, depth),
        };
        for (index, letter) in self.letters.iter().enumerate() {
            if self.stop.load(Ordering::Relaxed) {
                return;
            }
            let step = letter.step(world.since_start_us());
            let is_step = step.is_some();
            self.path.push(index);
            self.steps.extend(step);
            let mut world = world.clone();
            let happened = catch_unwind(AssertUnwindSafe(|| letter.happen(&mut world)));
            self.judged += u64::from(left == 0);
            match (happened, world.broken()) {
                (Err(_), _) => self.find(What::Panic),
                (Ok(()), Some(violation)) => self.find(What::Broken(violation.clone())),
                (Ok(()), None) => self.run(&world, left),
            }
            self.path.pop();
            if is_step {
                self.steps.pop();
            }
        }
    }

    fn find(&mut self, what: What) {
        if self.found.iter().any(|found| found.what.check() == what.check()) {
            return;
        }
        let letters = self.path.iter().map(|index| self.letters[*index].clone()).collect();
        self.found.push(Found { what, steps: self.steps.clone(), letters });
    }
}
