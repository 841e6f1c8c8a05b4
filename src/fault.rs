//! What happens after a panic or a processor fault: the enable output goes inactive, the reason is
//! kept, and the board starts again at once.
//!
//! A gateway that stands still is worse than one that starts again: after the reset it stops every
//! motor that it knew.

use core::fmt::{self, Write};
use core::ops::Range;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::{DCB, MPU, SCB};
use cortex_m_rt::{ExceptionFrame, exception};

use crate::board;
use crate::crash_report::{self, Text};

/// Processor cycles that an attached debug probe is given to fetch the log before the reset wipes
/// it: 2 ms at 400 MHz. Without a probe there is no wait, and the run after this one logs the text
/// anyway.
const LOG_GRACE_CYCLES: u32 = 800_000;
/// Return addresses that are kept where there is no message; the first few belong to the panic
/// itself.
const RETURN_ADDRESSES: usize = 12;
/// The lowest bytes of the stack, which nothing may touch; a power of two.
const GUARD: usize = 256;
/// Bytes of stack that keeping the reason of a fault takes, and more, above the guard.
const HANDLER_ROOM: usize = 2048;
/// MPU_CTRL: on, and what no region covers is as without it (ARMv7-M Architecture Reference Manual,
/// B3.5).
const MPU_ON: u32 = 1 << 2 | 1;
/// MPU_RASR: normal memory of 2^(SIZE + 1) bytes without any access; on.
const NO_ACCESS: u32 = 1 << 28 | 1 << 19 | (GUARD.ilog2() - 1) << 1 | 1;
/// Bytes of a word of the stack.
const WORD: usize = size_of::<usize>();

/// What the bits of the configurable fault status register, CFSR, mean (ARMv7-M Architecture
/// Reference Manual, B3.2.15).
const FAULTS: [(u32, &str); 19] = [
    (0, "instruction from forbidden memory"),
    (1, "data access to forbidden memory"),
    (3, "forbidden memory on return from an exception"),
    (4, "forbidden memory on entry to an exception"),
    (5, "forbidden memory for a floating-point register"),
    (7, "its address is known"),
    (8, "bus error on an instruction"),
    (9, "bus error on data"),
    (10, "bus error on data some time before"),
    (11, "bus error on return from an exception"),
    (12, "bus error on entry to an exception"),
    (13, "bus error for a floating-point register"),
    (15, "its address is known"),
    (16, "undefined instruction"),
    (17, "invalid state"),
    (18, "invalid return"),
    (19, "no coprocessor"),
    (24, "unaligned access"),
    (25, "division by zero"),
];

unsafe extern "C" {
    /// One past the highest word of the stack, and its lowest; the board's memory regions.
    static _stack_start: u32;
    static _stack_end: u32;
    /// Begin and end of the code; cortex-m-rt's link.x.
    static __stext: u8;
    static __etext: u8;
}

/// Has a stack that overflows fault at once, before it reaches the end of its memory; early in each
/// start. The handlers of faults may touch the guard.
pub fn guard_stack() {
    // Safety: nothing else uses the MPU, and nothing lies in the guard.
    unsafe {
        let mpu = &*MPU::PTR;
        mpu.rnr.write(0);
        mpu.rbar.write(&raw const _stack_end as u32);
        mpu.rasr.write(NO_ACCESS);
        mpu.ctrl.write(MPU_ON);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// File and line first: a long message is cut.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    restart_after(|text| match info.location() {
        Some(at) => write!(text, "panic at {}:{}: {}", at.file(), at.line(), info.message()),
        None => write!(text, "panic: {}", info.message()),
    })
}

/// Panics of the logger's own macros: the message is in the log and nowhere else, so the way there
/// is kept.
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    restart_after(|text| {
        text.write_str("panic; on the stack, latest first:")?;
        return_addresses().try_for_each(|address| write!(text, " {address:#010x}"))
    })
}

// A handler that pushed onto a stack that is full would lock the processor up. None returns from
// here, so the stack can begin anew: not where it has room, as what was saved at the fault lies
// there and must still be read.
core::arch::global_asm!(
    ".section .text.HardFault, \"ax\"",
    ".global HardFault",
    ".type HardFault, %function",
    ".thumb_func",
    "HardFault:",
    "mov r0, sp",
    "ldr r1, =_stack_end + {room}",
    "cmp r0, r1",
    "bhs 1f",
    "ldr r1, =_stack_start",
    "mov sp, r1",
    "1: b {handler}",
    room = const HANDLER_ROOM,
    handler = sym hard_fault,
);

/// `frame`: what the processor saved, unless the stack had no room for it.
unsafe extern "C" fn hard_fault(frame: *const ExceptionFrame) -> ! {
    restart_after(|text| {
        let end = &raw const _stack_end as usize;
        if frame.addr() < end + HANDLER_ROOM {
            text.write_str("the stack is full: ")?;
        }
        if frame.addr() < end + GUARD {
            text.write_str("hard fault")?;
        } else {
            // Safety: the processor has saved it on the stack, and nothing has been written over
            // it.
            let frame = unsafe { &*frame };
            write!(text, "hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr())?;
        }
        // Safety: reading this register changes nothing.
        let status = unsafe { (*SCB::PTR).cfsr.read() };
        let met = FAULTS.iter().filter(|(bit, _)| status & (1 << bit) != 0);
        met.map(|(_, fault)| fault).try_for_each(|fault| write!(text, ", {fault}"))
    })
}

/// The clock security system has noticed that the board's clock stands still, and the chip goes on
/// with its own: what hangs on PLLs has stopped. The run after this one does without that clock. Or
/// a word of the storage is torn, which is nothing new.
#[exception]
unsafe fn NonMaskableInt() {
    if board::flash::torn_word_was_read() {
        return;
    }
    restart_after(|text| {
        text.write_str(if board::has_lost_clock() {
            "the board's clock has stopped"
        } else {
            "non-maskable interrupt"
        })
    })
}

#[exception]
unsafe fn DefaultHandler(interrupt: i16) {
    restart_after(|text| write!(text, "interrupt {interrupt} that nothing serves"))
}

/// Keeps the text and starts again; without the text if that is where the fault came from.
fn restart_after(write: impl FnOnce(&mut Text) -> fmt::Result) -> ! {
    static FAULTED: AtomicBool = AtomicBool::new(false);
    cortex_m::interrupt::disable();
    board::set_enable_output(false);
    if !FAULTED.swap(true, Ordering::Relaxed) {
        crash_report::keep(write);
        if DCB::is_debugger_attached() {
            cortex_m::asm::delay(LOG_GRACE_CYCLES);
        }
    }
    SCB::sys_reset()
}

/// The words of the stack that can be return addresses: odd, as Thumb code has them, and inside the
/// code.
fn return_addresses() -> impl Iterator<Item = usize> {
    let (top, code) = (&raw const _stack_start as usize, code());
    let here = 0usize;
    let lowest = &raw const here as usize;
    (lowest..top)
        .step_by(WORD)
        // Safety: aligned words between a live local and the top of the stack are RAM of this
        // program.
        .map(|address| unsafe { core::ptr::read_volatile(address as *const usize) })
        .filter(move |word| word % 2 == 1 && code.contains(word))
        .take(RETURN_ADDRESSES)
}

fn code() -> Range<usize> {
    &raw const __stext as usize..&raw const __etext as usize
}
