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
    fn copied(&self, half: usize) -> &Gateway;
}

/// No room.
#[derive(Debug, Default)]
pub enum NoShelf {
    /// As there is nothing.
    #[default]
    None,
}
