//! How far a host has been told of the events, and what only its own link has to tell.

use core::mem::take;

use super::ring::{Cursor, Ring};
use host_protocol::{EncodeError, Event, FrameError, MAX_FRAME};
use serde::{Deserialize, Serialize};

/// Reasons of [`FrameError`], numbered from 1 without gaps.
const REASONS: usize = FrameError::ALL.len();

/// How often something happened that is reported as one event.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Tally {
    count: u32,
    /// The last time.
    time_us: u64,
}

impl Tally {
    const NONE: Self = Self { count: 0, time_us: 0 };

    fn add(&mut self, now_us: u64) {
        self.count = self.count.saturating_add(1);
        self.time_us = now_us;
    }
}

/// The place in the ring, and the faults of the link itself, which are counted instead of queued so
/// that noise on the line cannot push out what happened to an axis.
#[derive(Clone, Serialize, Deserialize)]
pub struct Events {
    next: Cursor,
    /// Events lost since the last one sent.
    dropped: u32,
    rejected_frames: [Tally; REASONS],
    dropped_requests: Tally,
    sequence: u16,
    /// Whether the host has said hello and can read what we send.
    open: bool,
}

impl Events {
    pub const fn new() -> Self {
        Self {
            next: Cursor { entry: 0, event: 0 },
            dropped: 0,
            rejected_frames: [Tally::NONE; REASONS],
            dropped_requests: Tally::NONE,
            sequence: 0,
            open: false,
        }
    }

    /// A host has said hello: what happens from now on is for it. A host of another version gets no
    /// events.
    pub fn start_session(&mut self, open: bool, next: Cursor) {
        *self = Self { open, next, ..Self::new() };
    }

    /// Bytes between two delimiters were no frame.
    pub fn frame_rejected(&mut self, now_us: u64, error: &FrameError) {
        let index = usize::from(error.number()).checked_sub(1);
        if let Some(tally) = index.and_then(|index| self.rejected_frames.get_mut(index)) {
            tally.add(now_us);
        }
    }

    /// A request had no slot.
    pub fn request_dropped(&mut self, now_us: u64) {
        self.dropped_requests.add(now_us);
    }

    /// Whether the host has said hello.
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// Events that were never queued have been lost.
    pub fn count_dropped(&mut self, count: u32) {
        self.dropped = self.dropped.saturating_add(count);
    }

    pub fn poll_transmit(&mut self, ring: &Ring, out: &mut [u8; MAX_FRAME]) -> Option<usize> {
        if !self.open {
            return None;
        }
        if let Some((time_us, event, lost)) = ring.next_event(&mut self.next) {
            self.count_dropped(lost);
            return self.write(|sequence, lost| event.encode_frame(sequence, lost, time_us, out));
        }
        let (time_us, event) = self.next_tally()?;
        self.write(|sequence, lost| event.encode_frame(sequence, lost, time_us, out))
    }

    /// Has the next event written, one of the ring or any other, with its sequence and how many
    /// were lost before it.
    pub fn write(
        &mut self,
        encode: impl FnOnce(u16, u32) -> Result<usize, EncodeError>,
    ) -> Option<usize> {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        encode(sequence, take(&mut self.dropped)).ok()
    }

    pub fn has_output(&self, ring: &Ring) -> bool {
        let tallies = self.rejected_frames.iter().chain([&self.dropped_requests]);
        self.open && (ring.has_event(self.next) || tallies.into_iter().any(|tally| tally.count > 0))
    }

    fn next_tally(&mut self) -> Option<(u64, Event)> {
        for (reason, tally) in (1..).zip(&mut self.rejected_frames) {
            if tally.count > 0 {
                let Tally { count, time_us } = take(tally);
                return Some((time_us, Event::FrameRejected { reason, count }));
            }
        }
        let Tally { count, time_us } = take(&mut self.dropped_requests);
        (count > 0).then_some((time_us, Event::RequestDropped { count }))
    }
}
