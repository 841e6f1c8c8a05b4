//! The memory of a recorder.

use crate::copy::{self, Places};
use gateway::{Gateway, Part};

/// Room for two halves: of each a copy of a core, and the calls behind it.
pub trait Shelf {
    /// A copy takes so little time that an axis or a link is copied in one turn.
    const IS_FAST: bool = false;

    /// The bytes of a half, 0 or 1; of both as many.
    fn half(&self, half: usize) -> &[u8];

    /// The same, to be written.
    fn half_mut(&mut self, half: usize) -> &mut [u8];

    /// Copies a part of the core to the begin of a half, where the copy has `length` bytes so far.
    /// Returns how many it has then; `None` where there is too little room. Who has much can do it
    /// faster than by [encoding](Self::encode).
    fn copy(
        &mut self,
        half: usize,
        length: usize,
        places: &mut Places,
        core: &Gateway,
        index: usize,
    ) -> Option<usize> {
        self.encode(half, length, places, core, index)
    }

    /// Writes the encoding of a part of that copy from `offset` on, as far as there is room; how
    /// many bytes it has in all.
    fn read(
        &self,
        half: usize,
        length: usize,
        index: usize,
        offset: usize,
        out: &mut [u8],
    ) -> usize {
        self.decode(half, length, index, offset, out)
    }

    /// As [`copy`](Self::copy): the encoding without its zeros.
    fn encode(
        &mut self,
        half: usize,
        length: usize,
        places: &mut Places,
        core: &Gateway,
        index: usize,
    ) -> Option<usize> {
        copy::put(self.half_mut(half), length, places, index, &Part::of(core, index)?)
    }

    /// As [`read`](Self::read), of that.
    fn decode(
        &self,
        half: usize,
        length: usize,
        index: usize,
        offset: usize,
        out: &mut [u8],
    ) -> usize {
        copy::read(self.half(half).get(..length).unwrap_or_default(), index, offset, out)
    }

    /// Keeps these few bytes in the place of those before, where the memory outlives a reset.
    fn remember(&mut self, _: &[u8]) {}

    /// Those bytes, after a reset that the whole memory has outlived. `None` where it has not, or
    /// another build may have written it.
    fn remembered(&self) -> Option<&[u8]> {
        None
    }
}
