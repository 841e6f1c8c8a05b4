//! Sets of axes, buses or links.

use crate::{MAX_AXES, MAX_BUSES, MAX_LINKS};
use serde::{Deserialize, Serialize};

/// A set of axes, buses, links or places by their index, each below 32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Set(u32);

const _: () = assert!(MAX_AXES <= 32 && MAX_BUSES <= 32 && MAX_LINKS <= 32, "one bit for each");

impl Set {
    /// Of none.
    pub const NONE: Self = Self(0);

    /// Of all that there can be.
    pub const ALL: Self = Self(u32::MAX);

    /// The one; none beyond the set.
    #[must_use]
    pub fn of(index: impl Into<usize>) -> Self {
        match index.into() {
            index @ 0..=31 => Self(1 << index),
            _ => Self::NONE,
        }
    }

    pub(crate) const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Bit 0 is the first.
    #[must_use]
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Whether it has none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// How many it has.
    #[must_use]
    pub const fn len(self) -> u32 {
        self.0.count_ones()
    }

    /// Whether it has this one.
    #[must_use]
    pub fn has(self, index: impl Into<usize>) -> bool {
        !self.and(Self::of(index)).is_empty()
    }

    /// Those that both have.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Those that one of them has.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Those that the other has not.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Puts others in.
    pub(crate) fn add(&mut self, others: Self) {
        *self = self.with(others);
    }

    /// Empties it. Returns what it had.
    pub(crate) fn take(&mut self) -> Self {
        core::mem::take(self)
    }

    /// Puts others in or out.
    pub(crate) fn put(&mut self, others: Self, is_in: bool) {
        *self = if is_in { self.with(others) } else { self.without(others) };
    }

    /// Puts in those that are out, and those out that are in.
    pub(crate) fn toggle(&mut self, others: Self) {
        self.0 ^= others.0;
    }

    /// Of its members the one with the lowest number.
    #[must_use]
    pub(crate) const fn lowest(self) -> Self {
        Self(self.0 & self.0.wrapping_neg())
    }

    /// Their numbers, as they stand on the wire.
    pub(crate) fn numbers(self) -> impl Iterator<Item = u8> {
        self.into_iter().filter_map(|index| u8::try_from(index).ok())
    }

    /// Those behind `last` in their order, then the others.
    pub(crate) fn behind(self, last: u8) -> impl Iterator<Item = usize> {
        // Two shifts, as one by the whole width is none.
        let behind = Self(self.0 & (u32::MAX << (u32::from(last) & (u32::BITS - 1)) << 1));
        behind.into_iter().chain(self.without(behind))
    }
}

impl IntoIterator for Set {
    type Item = usize;
    type IntoIter = Members;

    fn into_iter(self) -> Members {
        Members(self.0)
    }
}

impl<I: Into<usize>> FromIterator<I> for Set {
    fn from_iter<T: IntoIterator<Item = I>>(members: T) -> Self {
        members.into_iter().fold(Self::NONE, |set, member| set.with(Self::of(member)))
    }
}

/// Those of a set, the lowest first.
#[derive(Debug, Clone)]
pub struct Members(u32);

impl Iterator for Members {
    type Item = usize;

    fn next(&mut self) -> Option<usize> {
        let index = self.0.trailing_zeros();
        self.0 &= self.0.wrapping_sub(1);
        (index < u32::BITS).then_some(index as usize)
    }
}
