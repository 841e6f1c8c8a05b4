//! The power is cut in the midst of an operation of the flash, in a branch of the run: what the
//! flash is when the board has started again and goes on.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use rigless::emulator::Host;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::branch::Play;
use super::flash::{FlashOperation, OFF};
use super::recorder::Recorder;
use super::{Machine, nanos};
use crate::board::Flash;
use virtual_stm32::socket::Socket;

/// Bytes that are compared at once.
const PIECE: usize = 8;

/// What the flash holds in some places.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FlashContents {
    /// The places, in whole words, and their bytes.
    pub places: Vec<(u64, Vec<u8>)>,
}

/// A flash that a board is expected to come to.
#[derive(Debug, Clone)]
pub struct Expected {
    /// What it holds.
    pub contents: FlashContents,
    /// What it is told then: where, and whether a page is erased there.
    pub next: Option<(u64, bool)>,
}

/// A cut of the power in the flash's last operation.
#[derive(Debug, Clone)]
pub struct Cut {
    /// What is left of the operation.
    pub seed: u64,
    /// One of these is expected.
    pub expected: Arc<Vec<Expected>>,
    /// Operations of the flash after the start, at most, and how long.
    pub operations: usize,
    /// How long after the start, at most.
    pub time: Duration,
    /// A byte that a defect changes after the start's first operation, or at once: to see it noticed.
    pub defect: Option<(u64, bool)>,
}

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AfterCut {
    /// The flash was that of this number, bit by bit, and was told the same next.
    Equal(usize),
    /// A watched instruction was reached, after so many operations of the flash, which was that of
    /// this number.
    Reached(usize, Option<usize>),
    /// None of it after all the operations, or all the time.
    Neither,
}

impl FlashContents {
    /// What a machine's flash holds in these places.
    pub fn of(machine: &mut Machine, places: &[Range<u64>]) -> Self {
        let read = |place: &Range<u64>| {
            let length = usize::try_from(place.end - place.start).expect("it fits");
            (place.start, machine.read_memory(place.start, length))
        };
        Self { places: places.iter().map(read).collect() }
    }

    /// The bytes from an address on, in one of the places.
    fn at(&mut self, address: u64, length: usize) -> Option<&mut [u8]> {
        self.places.iter_mut().find_map(|(start, bytes)| {
            let offset = usize::try_from(address.checked_sub(*start)?).ok()?;
            bytes.get_mut(offset..offset + length)
        })
    }

    /// What an operation makes of it. Programming clears bits (RM0433, RM0440: embedded flash
    /// memory).
    /// Panics if it is elsewhere.
    pub fn apply(&mut self, operation: &FlashOperation, flash: Flash) {
        let length = operation.word.as_ref().map_or(flash.page, Vec::len);
        let bytes = self.at(operation.address, length);
        let bytes = bytes.unwrap_or_else(|| panic!("{operation:?} is elsewhere"));
        match &operation.word {
            Some(word) => bytes.iter_mut().zip(word).for_each(|(byte, new)| *byte &= new),
            None => bytes.fill(0xFF),
        }
    }

    fn is_in(&self, host: &mut dyn Host) -> bool {
        self.places.iter().all(|(start, bytes)| {
            let (pieces, rest) = bytes.as_chunks::<PIECE>();
            assert!(rest.is_empty(), "whole words");
            (*start..).step_by(PIECE).zip(pieces).all(|(address, piece)| {
                host.read(address, Width::W64).is_ok_and(|read| read == u64::from_le_bytes(*piece))
            })
        })
    }
}

/// The cut as a branch plays it.
struct Playing {
    cut: Cut,
    flash: Flash,
    operation: FlashOperation,
    /// When the supply goes and comes back, until it has; and when the patience ends.
    cuts: Option<VirtualNanos>,
    comes_back: Option<VirtualNanos>,
    end: VirtualNanos,
    /// Operations of the flash before the start.
    before: usize,
    /// Operations that were looked at.
    seen: usize,
}

impl Playing {
    fn which(&self, host: &mut dyn Host) -> Option<usize> {
        self.cut.expected.iter().position(|expected| expected.contents.is_in(host))
    }

    fn strike(&mut self, begun: bool, host: &mut dyn Host) {
        if let Some((address, _)) = self.cut.defect.take_if(|(_, later)| *later == begun) {
            let byte = host.read(address, Width::W8).expect("flash");
            host.program(address, Width::W8, byte ^ 1).expect("flash");
        }
    }
}

impl Play for Playing {
    fn next_stop(&self) -> VirtualNanos {
        self.cuts.or(self.comes_back).unwrap_or(self.end)
    }

    fn stands(
        &mut self,
        session: &mut Session<Socket>,
        host: &mut dyn Host,
        recorder: &mut Recorder,
        now: VirtualNanos,
    ) -> Option<Vec<u8>> {
        let (is_cut, is_back) = match (self.cuts.take(), self.comes_back) {
            (Some(_), _) => (true, false),
            (None, Some(at)) => (false, now >= at),
            (None, None) => return Some(AfterCut::Neither.to_bytes()),
        };
        if is_back {
            self.comes_back = None;
            self.operation.tear(self.flash.page, self.flash.word, self.cut.seed, host);
            self.strike(false, host);
            recorder.power_up(host);
            recorder.take_hits();
            self.before = recorder.flash().operations.len();
        }
        if is_cut || is_back {
            let mut part = session.board_mut().lend();
            part.supply(now, is_back);
            session.board_mut().take_back(part);
        }
        None
    }

    fn noted(&mut self, host: &mut dyn Host, recorder: &Recorder) -> Option<Vec<u8>> {
        if self.comes_back.is_some() {
            return None;
        }
        let operations = &recorder.flash().operations;
        let done = operations.len() - self.before;
        if recorder.has_hits() {
            return Some(AfterCut::Reached(done, self.which(host)).to_bytes());
        }
        if done == self.seen {
            return None;
        }
        self.seen = done;
        if done > 1 {
            self.strike(true, host);
        }
        let next = operations.last().map(|last| (last.address, last.word.is_none()));
        let expected = Arc::clone(&self.cut.expected);
        let equal = expected
            .iter()
            .position(|expected| expected.next == next && expected.contents.is_in(host));
        match equal {
            Some(which) => Some(AfterCut::Equal(which).to_bytes()),
            None if done > self.cut.operations => Some(AfterCut::Neither.to_bytes()),
            None => None,
        }
    }
}

impl AfterCut {
    fn to_bytes(self) -> Vec<u8> {
        match self {
            Self::Equal(which) => format!("e {which}"),
            Self::Reached(done, None) => format!("r {done}"),
            Self::Reached(done, Some(which)) => format!("r {done} {which}"),
            Self::Neither => String::new(),
        }
        .into_bytes()
    }

    fn from_bytes(bytes: &[u8]) -> Self {
        let text = std::str::from_utf8(bytes).expect("as it was written");
        let number = |word: &str| word.parse().expect("a number");
        match text.split_whitespace().collect::<Vec<_>>()[..] {
            ["e", which] => Self::Equal(number(which)),
            ["r", done] => Self::Reached(number(done), None),
            ["r", done, which] => Self::Reached(number(done), Some(number(which))),
            _ => Self::Neither,
        }
    }
}

impl Machine {
    /// Cuts the power in an operation of the flash that is under way, the last of so many, in a
    /// branch of this run: what the flash is when the board has started again. The board itself goes
    /// on as if nothing had happened.
    pub fn branch_with_cut(&mut self, operation: &FlashOperation, cut: Cut) -> AfterCut {
        let comes_back = VirtualNanos(self.reached.0 + nanos(OFF));
        let playing = Playing {
            end: VirtualNanos(comes_back.0 + nanos(cut.time)),
            flash: self.board().flash,
            operation: operation.clone(),
            cuts: Some(self.reached),
            comes_back: Some(comes_back),
            before: 0,
            seen: 0,
            cut,
        };
        AfterCut::from_bytes(&self.play(Box::new(playing)))
    }
}
