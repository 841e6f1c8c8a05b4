//! The loader of the NUCLEO-H743ZI: what the chip starts. It leaves clocks, pins and the retained
//! RAM alone.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[path = "../../src/board/h743_flash.rs"]
#[allow(dead_code, reason = "the firmware asks it more")]
mod flash;
#[cfg(target_os = "none")]
mod partition;
#[cfg(target_os = "none")]
mod watchdog;

// As the flash interface has it, which the firmware has, too.
#[cfg(target_os = "none")]
use stm32_metapac as pac;

/// The stack pointer of an image begins in the DTCM, or at its end.
#[cfg(target_os = "none")]
const RAM: core::ops::RangeInclusive<u32> = 0x2000_0000..=0x2002_0000;
/// Where the ROM bootloader's vector table lies (AN2606).
#[cfg(target_os = "none")]
const ROM_BOOTLOADER: u32 = 0x1FF0_9800;

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use loader::{Next, Partitions};
    use partition::Partition;

    let (active, update, state) = (Partition::active(), Partition::update(), Partition::state());
    let has_image = || {
        let [stack, entry] = active.first_words();
        loader::is_image(stack, entry, RAM, active.addresses())
    };
    let mut partitions = Partitions { active, update, state };
    let mut buffer = [0; flash::WORD];
    let mut is_watched = false;
    let watch = || {
        is_watched = true;
        watchdog::start();
    };
    match loader::prepare(&mut partitions, &mut buffer, watch, has_image) {
        Next::Image => {
            if is_watched {
                watchdog::hand_over();
            }
            start(active.addresses().start)
        }
        // The ROM bootloader does not feed the watchdog: it is entered by the next start, which
        // exchanges nothing.
        Next::NoImage if is_watched => wait(),
        // A probe or DFU brings one.
        Next::NoImage => start(ROM_BOOTLOADER),
        // The watchdog restarts it, and it tries again.
        Next::Later => wait(),
    }
}

#[cfg(target_os = "none")]
fn start(vector_table: u32) -> ! {
    // Safety: a stack pointer and an entry point lie there, and nothing of this program is in use.
    unsafe { cortex_m::asm::bootload(vector_table as *const u32) }
}

#[cfg(target_os = "none")]
fn wait() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

/// The watchdog restarts it where it was started, else a probe or the reset pin does.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    wait()
}

/// It ends a wait.
#[cfg(target_os = "none")]
#[cortex_m_rt::exception]
fn SysTick() {}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is a board's loader: `cargo fw` builds it with the firmware.");
}
