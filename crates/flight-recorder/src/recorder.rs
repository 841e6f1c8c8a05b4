//! Keeps what leads to a trip.

use crate::board::RecordedBoard;
use crate::call::{Call, Outcome};
use crate::copy;
use crate::file::{HalfHead, Head, MARK};
use crate::log::{Kept, Log, Room};
use crate::shelf::Shelf;
use core::ops::Range;
use gateway::{Board, FlightPage, Gateway, Instant, Part, Set};
use heapless::Vec;
use host_protocol::{BootReason, Trip, TripReason};

/// What a recorder must remember to find over a reset what it has kept: the trip, the halves, the
/// one that was written last, its number, and the run.
type Remembered = (Option<(u8, Trip)>, [Kept; 2], u8, u32, Run);
/// Of the run that was recorded, what the next one's board tells otherwise: why it was started, and
/// whether the one before it had left a crash report. Its hosts were told so.
type Run = (BootReason, bool);
/// [`Remembered`] takes no more bytes.
const REMEMBERED_BYTES: usize = 160;
/// What stands for the text of that report, which no host is told unasked.
const A_CRASH_REPORT: &str = "that of the run that was recorded";
/// A copy of a core that is at rest takes fewer turns than there are parts; one that takes more
/// turns than this is given up.
const MOST_TURNS: usize = 4 * Part::COUNT;
/// A turn encodes parts of an axis or a link until it has so many bytes.
const ENOUGH: usize = 64;
/// What a part takes of its time whatever it has, in bytes.
const PART_TAKES: usize = 8;
/// Parts before those of the copies: what a file begins with, and the calls of each half.
const FIRST_PARTS: usize = 3;

/// Keeps the latest calls to a core.
///
/// Its caller [notes](Self::note) each [`Call`] right before it makes it. When it has time it has
/// the recorder [watch](Self::watch) what has come of them, and [copy](Self::copy_some) the core.
pub struct Recorder<S> {
    shelf: S,
    state: State,
    /// A copy is to be made in the half that is not written, and the making has begun.
    wants_copy: bool,
    copies: bool,
    /// The last copy was given up: the next one is begun when the half that is written is full.
    gave_up: bool,
    /// Parts to be copied next, and how many turns this copy has taken.
    pending: Range<usize>,
    turns: usize,
    places: copy::Places,
    halves: [Kept; 2],
    /// Of the core that was copied last.
    board: &'static Board,
    /// The half that is written.
    half: usize,
    /// Counts the halves that were begun; one that is no successor of the other begins anew.
    number: u32,
    /// The first axis that tripped, and its trip.
    trip: Option<(u8, Trip)>,
    /// The run that was recorded, if it was not this one.
    run_before: Option<Run>,
    /// What the memory remembers is to be written anew.
    is_forgetful: bool,
    log: Log,
    /// What was seen at the last look.
    outcome: Option<Outcome>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Nothing moves, or what led to a trip is kept.
    Waits,
    /// An axis moves, and there is no copy yet behind which calls could be kept.
    Begins,
    Records,
    /// After a trip: until the half is full.
    Ends,
}

impl<S: Shelf> Recorder<S> {
    /// A recorder that has kept nothing and waits.
    pub const fn new(shelf: S, board: &'static Board) -> Self {
        Self {
            shelf,
            state: State::Waits,
            wants_copy: false,
            copies: false,
            gave_up: false,
            pending: 0..0,
            turns: 0,
            places: [0; Part::COUNT],
            halves: [Kept::NOTHING; 2],
            board,
            half: 0,
            number: 0,
            trip: None,
            run_before: None,
            is_forgetful: false,
            log: Log::new(),
            outcome: None,
        }
    }

    /// Whether calls are kept at present, or are to be.
    pub fn is_recording(&self) -> bool {
        self.state != State::Waits
    }

    /// The axis that tripped first, and its trip.
    pub fn trip(&self) -> Option<(u8, Trip)> {
        self.trip
    }

    /// Whether [`copy_some`](Self::copy_some) has something to do.
    pub fn wants_copy(&self) -> bool {
        self.wants_copy
    }

    /// Adds nothing more to what is kept of a trip, so that it can be read piece by piece. Whether
    /// that is so: not while an axis moves that may trip.
    pub fn end(&mut self) -> bool {
        if self.outcome.is_some_and(|outcome| !outcome.moving.is_empty()) {
            return false;
        }
        if self.state == State::Ends {
            self.wait();
        }
        self.state == State::Waits
    }

    /// Another core begins, and the memory has kept what it had, or not.
    pub(crate) fn restart(&mut self, keeps: bool) {
        self.wait();
        if !keeps {
            (self.trip, self.halves) = (None, [Kept::NOTHING; 2]);
        }
        (self.outcome, self.log) = (None, Log::new());
    }

    fn wait(&mut self) {
        (self.state, self.wants_copy, self.copies) = (State::Waits, false, false);
        // Not here: a stop may follow.
        self.is_forgetful = true;
    }

    /// After a start: takes what the run before has kept, if the memory has outlived it.
    pub(crate) fn recall(&mut self) {
        let found = self.shelf.remembered().map(postcard::from_bytes::<Remembered>);
        if let Some(Ok((trip, halves, half @ 0..=1, number, run))) = found {
            (self.trip, self.halves, self.half, self.number) = (trip, halves, half.into(), number);
            self.run_before = Some(run);
        }
    }

    /// The run that was recorded.
    fn run(&self) -> Run {
        let Board { boot, crash_report, .. } = self.board;
        self.run_before.unwrap_or((*boot, !crash_report.is_empty()))
    }

    /// Has the memory remember what is kept of a trip, or that there is none any more.
    fn remember(&mut self) {
        let half = u8::try_from(self.half).unwrap_or_default();
        let state: Remembered = (self.trip, self.halves, half, self.number, self.run());
        let mut bytes = [0; REMEMBERED_BYTES];
        if let Ok(bytes) = postcard::to_slice(&state, &mut bytes) {
            self.shelf.remember(bytes);
        }
    }

    /// Keeps a call that is about to be made. That a link is polled which has had nothing to send is
    /// kept once; one that had is told of by [`sent`](Self::sent).
    #[inline(always)]
    pub fn note(&mut self, core: &Gateway, now: Instant, call: &Call<'_>) {
        let is_kept = matches!(self.state, State::Records | State::Ends);
        if is_kept && self.log.is_news(call) && !self.keep_byte(now, call) {
            self.keep(core, now, call);
        }
    }

    /// Whether the call could be kept in one byte.
    #[inline(always)]
    fn keep_byte(&mut self, now: Instant, call: &Call<'_>) -> bool {
        let (first, is_all) = call.first();
        is_all
            && self.halves.get_mut(self.half).is_some_and(|half| {
                self.log.add_byte(half, self.shelf.half_mut(self.half), now, first)
            })
    }

    #[inline(never)]
    fn keep(&mut self, core: &Gateway, now: Instant, call: &Call<'_>) {
        let Some(half) = self.halves.get_mut(self.half) else { return };
        match self.log.add(half, self.shelf.half_mut(self.half), now, call) {
            Room::Enough => {}
            Room::Little => self.wants_copy |= self.state == State::Records && !self.gave_up,
            Room::None if self.state == State::Records => {
                // A trip that the calls before have led to, and nobody has looked at.
                self.trip = self.new_trip(core);
                if self.trip.is_some() {
                    self.wait();
                } else {
                    // What passes until the copy behind which to go on is whole is lost.
                    self.begin();
                }
            }
            Room::None => self.wait(),
        }
    }

    /// The trip of an axis that had not tripped at the last look: of one that did not trip because
    /// another did.
    fn new_trip(&self, core: &Gateway) -> Option<(u8, Trip)> {
        let seen = self.outcome.map_or(Set::NONE, |seen| seen.tripped);
        let new = core.trips(core.tripped().without(seen));
        new.min_by_key(|(_, trip)| matches!(trip.reason, TripReason::Group { .. }))
    }

    /// `poll_host` gave something: another time it may give more.
    pub fn sent(&mut self) {
        self.log.forget_idle();
    }

    /// Whether there is something to [watch](Self::watch), or to [copy](Self::copy_some).
    #[inline(always)]
    pub fn is_due(&self, core: &Gateway) -> bool {
        let wants = self.wants_copy || self.is_forgetful;
        wants || Outcome::has_changed(core, self.outcome)
    }

    /// Looks at what has come of the calls so far. It takes its time: the stops go first.
    pub fn watch(&mut self, core: &mut Gateway, now: Instant) {
        if let Some(outcome) = Outcome::behind(core, self.outcome) {
            self.came(core, now, outcome);
        }
        if core::mem::take(&mut self.is_forgetful) {
            self.remember();
        }
    }

    fn came(&mut self, core: &mut Gateway, now: Instant, outcome: Outcome) {
        let Outcome { armed, moving, .. } = outcome;
        let were_armed = self.outcome.map_or(Set::NONE, |seen| seen.armed);
        let newly_armed = !armed.without(were_armed).is_empty();
        let new_trip = self.new_trip(core);
        self.note(core, now, &Call::Came(outcome));
        self.outcome = Some(outcome);
        match self.state {
            State::Waits if newly_armed => {
                (self.trip, self.run_before) = (None, None);
                self.remember();
                self.begin();
            }
            State::Ends if newly_armed => {
                (self.trip, self.run_before) = (None, None);
                self.remember();
                self.state = State::Records;
            }
            State::Records if new_trip.is_some() => {
                // The stop is to be in it: where little room is left, a copy is wanted already.
                self.trip = new_trip;
                self.remember();
                self.state = State::Ends;
            }
            State::Begins | State::Records if moving.is_empty() => self.wait(),
            _ => {}
        }
    }

    /// Begins anew behind the next copy.
    fn begin(&mut self) {
        // What is there is no predecessor.
        self.number = self.number.wrapping_add(1);
        (self.state, self.wants_copy, self.gave_up) = (State::Begins, true, false);
    }

    /// Copies a part of the core, and goes on behind the copy when it is whole. Returns whether
    /// more is to be copied. Between two calls to the core.
    pub fn copy_some(&mut self, core: &mut Gateway, now: Instant) -> bool {
        let other = 1 - self.half;
        if !core::mem::replace(&mut self.copies, true) {
            core.begin_copy();
            (self.pending, self.places, self.turns) = (0..0, [0; Part::COUNT], 0);
            if let Some(half) = self.halves.get_mut(other) {
                *half = Kept::NOTHING;
            }
            // Before anything of what it had is written over.
            self.remember();
            return true;
        }
        core.next_deadline();
        if self.pending.is_empty() {
            self.pending = core.next_to_copy().unwrap_or_default();
        }
        let Range { start, end } = self.pending;
        let (mut fits, mut bytes) = (true, 0);
        for part in start..end {
            let copied = self.copy_part(other, core, part);
            self.pending.start = part + 1;
            fits &= copied.is_some();
            bytes += PART_TAKES + copied.unwrap_or_default();
            if S::CORE.is_none() && bytes >= ENOUGH {
                break;
            }
        }
        let has_more = !self.pending.is_empty() || core.has_more_to_copy();
        let last: &[usize] = if has_more { &[] } else { &Part::LAST };
        fits &= last.iter().all(|part| self.copy_part(other, core, *part).is_some());
        self.turns += 1;
        if !fits || (has_more && self.turns > MOST_TURNS) {
            // A copy is larger than a half, or the core changes faster than it is copied.
            (self.wants_copy, self.copies, self.gave_up) = (false, false, true);
            if self.state == State::Begins {
                self.wait();
            }
            return false;
        }
        if has_more {
            return true;
        }
        self.board = core.board();
        self.number = self.number.wrapping_add(1);
        if let Some(half) = self.halves.get_mut(other) {
            (half.number, half.since) = (Some(self.number), now);
        }
        (self.half, self.log) = (other, Log::from(now));
        (self.wants_copy, self.copies, self.gave_up) = (false, false, false);
        if self.state == State::Begins {
            self.state = State::Records;
        }
        false
    }

    /// How many bytes were encoded for this part; `None` where there was no room for it.
    fn copy_part(&mut self, half: usize, core: &Gateway, index: usize) -> Option<usize> {
        let kept = self.halves.get_mut(half)?;
        if let Some(bytes) = S::CORE {
            self.shelf.copy(half, core, index);
            kept.copy = bytes;
            return Some(0);
        }
        let (half, part) = (self.shelf.half_mut(half), Part::of(core, index)?);
        let put = copy::put(half, core::mem::take(&mut kept.copy), &mut self.places, index, &part);
        let (length, bytes) = put?;
        kept.copy = length;
        Some(bytes)
    }

    /// The halves that belong together, the older one first.
    fn kept(&self) -> impl Iterator<Item = (usize, Kept)> {
        let of = |half: usize| Some((half, *self.halves.get(half)?));
        let last = of(self.half).filter(|(_, last)| last.number.is_some());
        let before = last.and_then(|(_, last)| last.number).map(|number| number.wrapping_sub(1));
        let older = of(1 - self.half).filter(|(_, older)| older.number == before);
        older.filter(|_| before.is_some()).into_iter().chain(last)
    }

    /// What a host reads of a trip; nothing where none has been kept.
    pub fn page_of_trip<'a>(&self, part: u16, offset: u32, out: &'a mut [u8]) -> FlightPage<'a> {
        let parts = if self.trip.is_some() { self.parts() } else { 0 };
        let read = if part < parts { self.read(part, offset, out) } else { 0 };
        let offset = usize::try_from(offset).unwrap_or(usize::MAX);
        let written = read.saturating_sub(offset).min(out.len());
        FlightPage {
            id: self.number,
            parts,
            length: u32::try_from(read).unwrap_or(u32::MAX),
            bytes: out.get(..written).unwrap_or_default(),
        }
    }

    /// How many parts make a file of what has been kept, one behind the other; 0 where nothing has.
    pub fn parts(&self) -> u16 {
        let parts = match self.kept().count() {
            0 => 0,
            halves => FIRST_PARTS + halves * Part::COUNT,
        };
        u16::try_from(parts).unwrap_or(u16::MAX)
    }

    /// Writes bytes of a part from `offset` on to `out`, as far as there is room; how many the part
    /// has in all.
    pub fn read(&self, part: u16, offset: u32, out: &mut [u8]) -> usize {
        let offset = usize::try_from(offset).unwrap_or(usize::MAX);
        match usize::from(part) {
            0 => {
                let half = |(_, kept): (usize, Kept)| HalfHead {
                    since: kept.since,
                    calls: u32::try_from(kept.calls).unwrap_or(u32::MAX),
                };
                let halves: Vec<HalfHead, 2> = self.kept().map(half).collect();
                let mut board = RecordedBoard::from(self.board);
                if let Some((boot, has_report)) = self.run_before {
                    board.boot = boot;
                    board.crash_report = if has_report { A_CRASH_REPORT } else { "" };
                }
                let head = Head { trip: self.trip, halves, board };
                copy::encode(&(MARK, head), offset, out)
            }
            part @ 1..FIRST_PARTS => {
                let Some((half, kept)) = self.kept().nth(part - 1) else { return 0 };
                let calls = self.shelf.half(half).get(kept.copy..).unwrap_or_default();
                let calls = calls.get(..kept.calls).unwrap_or_default();
                copy::copy(calls, offset, out)
            }
            part => {
                let part = part - FIRST_PARTS;
                let Some((half, kept)) = self.kept().nth(part / Part::COUNT) else { return 0 };
                let part = part % Part::COUNT;
                if S::CORE.is_some() {
                    let part = self.shelf.core(half).and_then(|core| Part::of(core, part));
                    return part.map_or(0, |part| copy::encode(&part, offset, out));
                }
                let bytes = self.shelf.half(half).get(..kept.copy).unwrap_or_default();
                copy::read(bytes, part, offset, out)
            }
        }
    }
}
