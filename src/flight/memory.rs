//! A region of RAM for the flight recorder: two halves, each a copy of the core and the calls since.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::ops::Range;
use core::ptr::{copy_nonoverlapping, from_ref};

use flight_recorder::Shelf;
use gateway::Gateway;
use host_protocol::BootReason;

use crate::board::FLIGHT_BYTES;
use crate::retained;

/// Bytes of calls in each half.
const CALLS: usize = FLIGHT_BYTES / 2 - size_of::<Gateway>();

const _: () = assert!(align_of::<Gateway>() >= align_of::<u32>(), "it is copied in words");

/// A copy, and the calls behind it.
#[repr(C, align(8))]
struct Half {
    copy: MaybeUninit<Gateway>,
    calls: [u8; CALLS],
}

const _: () = assert!(size_of::<[Half; 2]>() == FLIGHT_BYTES, "the region holds two");

struct Place(UnsafeCell<MaybeUninit<[Half; 2]>>);

// Safety: `take` hands it out, once.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".flight")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// The memory of the recorder.
pub struct Memory(&'static mut [Half; 2]);

/// The memory, for the one recorder; once. Where its words may never have been written they are
/// now: a byte in such a word would be read with a wrong code (RM0433, RAMECC).
pub fn take(boot: BootReason) -> Memory {
    let place = PLACE.0.get();
    if !retained::is_kept(boot) {
        // Safety: nobody refers to it yet.
        unsafe { place.write_bytes(0, 1) };
    }
    // Safety: this is called once, at the start, so nobody else refers to it; bytes of calls may be
    // any that were written, and of copies nothing is read before it is written.
    Memory(unsafe { (*place).assume_init_mut() })
}

impl Memory {
    fn half(&mut self, half: usize) -> &mut Half {
        &mut self.0[half & 1]
    }
}

impl Shelf for Memory {
    fn calls(&mut self, half: usize) -> &mut [u8] {
        &mut self.half(half).calls
    }

    fn read_calls(&self, half: usize) -> &[u8] {
        &self.0[half & 1].calls
    }

    fn copy(&mut self, half: usize, core: &Gateway, bytes: Range<usize>) {
        const WORD: usize = size_of::<u32>();
        let from = from_ref(core).cast::<u32>();
        let to = self.half(half).copy.as_mut_ptr().cast::<u32>();
        let first = bytes.start / WORD;
        defmt::debug_assert!(bytes.end <= size_of::<Gateway>());
        // Safety: the bytes are whole words of the core, which is aligned to words as the copy is,
        // and both are as long. What is copied is not looked at.
        unsafe { copy_nonoverlapping(from.add(first), to.add(first), bytes.len() / WORD) };
    }

    fn complete(&mut self, half: usize, core: &Gateway) {
        for bytes in core.rest_to_copy() {
            self.copy(half, core, bytes);
        }
    }

    fn copied(&self, half: usize) -> Option<&Gateway> {
        // Safety: the recorder asks for a copy when each of its bytes has been copied between two
        // calls to the core, and no call since has changed what it had copied before. A core owns
        // nothing outside of itself, and nothing happens at its end: its bytes are another core.
        Some(unsafe { self.0[half & 1].copy.assume_init_ref() })
    }
}
