//! RAM that outlives a reset of the processor, and nothing else: not a power cycle.
//!
//! Start-up leaves it alone. After the power was off its words have never been written, and reading
//! such a word where the RAM has an error-correcting code stops the processor: so it is filled
//! then, and never read before.
//!
//! The same code makes a write whole only when the next one to the same RAM follows: a reset in
//! between loses it (ST AN5342, ECC on RAM). So only whole words are written, and [`close`] ends
//! each group of writes with one to a word that means nothing.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use gateway::RETAINED_WORDS;
use host_protocol::BootReason;

use crate::crash_report::RECORD_WORDS;
use crate::starts::START_WORDS;
use crate::watchdog::CHECK_IN_WORDS;

/// A part of this RAM.
#[derive(Clone, Copy)]
pub struct Area {
    first: usize,
    words: usize,
}

const CORE: Area = Area { first: 0, words: RETAINED_WORDS };
/// The crash report of the run before.
pub const CRASH_REPORT: Area = Area { first: RETAINED_WORDS, words: RECORD_WORDS };
/// Which loops checked in.
pub const CHECK_INS: Area =
    Area { first: CRASH_REPORT.first + RECORD_WORDS, words: CHECK_IN_WORDS };
/// Starts that failed early.
pub const STARTS: Area = Area { first: CHECK_INS.first + CHECK_IN_WORDS, words: START_WORDS };
/// The word that closes a group of writes, with a neighbour: no other word shares the 64 bits that
/// it may be protected with.
const CLOSING: usize = (STARTS.first + START_WORDS).next_multiple_of(2);
const WORDS: usize = CLOSING + 2;

#[repr(C, align(8))]
struct Words(UnsafeCell<MaybeUninit<[u32; WORDS]>>);

// Safety: words are copied in and out, each by one access that nothing can divide; those of the
// core have one owner.
unsafe impl Sync for Words {}

#[unsafe(link_section = ".retained")]
static RETAINED: Words = Words(UnsafeCell::new(MaybeUninit::uninit()));

/// From a word of an area on.
fn pointer(area: Area, index: usize) -> *mut u32 {
    assert!(index < area.words);
    RETAINED.0.get().cast::<u32>().wrapping_add(area.first + index)
}

/// Whether this RAM has kept its words over what started the processor. If nobody knows, it has
/// not.
pub fn is_kept(boot: BootReason) -> bool {
    !matches!(boot, BootReason::PowerOn | BootReason::Brownout | BootReason::Unknown)
}

/// Makes the RAM readable; once, before anything else that can fail. Where nothing was kept it is
/// filled with zeros.
pub fn start(boot: BootReason) -> CoreWords {
    if !is_kept(boot) {
        let all = Area { first: 0, words: WORDS };
        (0..WORDS).for_each(|index| write(all, index, 0));
        close();
    }
    CoreWords { kept: is_kept(boot) }
}

/// Writes a word of an area. To be closed.
pub fn write(area: Area, index: usize, value: u32) {
    // Safety: `pointer` has checked that it is a word of the static.
    unsafe { pointer(area, index).write_volatile(value) }
}

/// Reads a word of an area.
pub fn read(area: Area, index: usize) -> u32 {
    // Safety: as in `write`; the word has been written, at the latest by `start`.
    unsafe { pointer(area, index).read_volatile() }
}

/// Ends a group of writes, and waits until the RAM has taken them.
pub fn close() {
    push();
    cortex_m::asm::dsb();
}

/// As [`close`] for a caller that goes on: the RAM takes the writes within a few cycles.
pub fn push() {
    write(Area { first: CLOSING, words: 1 }, 0, 0);
}

/// The words of the core: one owner.
pub struct CoreWords {
    kept: bool,
}

impl CoreWords {
    /// What the run before has left; nothing if it is lost.
    pub fn as_slice(&self) -> &[u32] {
        let kept = if self.kept { RETAINED_WORDS } else { 0 };
        // Safety: the words are part of the static, have been written, and only the owner writes
        // them.
        unsafe { core::slice::from_raw_parts(pointer(CORE, 0), kept) }
    }

    /// The same without what the run before has left.
    pub fn without_the_run_before(self) -> Self {
        Self { kept: false }
    }

    /// Writes a word, beyond the end nothing. To be closed.
    pub fn write(&mut self, index: usize, value: u32) {
        if index < RETAINED_WORDS {
            write(CORE, index, value);
        }
    }
}
