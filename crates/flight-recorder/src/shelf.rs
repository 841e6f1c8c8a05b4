//! The memory of a recorder.

use core::ops::Range;
use gateway::Gateway;

/// Room for two halves: of each a copy of a core, and calls.
pub trait Shelf {
    /// Whether there is room at all. Where there is none nothing is recorded.
    const KEEPS: bool = true;

    /// The room for calls of a half, 0 or 1.
    fn calls(&mut self, half: usize) -> &mut [u8];

    /// The same, to be read.
    fn read_calls(&self, half: usize) -> &[u8];

    /// Copies these bytes of the core, counted from its first.
    fn copy(&mut self, half: usize, core: &Gateway, bytes: Range<usize>);

    /// Copies what is [left](Gateway::rest_to_copy): the copy is complete.
    fn complete(&mut self, half: usize, core: &Gateway);

    /// The copy. It is asked for when it is complete, and not once another has begun.
    fn copied(&self, half: usize) -> Option<&Gateway>;

    /// Keeps these few bytes in the place of those before, where the memory outlives a reset.
    fn remember(&mut self, _: &[u8]) {}

    /// Those bytes, after a reset that the whole memory has outlived. `None` where it has not, or
    /// another build may have written it.
    fn remembered(&self) -> Option<&[u8]> {
        None
    }
}

/// No room.
#[derive(Debug, Default)]
pub struct NoShelf;

impl Shelf for NoShelf {
    const KEEPS: bool = false;

    fn calls(&mut self, _: usize) -> &mut [u8] {
        &mut []
    }

    fn read_calls(&self, _: usize) -> &[u8] {
        &[]
    }

    fn copy(&mut self, _: usize, _: &Gateway, _: Range<usize>) {}

    fn complete(&mut self, _: usize, _: &Gateway) {}

    fn copied(&self, _: usize) -> Option<&Gateway> {
        None
    }
}
