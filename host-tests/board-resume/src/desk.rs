//! What both sides put down for each other, and the program: it starts at `start`, and works whenever
//! it is asked to.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use gateway::{Gateway, MAX_SNAPSHOT};

/// It is to work.
const ASKED: u32 = 1;
/// It is done.
const DONE: u32 = 2;
/// The snapshot is none of this build, or of another board.
const UNREADABLE: u32 = 3;

/// Everything, in this order; [`Desk::status`] is written last.
#[repr(C)]
struct Desk {
    /// One of the numbers above.
    status: u32,
    /// Bytes of `given`; with none only `taken` is filled.
    given_length: usize,
    /// The core of the image, in a copy of its memory.
    live: *mut Gateway,
    /// Bytes of `taken`; none where the snapshot has no room.
    taken_length: usize,
    /// Bytes of a core in memory.
    core_length: usize,
    /// Where the build of the core's board is named, and how many bytes these are.
    build: (usize, usize),
    /// A snapshot that is to be laid out.
    given: [u8; MAX_SNAPSHOT],
    /// A snapshot of that core.
    taken: [u8; MAX_SNAPSHOT],
    /// What `given` is in that memory.
    laid_out: MaybeUninit<Gateway>,
}

struct Place(UnsafeCell<MaybeUninit<Desk>>);

// Safety: there is one thread.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".desk")]
#[unsafe(export_name = "DESK")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

// The floating point unit is off at reset (PM0253 §4.6.5).
core::arch::global_asm!(
    ".section .text.start",
    ".global start",
    ".thumb_func",
    "start:",
    "ldr r0, =0xE000ED88",
    "ldr r1, [r0]",
    "orr r1, r1, #0x00F00000",
    "str r1, [r0]",
    "dsb",
    "isb",
    "bl work",
);

/// For ever: works when it is asked to.
#[unsafe(no_mangle)]
extern "C" fn work() -> ! {
    let desk = PLACE.0.get().cast::<Desk>();
    loop {
        // Safety: a word of it, whoever writes it.
        let status = unsafe { addr_of_mut!((*desk).status) };
        // Safety: as above.
        if unsafe { status.read_volatile() } == ASKED {
            // Safety: whoever asked has filled `given_length`, `given` and `live`, and waits.
            let done = work_once(unsafe { &mut *desk });
            // Safety: as above; written when all else is.
            unsafe { status.write_volatile(done) };
        }
    }
}

/// Returns what came of it.
fn work_once(desk: &mut Desk) -> u32 {
    // Safety: a core of this build, and what it refers to, lie there as in the image's memory.
    let live = unsafe { &mut *desk.live };
    let board = live.board();
    desk.build = (board.build_id.as_ptr() as usize, board.build_id.len());
    desk.core_length = size_of::<Gateway>();
    desk.taken_length = live.snapshot(&mut desk.taken).map_or(0, <[u8]>::len);
    let Some(given) = desk.given.get(..desk.given_length).filter(|given| !given.is_empty()) else {
        return DONE;
    };
    let Ok((mut core, _)) = Gateway::resume(board, given) else { return UNREADABLE };
    core.run_as(live);
    desk.laid_out.write(core);
    DONE
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}
