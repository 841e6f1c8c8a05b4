//! Calls in the memory of a half. Not of the generic code around it: it is compiled for speed.

use crate::call::{Call, SAME_TIME};
use gateway::{Instant, Set};

/// What a half has.
#[derive(Debug, Clone, Copy)]
pub struct Kept {
    /// `None` where it has no whole copy.
    pub number: Option<u32>,
    /// When the copy was made.
    pub since: Instant,
    /// Bytes of calls.
    pub calls: usize,
}

impl Kept {
    pub const NOTHING: Self = Self { number: None, since: Instant::from_micros(0), calls: 0 };
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
    /// What was asked since anything changed: another time it changes nothing.
    asked: Asked,
}

impl Log {
    pub const fn new() -> Self {
        Self::from(Instant::from_micros(0))
    }

    /// From a time on.
    pub const fn from(last: Instant) -> Self {
        Self { last, asked: Asked::NOTHING }
    }

    pub fn forget_asked(&mut self) {
        self.asked = Asked::NOTHING;
    }

    /// Whether a call may change something.
    #[inline(always)]
    pub fn is_news(&mut self, call: &Call<'_>) -> bool {
        self.asked.take(call)
    }

    /// Writes a call behind the others.
    #[inline(never)]
    pub fn add(
        &mut self,
        half: &mut Kept,
        calls: &mut [u8],
        now: Instant,
        call: &Call<'_>,
    ) -> Room {
        let now = now.max(self.last);
        let since_us = now.as_micros() - self.last.as_micros();
        let room = calls.len();
        let rest = calls.get_mut(half.calls..).unwrap_or_default();
        let Some(length) = call.encode(since_us, rest) else { return Room::None };
        half.calls += length;
        self.last = now;
        if half.calls > room - room / 4 { Room::Little } else { Room::Enough }
    }

    /// The same of a call that is nothing but its first byte, made at the time of the one before;
    /// whether it was, and there was room.
    #[inline(always)]
    pub fn add_byte(&self, half: &mut Kept, calls: &mut [u8], now: Instant, first: u8) -> bool {
        match calls.get_mut(half.calls) {
            Some(place) if now == self.last => {
                *place = first | SAME_TIME;
                half.calls += 1;
                true
            }
            _ => false,
        }
    }
}

/// What was asked: links by their number, and two more.
#[derive(Debug, Clone, Copy)]
struct Asked(u32);

impl Asked {
    const NOTHING: Self = Self(0);
    const CHANGES: u32 = 1 << 31;
    const DEADLINE: u32 = 1 << 30;

    /// Takes a call; whether it may change something.
    #[inline(always)]
    fn take(&mut self, call: &Call<'_>) -> bool {
        let one = match call {
            Call::TakeChanges => Self::CHANGES,
            Call::NextDeadline => Self::DEADLINE,
            Call::PollHost { link } => Set::of(*link).bits(),
            _ => {
                *self = Self::NOTHING;
                return true;
            }
        };
        if self.0 & one != 0 {
            return false;
        }
        // There may be other changes than were taken.
        self.0 = self.0 & !Self::CHANGES | one;
        true
    }
}
