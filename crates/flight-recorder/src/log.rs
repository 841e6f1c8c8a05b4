//! Calls in the memory of a half. Not of the generic code around it: it is compiled for speed.

use crate::call::{Call, encode_head};
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
        Self { last, asked: Asked { changes: false, deadline: false, links: Set::NONE } }
    }

    pub fn forget_asked(&mut self) {
        self.asked = Asked::default();
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
        self.write(half, calls, now, |since_us, out| call.encode(since_us, out))
    }

    /// The same of a call that is nothing but its first byte.
    #[inline(always)]
    pub fn add_short(
        &mut self,
        half: &mut Kept,
        calls: &mut [u8],
        now: Instant,
        first: u8,
    ) -> Room {
        self.write(half, calls, now, |since_us, out| {
            encode_head(first, since_us, out).map(|(length, _)| length)
        })
    }

    #[inline(always)]
    fn write(
        &mut self,
        half: &mut Kept,
        calls: &mut [u8],
        now: Instant,
        encode: impl FnOnce(u64, &mut [u8]) -> Option<usize>,
    ) -> Room {
        let now = now.max(self.last);
        let since_us = now.as_micros() - self.last.as_micros();
        let room = calls.len();
        let rest = calls.get_mut(half.calls..).unwrap_or_default();
        let Some(length) = encode(since_us, rest) else { return Room::None };
        half.calls += length;
        self.last = now;
        if half.calls > room - room / 4 { Room::Little } else { Room::Enough }
    }
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
    #[inline(always)]
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
