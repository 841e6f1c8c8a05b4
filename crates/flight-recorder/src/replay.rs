//! Does it all again.

use crate::call::{Call, Outcome};
use crate::recording::{Calls, Half, Recording};
use core::fmt;
use gateway::{Board, Gateway, Instant, ResumeError, Transmit};

/// A recording that is played again, call by call, on a core of this build.
pub struct Replay<'a> {
    core: Gateway,
    calls: Calls<'a>,
    /// The half behind the one that is played, and the core at its beginning.
    next: Option<Half<'a>>,
    next_copy: &'a [u8],
    /// What has come of the calls so far.
    outcome: Option<Outcome>,
    scratch: &'a mut [u8],
}

/// A call that was made again.
#[derive(Debug, Clone, PartialEq)]
pub struct Step<'a> {
    /// When, in the gateway's own time.
    pub at: Instant,
    /// The call.
    pub call: Call<'a>,
    /// The frame that it gave for a bus.
    pub transmit: Option<Transmit>,
}

/// The core is not in the state that was recorded: which axes move or have tripped, or all of it at
/// the end of the first half.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Diverged {
    /// When that was recorded, in the gateway's own time.
    pub at: Instant,
}

impl fmt::Display for Diverged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {} us the core is in another state than was recorded", self.at.as_micros())
    }
}

impl core::error::Error for Diverged {}

impl<'a> Replay<'a> {
    /// The core of the first copy. `board`: [that of the recording](Recording::board), which a
    /// core keeps for ever. `scratch`: room for a snapshot; where it is too small, the state at the
    /// end of the first half is not compared.
    ///
    /// # Errors
    /// Where no core of this build goes on from the copy.
    pub fn new(
        board: &'static Board,
        recording: &Recording<'a>,
        scratch: &'a mut [u8],
    ) -> Result<Self, ResumeError> {
        let mut halves = recording.halves.iter().copied();
        let first = halves.next().ok_or(ResumeError::Unreadable)?;
        let (core, next_copy) = Gateway::resume(board, recording.copies)?;
        let next = halves.next();
        let outcome = Outcome::behind(&core, None);
        // What is behind the last copy is of another build.
        if next.is_none() && !next_copy.is_empty() {
            return Err(ResumeError::Unreadable);
        }
        Ok(Self { core, calls: first.calls(), next, next_copy, outcome, scratch })
    }

    /// The core, as it is after the last step.
    pub fn core(&self) -> &Gateway {
        &self.core
    }

    /// A snapshot of the core as it is after the last step, for another that goes on from there.
    pub fn snapshot<'b>(&mut self, out: &'b mut [u8]) -> Option<&'b [u8]> {
        self.core.snapshot(out)
    }

    /// Makes the next call; `None` after the last.
    ///
    /// # Errors
    /// See [`Diverged`].
    pub fn step(&mut self) -> Option<Result<Step<'a>, Diverged>> {
        loop {
            if let Some((at, call)) = self.calls.next() {
                if let Some(recorded) = call.outcome() {
                    let played = Outcome::behind(&self.core, self.outcome);
                    self.outcome = Some(recorded);
                    if played != Some(recorded) {
                        return Some(Err(Diverged { at }));
                    }
                }
                if matches!(call, Call::Handle(_)) {
                    self.settle();
                }
                let transmit = call.make(&mut self.core, at);
                return Some(Ok(Step { at, call, transmit }));
            }
            let half = self.next.take()?;
            self.calls = half.calls();
            self.settle();
            let here = self.core.snapshot(self.scratch);
            if here.is_some_and(|here| here != self.next_copy) {
                return Some(Err(Diverged { at: half.since }));
            }
        }
    }

    /// What every port asks after each event, and no call is kept of.
    fn settle(&mut self) {
        self.core.take_changes();
        self.core.next_deadline();
    }
}
