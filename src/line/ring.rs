//! The ring that DMA fills with what a line receives, round and round.
//!
//! The driver's ring reads byte by byte and divides for each: 15 instructions a byte between the
//! last byte of a request and its frame. Here the driver's channel fills the same memory, and what
//! has come is copied in one or two pieces.

use core::ptr::{self, NonNull};
use core::sync::atomic::{AtomicU32, Ordering, fence};

use embassy_stm32::dma::{Transfer, TransferOptions};

use crate::dma_memory::Buffer;

/// How often a stream that is to be stopped is looked at: it stops when the byte on its way has
/// arrived.
const STREAM_POLLS: usize = 1000;

/// More bytes came than the ring holds before they were read. The next read goes on with what comes
/// from now on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub struct Overflow;

/// Has the DMA stream of a line fill this memory. What it did before is over.
pub type Fill = unsafe fn(*mut [u8], TransferOptions) -> Transfer<'static>;

/// Bytes that have come and have not been read. Bytes are counted from the start of the stream,
/// modulo 2³², which is a whole number of rounds.
pub struct Ring {
    transfer: Transfer<'static>,
    fill: Fill,
    /// How many bytes of its round DMA has still to fill.
    remaining: fn() -> u16,
    memory: NonNull<[u8]>,
    /// Rounds that DMA has completed, as its interrupt counts them.
    rounds: &'static AtomicU32,
    /// Bytes that have been read or lost.
    taken: u32,
}

impl Ring {
    /// Starts to fill `memory`, a power of two of bytes; `remaining`: of the round of the stream;
    /// `rounds`: counted by its interrupt.
    ///
    /// # Safety
    ///
    /// One ring at a time of what is filled by `fill`.
    pub unsafe fn start(
        memory: Buffer,
        fill: Fill,
        remaining: fn() -> u16,
        rounds: &'static AtomicU32,
    ) -> Self {
        let memory = memory.into_bytes();
        defmt::assert!(memory.len().is_power_of_two(), "a round that does not divide 2³²");
        let memory = NonNull::from(memory);
        // Safety: the caller's; nobody else has the memory.
        let transfer = unsafe { fill(memory.as_ptr(), options()) };
        Self { transfer, fill, remaining, memory, rounds, taken: 0 }
    }

    /// Sets the DMA stream up anew, as it may lock (ES0392, "DMA stream locked when transferring
    /// data to/from USART/UART"). What has come is lost.
    pub fn restart(&mut self) {
        self.transfer.request_pause();
        for _ in 0..STREAM_POLLS {
            if !self.transfer.is_running() {
                break;
            }
        }
        self.rounds.store(0, Ordering::Relaxed);
        self.taken = 0;
        // Safety: the stream has been stopped, and the transfer before is forgotten: its end would
        // wait for a stream that hangs.
        let transfer = unsafe { (self.fill)(self.memory.as_ptr(), options()) };
        core::mem::forget(core::mem::replace(&mut self.transfer, transfer));
    }

    #[expect(clippy::cast_possible_truncation, reason = "DMA counts to 65,535")]
    fn round(&self) -> u32 {
        self.memory.len() as u32
    }

    /// How many bytes have come and not been read; more than a round where some are lost.
    fn length(&self) -> u32 {
        // In this order: a round that is completed between the two is not counted yet, and looks as
        // if less had come than was taken.
        let rounds = self.rounds.load(Ordering::Acquire);
        let in_round = self.round().wrapping_sub(u32::from((self.remaining)()));
        let come = rounds.wrapping_mul(self.round()).wrapping_add(in_round);
        let length = come.wrapping_sub(self.taken);
        if length > u32::MAX / 2 { 0 } else { length }
    }

    /// How many bytes of its round DMA has still to fill.
    pub fn remaining(&self) -> u16 {
        (self.remaining)()
    }

    /// Whether nothing has come.
    pub fn is_empty(&self) -> bool {
        self.length() == 0
    }

    /// Takes what has come, as much as fits; nothing if nothing has.
    pub fn take(&mut self, out: &mut [u8]) -> Result<usize, Overflow> {
        let come = self.length();
        let length = out.len().min(come as usize);
        if come <= self.round() {
            self.copy(out.get_mut(..length).unwrap_or_default());
        }
        // While they were copied others may have taken their place.
        let come = self.length();
        if come > self.round() {
            self.taken = self.taken.wrapping_add(come);
            return Err(Overflow);
        }
        #[expect(clippy::cast_possible_truncation, reason = "no longer than a round")]
        let taken = length as u32;
        self.taken = self.taken.wrapping_add(taken);
        Ok(length)
    }

    /// Copies the next bytes; no more than a round.
    fn copy(&self, out: &mut [u8]) {
        let bytes = self.memory.as_ptr().cast::<u8>();
        let at = self.taken as usize % self.memory.len();
        let before_end = out.len().min(self.memory.len() - at);
        let (first, behind_end) = out.split_at_mut(before_end);
        // What DMA has written before it counted is read after it.
        fence(Ordering::Acquire);
        // Safety: both lie in the memory of the ring, of which there is no reference; `out` is
        // somewhere else.
        unsafe {
            ptr::copy_nonoverlapping(bytes.add(at), first.as_mut_ptr(), first.len());
            ptr::copy_nonoverlapping(bytes, behind_end.as_mut_ptr(), behind_end.len());
        }
        fence(Ordering::Acquire);
    }
}

/// Round and round; at each half of one it raises its interrupt.
fn options() -> TransferOptions {
    let mut options = TransferOptions::default();
    options.circular = true;
    options.half_transfer_ir = true;
    options.complete_transfer_ir = true;
    options
}
