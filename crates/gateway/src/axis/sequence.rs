//! A place in a table of exchanges: arming, reading, clearing and stopping all go through one.

use crate::protocol::Exchange;
use serde::{Deserialize, Serialize};

/// What comes next of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Sequence {
    #[serde(skip)]
    steps: &'static [Exchange],
    at: usize,
}

impl Sequence {
    pub const fn new(steps: &'static [Exchange]) -> Self {
        Self { steps, at: 0 }
    }

    /// The same place in its table, which a snapshot leaves out.
    pub fn attach(&mut self, steps: &'static [Exchange]) {
        self.steps = steps;
    }

    /// The step to do; `None` where all are done.
    pub fn step(&self) -> Option<Exchange> {
        self.steps.get(self.at).copied()
    }

    /// The step behind that.
    pub fn step_behind(&self) -> Option<Exchange> {
        self.steps.get(self.at + 1).copied()
    }

    /// Whether a step behind this one is the same, so that its answer is the one that counts.
    pub fn comes_again(&self, exchange: Exchange) -> bool {
        self.steps.iter().skip(self.at + 1).any(|later| *later == exchange)
    }

    /// Whether a step before this one was it.
    pub fn has_passed(&self, exchange: Exchange) -> bool {
        self.steps.iter().take(self.at).any(|earlier| *earlier == exchange)
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        self.at = 0;
    }

    /// The step is done.
    pub fn advance(&mut self) {
        self.at = self.at.saturating_add(1);
    }

    /// The step before is to be done again.
    pub fn step_back(&mut self) {
        self.at = self.at.saturating_sub(1);
    }

    /// Passes over needless steps.
    pub fn pass_over(&mut self, is_needless: impl Fn(Exchange) -> bool) {
        while self.step().is_some_and(&is_needless) {
            self.advance();
        }
    }
}
