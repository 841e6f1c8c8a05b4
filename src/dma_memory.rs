//! Memory that DMA reads and writes, in a section of its own, `.dma`: the processor's own data may
//! lie where DMA does not reach.
//!
//! [`buffer`] is the only way to such memory, and the lines take no other: nothing that a task owns
//! is handed to DMA. `.ci/size` finds the buffers by the name that it gives them.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// Room for a buffer. Start-up code leaves its section alone.
#[repr(C, align(8))]
pub struct Room<const BYTES: usize>(UnsafeCell<MaybeUninit<[u8; BYTES]>>);

// Safety: only `Room::take` reaches the bytes, and it hands them out once.
unsafe impl<const BYTES: usize> Sync for Room<BYTES> {}

impl<const BYTES: usize> Room<BYTES> {
    /// Not yet initialised.
    pub const fn new() -> Self {
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }

    /// Fills it with zeros and hands it out. The zeros matter: RAM with an error-correcting code
    /// reports an error where DMA writes a byte into a word that has never been written whole
    /// (RM0433, RAMECC).
    ///
    /// # Panics
    ///
    /// If `is_taken` was set.
    pub fn take(&'static self, is_taken: &AtomicBool) -> Buffer {
        defmt::assert!(!is_taken.swap(true, Ordering::Relaxed), "a DMA buffer is taken twice");
        // Safety: nobody else has a reference to it.
        let room = unsafe { &mut *self.0.get() };
        Buffer(room.write([0; BYTES]))
    }
}

/// Memory that DMA reaches.
pub struct Buffer(&'static mut [u8]);

impl Buffer {
    /// Its bytes.
    pub fn into_bytes(self) -> &'static mut [u8] {
        self.0
    }

    /// Its bytes, as long as it stays here.
    pub fn bytes(&mut self) -> &mut [u8] {
        self.0
    }
}

/// A [`Buffer`] of so many bytes, one for each place in the source, to be taken once.
macro_rules! buffer {
    ($bytes:expr) => {{
        #[unsafe(link_section = ".dma")]
        static DMA_BUFFER: $crate::dma_memory::Room<{ $bytes }> = $crate::dma_memory::Room::new();
        static IS_TAKEN: core::sync::atomic::AtomicBool =
            core::sync::atomic::AtomicBool::new(false);
        DMA_BUFFER.take(&IS_TAKEN)
    }};
}
pub(crate) use buffer;
