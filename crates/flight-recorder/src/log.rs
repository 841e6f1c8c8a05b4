//! Calls in the memory of a half. Not of the generic code around it: it is compiled for speed.

use crate::call::{Call, SAME_TIME};
use gateway::{Instant, Set};
use serde::{Deserialize, Serialize};

/// What a half has.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Kept {
    /// `None` where it has no whole copy.
    pub number: Option<u32>,
    /// When the copy was made.
    pub since: Instant,
    /// Bytes of it.
    pub copy: usize,
    /// Bytes of calls.
    pub calls: usize,
}

impl Kept {
    pub const NOTHING: Self =
        Self { number: None, since: Instant::from_micros(0), copy: 0, calls: 0 };
}

/// What room for calls is left in a half.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Room {
    Enough,
    /// Less than a quarter.
    Little,
    /// The call was not kept.
    None,
}

/// What calls were made before.
pub struct Log {
    /// When the last one was.
    last: Instant,
    /// Links that have been polled since anything changed, and had nothing to send: another time
    /// that changes nothing.
    idle: Set,
}

impl Log {
    pub const fn new() -> Self {
        Self::from(Instant::from_micros(0))
    }

    /// From a time on.
    pub const fn from(last: Instant) -> Self {
        Self { last, idle: Set::NONE }
    }

    /// Something has changed.
    pub fn forget_idle(&mut self) {
        self.idle = Set::NONE;
    }

    /// Whether a call may change something.
    #[inline(always)]
    pub fn is_news(&mut self, call: &Call<'_>) -> bool {
        let Call::PollHost { link } = call else {
            self.idle = Set::NONE;
            return true;
        };
        let was_idle = self.idle.has(*link);
        self.idle = self.idle.with(Set::of(*link));
        !was_idle
    }

    /// Writes a call behind the others.
    #[inline(never)]
    pub fn add(
        &mut self,
        half: &mut Kept,
        bytes: &mut [u8],
        now: Instant,
        call: &Call<'_>,
    ) -> Room {
        let now = now.max(self.last);
        let since_us = now.as_micros() - self.last.as_micros();
        let room = bytes.len() - half.copy.min(bytes.len());
        let rest = bytes.get_mut(half.copy + half.calls..).unwrap_or_default();
        let Some(length) = call.encode(since_us, rest) else { return Room::None };
        half.calls += length;
        self.last = now;
        if half.calls > room - room / 4 { Room::Little } else { Room::Enough }
    }

    /// The same of a call that is nothing but its first byte, made at the time of the one before;
    /// whether it was, and there was room.
    #[inline(always)]
    pub fn add_byte(&self, half: &mut Kept, bytes: &mut [u8], now: Instant, first: u8) -> bool {
        match bytes.get_mut(half.copy + half.calls) {
            Some(place) if now == self.last => {
                *place = first | SAME_TIME;
                half.calls += 1;
                true
            }
            _ => false,
        }
    }
}
