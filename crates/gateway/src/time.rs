//! Gateway time: microseconds since start, given to the core with every call.

use core::num::NonZeroU64;
use core::ops::{Add, Sub};
use serde::{Deserialize, Serialize};

/// A point in gateway time, in microseconds since the gateway started.
///
/// It holds one more than these, so that an `Option<Instant>` is no larger: there are many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Instant(NonZeroU64);

/// A span of gateway time, in microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Duration(u64);

impl Instant {
    /// Later than all that happens.
    pub(crate) const NEVER: Self = Self(NonZeroU64::MAX);

    /// The instant `us` microseconds after start.
    pub const fn from_micros(us: u64) -> Self {
        Self(NonZeroU64::MIN.saturating_add(us))
    }

    /// Microseconds since start.
    pub const fn as_micros(self) -> u64 {
        self.0.get() - 1
    }

    /// The low 32 bits of the time, as expiries carry it on the wire. Wraps every 71.6 minutes.
    #[allow(clippy::cast_possible_truncation)]
    pub const fn low_bits(self) -> u32 {
        self.as_micros() as u32
    }

    /// Time since `earlier`; zero if `earlier` is later.
    pub const fn since(self, earlier: Self) -> Duration {
        Duration(self.0.get().saturating_sub(earlier.0.get()))
    }
}

impl Default for Instant {
    fn default() -> Self {
        Self::from_micros(0)
    }
}

impl Duration {
    /// No time at all.
    pub const ZERO: Self = Self(0);

    /// A span of `us` microseconds.
    pub const fn from_micros(us: u64) -> Self {
        Self(us)
    }

    /// A span of `ms` milliseconds.
    pub const fn from_millis(ms: u64) -> Self {
        Self(ms.saturating_mul(1_000))
    }

    /// The span in microseconds.
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// The span in microseconds, at most `u32::MAX` (71.6 minutes).
    #[allow(clippy::cast_possible_truncation)]
    pub const fn as_micros_u32(self) -> u32 {
        if self.0 > u32::MAX as u64 { u32::MAX } else { self.0 as u32 }
    }

    /// The `n`-th part of the span, rounded down.
    #[allow(clippy::cast_possible_truncation)]
    pub const fn part(self, n: NonZeroU64) -> Self {
        // The processor divides 32 bits by itself.
        if self.0 <= u32::MAX as u64 && n.get() <= u32::MAX as u64 {
            Self((self.0 as u32 / n.get() as u32) as u64)
        } else {
            Self(self.0 / n.get())
        }
    }

    /// One and a half times the span.
    pub const fn and_a_half(self) -> Self {
        Self(self.0.saturating_add(self.0 / 2))
    }

    /// The span `n` times over.
    pub const fn times(self, n: u64) -> Self {
        Self(self.0.saturating_mul(n))
    }
}

/// The earliest of several times that come after one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Earliest {
    after: Instant,
    at: Instant,
    first: Instant,
}

impl Earliest {
    /// Of none yet.
    pub const fn after(after: Instant) -> Self {
        Self { after, at: Instant::NEVER, first: Instant::NEVER }
    }

    /// Another one, if it is one.
    pub fn consider(&mut self, at: Option<Instant>) {
        let Some(at) = at else { return };
        self.first = self.first.min(at);
        if at > self.after && at < self.at {
            self.at = at;
        }
    }

    /// The earliest; [`Instant::NEVER`] where there is none.
    pub fn at(&self) -> Instant {
        self.at
    }

    /// The earliest of all, those that do not come after it among them.
    pub fn first(&self) -> Instant {
        self.first
    }
}

impl Add<Duration> for Instant {
    type Output = Self;
    fn add(self, span: Duration) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl Sub<Duration> for Instant {
    type Output = Self;
    fn sub(self, span: Duration) -> Self {
        Self::from_micros(self.as_micros().saturating_sub(span.0))
    }
}

impl Add for Duration {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Duration {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}
