//! What a memory holds.

use crate::board::RecordedBoard;
use crate::call::Call;
use crate::memory;
use core::fmt;
use gateway::Instant;
use heapless::Vec;
use host_protocol::Trip;

/// What a [`Recorder`](crate::Recorder) has left in its memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording<'a> {
    /// The first axis that tripped, and its trip; `None` where none has.
    pub trip: Option<(u8, Trip)>,
    /// The board.
    pub board: RecordedBoard<'a>,
    /// One or two, in the order in which they were written.
    pub halves: Vec<Half<'a>, 2>,
}

/// No two calls are so far apart, µs: a week. What says so is damaged.
const LONGEST_PAUSE_US: u64 = 7 * 24 * 3_600 * 1_000_000;

/// Calls from a snapshot on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Half<'a> {
    /// When it was taken, in the gateway's own time.
    pub since: Instant,
    /// For [`Gateway::resume`](gateway::Gateway::resume).
    pub snapshot: &'a [u8],
    calls: &'a [u8],
}

/// Why a memory cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unreadable {
    /// Nothing was ever recorded there, or it is no such memory.
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
    /// Moves what a memory holds together, and returns how long it is then. So much of it, and
    /// [its checksum](Self::checksum) behind it, is a file.
    pub fn trim(memory: &mut [u8]) -> usize {
        memory::trim(memory)
    }

    /// What a file of these bytes of a memory ends with.
    pub fn checksum(memory: &[u8]) -> [u8; 4] {
        memory::file_checksum(memory)
    }

    /// What a file holds.
    ///
    /// # Errors
    /// See [`Unreadable`].
    pub fn read_file(file: &'a [u8]) -> Result<Self, Unreadable> {
        if !memory::is_marked(file) {
            return Err(Unreadable::Nothing);
        }
        match file.split_last_chunk() {
            Some((memory, checksum)) if memory::file_checksum(memory) == *checksum => {
                Self::read(memory)
            }
            _ => Err(Unreadable::Damaged),
        }
    }

    /// What a memory holds.
    ///
    /// # Errors
    /// See [`Unreadable`].
    pub fn read(memory: &'a [u8]) -> Result<Self, Unreadable> {
        if !memory::is_marked(memory) {
            return Err(Unreadable::Nothing);
        }
        let trip = memory::whole_trip(memory).ok_or(Unreadable::Damaged)?;
        let mut halves = [0, 1].map(|index| {
            let half = memory::half(memory, index);
            memory::head(half).map(|head| (head, memory::contents(half)))
        });
        if let [Some((first, _)), Some((second, _))] = &halves
            && second.number.wrapping_sub(first.number) > u32::MAX / 2
        {
            halves.swap(0, 1);
        }
        let mut recording: Option<Self> = None;
        let mut number = 0;
        for (head, contents) in halves.into_iter().flatten() {
            let (board, rest) = contents.split_at_checked(head.board).ok_or(Unreadable::Damaged)?;
            let (snapshot, rest) =
                rest.split_at_checked(head.snapshot).ok_or(Unreadable::Damaged)?;
            let calls = rest.get(..head.calls).ok_or(Unreadable::Damaged)?;
            let half = Half { since: head.since, snapshot, calls };
            let board = postcard::from_bytes(board).map_err(|_| Unreadable::OtherLayout)?;
            match &mut recording {
                Some(before) if head.number.wrapping_sub(number) == 1 => {
                    let _ = before.halves.push(half);
                }
                _ => {
                    let halves = Vec::from_iter([half]);
                    recording = Some(Self { trip, board, halves });
                }
            }
            number = head.number;
        }
        recording.ok_or(Unreadable::Damaged)
    }
}

impl<'a> Half<'a> {
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
        let ((since, call), rest) = postcard::take_from_bytes::<(u64, Call<'a>)>(self.rest).ok()?;
        if since > LONGEST_PAUSE_US {
            return None;
        }
        self.rest = rest;
        self.now = Instant::from_micros(self.now.as_micros().saturating_add(since));
        Some((self.now, call))
    }
}
