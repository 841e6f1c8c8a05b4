//! A region of RAM for the flight recorder: two halves, each a copy of the core and the calls since.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::ops::Range;
use core::ptr::{copy_nonoverlapping, from_ref};
use core::sync::atomic::{Ordering, compiler_fence};

use flight_recorder::Shelf;
use gateway::Gateway;
use host_protocol::{BootReason, CHECKSUM};

use crate::board::{BUILD_ID, FLIGHT_BYTES};
use crate::{image, retained, watchdog};

/// Bytes of each half.
const HALF: usize = (FLIGHT_BYTES - size_of::<Remembered>()) / 2;
/// Where there is room for it, a copy is the core as it lies in memory: while eight axes are served
/// a thousand times a second there is no time to encode it.
const IS_LARGE: bool = HALF >= 2 * size_of::<Gateway>();
/// What a copy takes then.
const CORE: usize = size_of::<Gateway>().next_multiple_of(size_of::<u32>());
/// Bytes that are filled between two feeds of the watchdog: all of them take a slow processor a good
/// part of its time.
const FILLED_AT_ONCE: usize = 16 * 1024;
/// What is remembered takes no more bytes.
const REMEMBERED_BYTES: usize = 240;
/// The memory has something to remember.
const MARK: u32 = 0x4D47_4652;

/// Where what was kept is found after a reset. The mark is written last, and makes the words before
/// it whole (ST AN5342, ECC on RAM).
#[repr(C, align(8))]
struct Remembered {
    length: usize,
    checksum: u32,
    bytes: [u8; REMEMBERED_BYTES],
    mark: [u32; 2],
}

#[repr(C, align(8))]
struct Half([u8; HALF]);

#[repr(C)]
struct Region {
    halves: [Half; 2],
    remembered: Remembered,
}

const _: () = assert!(size_of::<Region>() == FLIGHT_BYTES, "it fills the region");
const _: () = assert!(align_of::<Gateway>() >= align_of::<u32>(), "it is copied in words");
const _: () =
    assert!(align_of::<Gateway>() <= align_of::<Half>(), "it is read where it was copied");

struct Place(UnsafeCell<MaybeUninit<Region>>);

// Safety: `take` hands it out, once.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".flight")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// The memory of the recorder.
pub struct Memory {
    region: &'static mut Region,
    /// It has outlived what started the processor.
    is_kept: bool,
}

/// Fills the memory where its words may never have been written: such a word is read with a wrong
/// code (RM0433, RAMECC). Whether it has outlived what started the processor. Where two starts have
/// failed, it may have been by a word of it that cannot be read: no stop waits for a third. Once,
/// before the reason of this start is forgotten: a reset in between must find the same.
pub fn start(boot: BootReason, failed_starts: u32) -> bool {
    let is_kept = retained::is_kept(boot) && failed_starts < 2;
    if !is_kept {
        let bytes = PLACE.0.get().cast::<u8>();
        for start in (0..FLIGHT_BYTES).step_by(FILLED_AT_ONCE) {
            let length = FILLED_AT_ONCE.min(FLIGHT_BYTES - start);
            // Safety: inside the static, and nobody refers to it yet.
            unsafe { bytes.add(start).write_bytes(0, length) };
            watchdog::feed();
        }
    }
    is_kept
}

/// The memory, for the one recorder; once. `is_kept`: as [`start`] has said.
pub fn take(is_kept: bool) -> Memory {
    // Safety: this is called once, so nobody else refers to it; its bytes and words may be
    // any that were written.
    Memory { region: unsafe { (*PLACE.0.get()).assume_init_mut() }, is_kept }
}

/// Of what is remembered, and of who can read it: a copy is another build's where this is.
fn checksum(bytes: &[u8]) -> u32 {
    let mut digest = CHECKSUM.digest();
    digest.update(BUILD_ID.as_bytes());
    digest.update(&image::header().to_bytes());
    // Builds of changed sources have the same name: where a part of them lies tells most apart.
    let places = [size_of::<Gateway>(), Gateway::handle as *const () as usize];
    places.iter().for_each(|place| digest.update(&place.to_le_bytes()));
    digest.update(bytes);
    digest.finalize()
}

impl Shelf for Memory {
    const CORE: Option<usize> = if IS_LARGE { Some(CORE) } else { None };

    fn half(&self, half: usize) -> &[u8] {
        &self.region.halves[half & 1].0
    }

    fn half_mut(&mut self, half: usize) -> &mut [u8] {
        &mut self.region.halves[half & 1].0
    }

    fn copy(&mut self, half: usize, core: &Gateway, part: usize) {
        if !IS_LARGE {
            return;
        }
        let to = self.half_mut(half).as_mut_ptr().cast::<u32>();
        let from = from_ref(core).cast::<u32>();
        for Range { start, end } in core.bytes_of(part) {
            const WORD: usize = size_of::<u32>();
            // Safety: these are whole words of the core, which is aligned to words as the half is,
            // and has room in it. What is copied is not looked at.
            unsafe {
                copy_nonoverlapping(
                    from.add(start / WORD),
                    to.add(start / WORD),
                    (end - start) / WORD,
                );
            }
        }
    }

    fn core(&self, half: usize) -> Option<&Gateway> {
        // Safety: the recorder reads of a copy when each of its bytes has been copied between two
        // calls to the core, and no call since has changed what it had copied before. A core owns
        // nothing outside of itself, and nothing happens at its end: its bytes are another core.
        // Axes that were never used are in none, nor are they looked at. After a reset a half is
        // remembered only where its copy was whole, nobody has written it since (the ROM
        // bootloader works in the first 20 KiB of that SRAM, AN2606), and its ECC mends a bit.
        IS_LARGE.then(|| unsafe { &*self.half(half).as_ptr().cast::<Gateway>() })
    }

    fn remember(&mut self, bytes: &[u8]) {
        let remembered = &mut self.region.remembered;
        remembered.mark = [0; 2];
        compiler_fence(Ordering::SeqCst);
        let Some(place) = remembered.bytes.get_mut(..bytes.len()) else { return };
        place.copy_from_slice(bytes);
        remembered.length = bytes.len();
        remembered.checksum = checksum(bytes);
        compiler_fence(Ordering::SeqCst);
        remembered.mark = [MARK; 2];
        self.is_kept = true;
    }

    fn remembered(&self) -> Option<&[u8]> {
        let Remembered { length, checksum: kept, bytes, mark } = &self.region.remembered;
        if !self.is_kept || *mark != [MARK; 2] {
            return None;
        }
        let bytes = bytes.get(..*length)?;
        (checksum(bytes) == *kept).then_some(bytes)
    }
}
