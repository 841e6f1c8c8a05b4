//! The memory of a recorder.

use gateway::Gateway;

/// Room for two halves: of each a copy of a core, and the calls behind it.
pub trait Shelf {
    /// What a copy takes of a half where it is the core as it lies in memory, which is made ten times
    /// as fast. `None` where there is too little room for that: it is encoded then.
    const CORE: Option<usize> = None;

    /// The bytes of a half, 0 or 1; of both as many.
    fn half(&self, half: usize) -> &[u8];

    /// The same, to be written.
    fn half_mut(&mut self, half: usize) -> &mut [u8];

    /// Copies the [bytes of a part](Gateway::bytes_of) to the begin of a half, where
    /// [`CORE`](Self::CORE) says so.
    fn copy(&mut self, _half: usize, _core: &Gateway, _part: usize) {}

    /// The core whose parts were all copied there, each as it was after the same call; `None` where
    /// it is encoded.
    fn core(&self, _half: usize) -> Option<&Gateway> {
        None
    }

    /// Keeps these few bytes in the place of those before, where the memory outlives a reset.
    fn remember(&mut self, _: &[u8]) {}

    /// Those bytes, after a reset that the whole memory has outlived. `None` where it has not, or
    /// another build may have written it.
    fn remembered(&self) -> Option<&[u8]> {
        None
    }
}
