//! Keeps what leads to a trip.

use crate::board::RecordedBoard;
use crate::call::{Call, Outcome};
use crate::memory::{self, Head};
use gateway::{Gateway, Instant, Set};
use host_protocol::{Trip, TripReason};

/// Keeps the latest calls to a core in a memory of the caller's.
///
/// The caller [notes](Self::note) each [`Call`] right before it makes it, and has the recorder
/// [watch](Self::watch) what has come of it after each `handle`.
pub struct Recorder<M> {
    memory: M,
    state: State,
    /// The half that is written, and its number.
    half: usize,
    number: u32,
    /// Where in its contents the next call comes, and the first came.
    at: usize,
    calls_at: usize,
    /// When the last call was made.
    last: Instant,
    /// What was asked since anything changed: another time it changes nothing.
    asked: Asked,
    /// What was seen at the last look.
    outcome: Option<Outcome>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Asked {
    changes: bool,
    deadline: bool,
    /// Links that had nothing to send.
    links: Set,
}

impl Asked {
    /// Takes a call; whether it may change something.
    fn take(&mut self, call: &Call<'_>) -> bool {
        match call {
            Call::TakeChanges => !core::mem::replace(&mut self.changes, true),
            Call::NextDeadline => {
                let is_new = !core::mem::replace(&mut self.deadline, true);
                self.changes &= !is_new;
                is_new
            }
            Call::PollHost { link } => {
                let is_new = !self.links.has(*link);
                self.links = self.links.with(Set::of(*link));
                self.changes &= !is_new;
                is_new
            }
            _ => {
                *self = Self::default();
                true
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Nothing moves, or what led to a trip is kept.
    Waits,
    Records,
    /// After a trip: until the half is full.
    Ends,
}

/// The trip of one of these axes: of one that did not trip because another did.
fn new_trip(core: &Gateway, axes: Set) -> Option<(u8, Trip)> {
    core.trips(axes).min_by_key(|(_, trip)| matches!(trip.reason, TripReason::Group { .. }))
}

impl<M: AsRef<[u8]> + AsMut<[u8]>> Recorder<M> {
    /// A recorder that waits. What the memory holds stays until an axis is armed.
    pub fn new(memory: M) -> Self {
        let newest = (0..2).filter_map(|half| memory::head(memory::half(memory.as_ref(), half)));
        let number = newest.map(|head| head.number).max().unwrap_or_default();
        Self {
            memory,
            state: State::Waits,
            half: 0,
            number,
            at: 0,
            calls_at: 0,
            last: Instant::from_micros(0),
            asked: Asked::default(),
            outcome: None,
        }
    }

    /// All of it, for [`Recording::read`](crate::Recording::read).
    pub fn memory(&self) -> &[u8] {
        self.memory.as_ref()
    }

    /// Whether calls are kept at present.
    pub fn is_recording(&self) -> bool {
        self.state != State::Waits
    }

    /// Adds nothing more to what is kept of a trip, so that it can be read piece by piece. Whether
    /// that is so: not while it records, and an axis moves that may trip.
    pub fn end(&mut self) -> bool {
        let moves = self.outcome.is_some_and(|outcome| !outcome.moving.is_empty());
        if self.state == State::Ends && !moves {
            self.state = State::Waits;
        }
        !self.is_recording()
    }

    /// Keeps a call that is about to be made. What was asked and changes nothing another time is
    /// kept once; a link that had something to send is told of by [`sent`](Self::sent).
    pub fn note(&mut self, core: &mut Gateway, now: Instant, call: &Call<'_>) {
        if self.state == State::Waits || !self.asked.take(call) || self.add(now, call) {
            return;
        }
        // The half is full.
        if self.state == State::Ends {
            self.state = State::Waits;
            return;
        }
        if !self.begin_other_half(core, now) || !self.add(now, call) {
            self.state = State::Waits;
        }
    }

    /// Goes on in the other half; whether a snapshot fits there.
    fn begin_other_half(&mut self, core: &mut Gateway, now: Instant) -> bool {
        self.number = self.number.wrapping_add(1);
        self.half = 1 - self.half;
        self.begin(core, now)
    }

    /// Whether most of the half is taken.
    fn is_nearly_full(&self) -> bool {
        let room = memory::contents(memory::half(self.memory.as_ref(), self.half)).len();
        self.at > room - room / 4
    }

    /// `poll_host` gave something: another time it may give more.
    pub fn sent(&mut self) {
        self.asked = Asked::default();
    }

    /// Looks at what has come of an event.
    pub fn watch(&mut self, core: &mut Gateway, now: Instant) {
        let outcome = Outcome::of(core);
        let Outcome { moving, tripped, .. } = outcome;
        let (moved, had_tripped) =
            self.outcome.map_or((Set::NONE, Set::NONE), |seen| (seen.moving, seen.tripped));
        let newly_armed = !moving.without(moved).is_empty();
        let new_trip = new_trip(core, tripped.without(had_tripped));
        if self.outcome.replace(outcome) != Some(outcome) {
            self.note(core, now, &Call::Came(outcome));
        }
        match self.state {
            State::Waits if newly_armed => {
                memory::put_trip(self.memory.as_mut(), None);
                // What is there is no predecessor.
                self.number = self.number.wrapping_add(2);
                if self.begin(core, now) {
                    self.state = State::Records;
                }
            }
            State::Ends if newly_armed => {
                memory::put_trip(self.memory.as_mut(), None);
                self.state = State::Records;
            }
            State::Records if new_trip.is_some() => {
                memory::put_trip(self.memory.as_mut(), new_trip);
                self.state = State::Ends;
                // The stop is to be in it.
                if self.is_nearly_full() && !self.begin_other_half(core, now) {
                    self.state = State::Waits;
                }
            }
            State::Records if moving.is_empty() => self.state = State::Waits,
            _ => {}
        }
    }

    /// Begins the half with a snapshot; whether that fits.
    fn begin(&mut self, core: &mut Gateway, now: Instant) -> bool {
        let board = RecordedBoard::from(core.board());
        let half = memory::half_mut(self.memory.as_mut(), self.half);
        let contents = memory::contents_mut(half);
        let Ok(board) = postcard::to_slice(&board, contents).map(|written| written.len()) else {
            return false;
        };
        let rest = contents.get_mut(board..).unwrap_or_default();
        let Some(snapshot) = core.snapshot(rest).map(<[u8]>::len) else { return false };
        memory::put_head(
            half,
            &Head { number: self.number, since: now, board, snapshot, calls: 0 },
        );
        (self.calls_at, self.at, self.last) = (board + snapshot, board + snapshot, now);
        self.asked = Asked::default();
        true
    }

    /// Writes a call behind the others; whether there was room.
    fn add(&mut self, now: Instant, call: &Call<'_>) -> bool {
        let half = memory::half_mut(self.memory.as_mut(), self.half);
        let Some(rest) = memory::contents_mut(half).get_mut(self.at..) else { return false };
        let since = now.as_micros().saturating_sub(self.last.as_micros());
        let Ok(written) = postcard::to_slice(&(since, call), rest) else { return false };
        self.at += written.len();
        self.last = self.last.max(now);
        memory::put_calls(half, self.at - self.calls_at);
        true
    }
}
