//! What a file holds.

use crate::board::RecordedBoard;
use crate::call::Call;
use crate::file::{self, Head, MARK};
use core::fmt;
use gateway::Instant;
use heapless::Vec;
use host_protocol::Trip;

/// What a [`Recorder`](crate::Recorder) has kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording<'a> {
    /// The first axis that tripped, and its trip; `None` where none has.
    pub trip: Option<(u8, Trip)>,
    /// The board.
    pub board: RecordedBoard<'a>,
    /// One or two, in the order in which they were written.
    pub halves: Vec<Half<'a>, 2>,
    /// The copies of the core at the beginning of each, one behind the other.
    pub(crate) copies: &'a [u8],
}

/// No two calls are so far apart, µs: a week. What says so is damaged.
const LONGEST_PAUSE_US: u64 = 7 * 24 * 3_600 * 1_000_000;

/// Calls from a copy on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Half<'a> {
    /// When it was taken, in the gateway's own time.
    pub since: Instant,
    calls: &'a [u8],
}

/// Why a file cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unreadable {
    /// Nothing was recorded, or it is no such file.
    Nothing,
    /// It is damaged, or lacks its end.
    Damaged,
    /// What it holds is of another build's layout.
    OtherLayout,
}

impl fmt::Display for Unreadable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nothing => "this is no recording of a flight recorder",
            Self::Damaged => "the recording is damaged, or lacks its end",
            Self::OtherLayout => "it was recorded in the layout of another build",
        })
    }
}

impl core::error::Error for Unreadable {}

impl<'a> Recording<'a> {
    /// What a file of these bytes ends with.
    pub fn checksum(bytes: &[u8]) -> [u8; 4] {
        file::checksum(bytes)
    }

    /// The first axis that tripped, and its trip, whoever can read the rest.
    pub fn trip_of(file: &[u8]) -> Option<(u8, Trip)> {
        postcard::take_from_bytes(file.strip_prefix(&MARK)?).ok().and_then(|(trip, _)| trip)
    }

    /// What a file holds.
    ///
    /// # Errors
    /// See [`Unreadable`].
    pub fn read_file(file: &'a [u8]) -> Result<Self, Unreadable> {
        if !file.starts_with(&MARK) {
            return Err(Unreadable::Nothing);
        }
        match file.split_last_chunk() {
            Some((bytes, checksum)) if file::checksum(bytes) == *checksum => Self::read(bytes),
            _ => Err(Unreadable::Damaged),
        }
    }

    /// What these bytes hold: the parts that a recorder gives, one behind the other.
    ///
    /// # Errors
    /// See [`Unreadable`].
    pub fn read(bytes: &'a [u8]) -> Result<Self, Unreadable> {
        let rest = bytes.strip_prefix(&MARK).ok_or(Unreadable::Nothing)?;
        let (head, mut rest) =
            postcard::take_from_bytes::<Head<'a>>(rest).map_err(|_| Unreadable::OtherLayout)?;
        let mut halves = Vec::new();
        for half in &head.halves {
            let length = usize::try_from(half.calls).map_err(|_| Unreadable::Damaged)?;
            let (calls, behind) = rest.split_at_checked(length).ok_or(Unreadable::Damaged)?;
            rest = behind;
            let _ = halves.push(Half { since: half.since, calls });
        }
        if halves.is_empty() {
            return Err(Unreadable::Nothing);
        }
        Ok(Self { trip: head.trip, board: head.board, halves, copies: rest })
    }
}

impl<'a> Half<'a> {
    /// The calls, as they were kept.
    pub fn bytes(&self) -> &'a [u8] {
        self.calls
    }

    /// The calls and their times.
    pub fn calls(&self) -> Calls<'a> {
        Calls { rest: self.calls, now: self.since }
    }
}

/// Calls and their times. It ends at one that cannot be read, as where a reset has cut it off.
#[derive(Debug, Clone)]
pub struct Calls<'a> {
    rest: &'a [u8],
    now: Instant,
}

impl<'a> Iterator for Calls<'a> {
    type Item = (Instant, Call<'a>);

    fn next(&mut self) -> Option<Self::Item> {
        let (since, call, rest) = Call::decode(self.rest)?;
        if since > LONGEST_PAUSE_US {
            return None;
        }
        self.rest = rest;
        self.now = Instant::from_micros(self.now.as_micros().saturating_add(since));
        Some((self.now, call))
    }
}
