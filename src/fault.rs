//! What happens after a panic or a processor fault: the log gets a few lines, then the board starts again.
//!
//! A gateway that stands still is worse than one that starts again: after the reset nothing is armed and the motors'
//! own timeouts act.

use core::ops::Range;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

/// Processor cycles that the log is given to reach a debug probe before the reset wipes it: 10 ms at 400 MHz.
const LOG_GRACE_CYCLES: u32 = 4_000_000;
/// Return addresses that are logged; the first few belong to the panic itself.
const RETURN_ADDRESSES: usize = 12;
/// Bytes of a word of the stack.
const WORD: usize = size_of::<usize>();

unsafe extern "C" {
    /// One past the highest word of the stack; cortex-m-rt's link.x.
    static _stack_start: u32;
    /// Begin and end of the code; cortex-m-rt's link.x.
    static __stext: u8;
    static __etext: u8;
}

/// The message and the source line stay out of the image: they cost 9 KiB of flash. The return addresses lead there:
/// `addr2line -fie target/thumbv7em-none-eabihf/firmware/motor-gateway 0x08…`
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    restart_after(|| {
        defmt::error!("panic; addresses on the stack, latest first:");
        log_return_addresses();
    })
}

/// Panics of the logger's own macros have logged their message already.
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    restart_after(log_return_addresses)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    restart_after(|| {
        defmt::error!("hard fault at {=u32:#010x}, called from {=u32:#010x}", frame.pc(), frame.lr());
    })
}

#[exception]
unsafe fn DefaultHandler(interrupt: i16) {
    restart_after(|| defmt::error!("interrupt {=i16} that nothing serves", interrupt))
}

/// Logs and starts again; without the log if that is where the fault came from.
fn restart_after(log: impl FnOnce()) -> ! {
    static FAULTED: AtomicBool = AtomicBool::new(false);
    cortex_m::interrupt::disable();
    if !FAULTED.swap(true, Ordering::Relaxed) {
        log();
        cortex_m::asm::delay(LOG_GRACE_CYCLES);
    }
    SCB::sys_reset()
}

/// Logs the words of the stack that can be return addresses: odd, as Thumb code has them, and inside the code.
fn log_return_addresses() {
    let (top, code) = (&raw const _stack_start as usize, code());
    let here = 0usize;
    let lowest = &raw const here as usize;
    (lowest..top)
        .step_by(WORD)
        // Safety: aligned words between a live local and the top of the stack are RAM of this program.
        .map(|address| unsafe { core::ptr::read_volatile(address as *const usize) })
        .filter(|word| word % 2 == 1 && code.contains(word))
        .take(RETURN_ADDRESSES)
        .for_each(|address| defmt::error!("  {=usize:#010x}", address));
}

fn code() -> Range<usize> {
    &raw const __stext as usize..&raw const __etext as usize
}
