//! The way into the chip's ROM bootloader: over a reset, so that it finds the chip as it expects
//! it.
//!
//! The request is a mark in the RAM that outlives a reset. It is looked at only after a reset by
//! software: after power-on that RAM holds nothing, and where it has error correction reading it
//! would be an error.

use core::mem::MaybeUninit;
use core::ptr::{read_volatile, write_volatile};

use cortex_m::peripheral::SCB;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::Timer;
use host_protocol::BootReason;

use super::detach::GRACE;
use crate::board;
use crate::shared_gateway::SharedGateway;

/// The host has asked for the bootloader.
pub static ASKED_FOR: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// "Start the bootloader", and its complement in the word behind it.
const MARK: u32 = 0xB007_10AD;
const NO_MARK: u32 = 0;
/// The mark, its complement, and a word that is only written: where the RAM has error correction a
/// write is completed by the next one.
const WORDS: usize = 3;

#[unsafe(link_section = ".retained")]
static mut REQUEST: MaybeUninit<[u32; WORDS]> = MaybeUninit::uninit();

/// For ever: when the host has asked, and its request is answered, and it still may,
/// restarts into the bootloader.
pub async fn follow_requests(gateway: &SharedGateway) -> ! {
    loop {
        ASKED_FOR.wait().await;
        Timer::after(GRACE).await;
        if gateway.may_detach() {
            defmt::info!("USB: detached; the ROM bootloader is next");
            write([MARK, !MARK, NO_MARK]);
            SCB::sys_reset();
        }
        defmt::warn!("USB: did not detach: an axis is no longer at rest, or an image waits");
    }
}

/// Starts the bootloader if the run before has asked for it. To be called first of all after a
/// reset, before the watchdog is started: the bootloader does not feed it.
pub fn start_if_asked_for(boot: BootReason) {
    let asked_for = boot == BootReason::Software && read() == [MARK, !MARK];
    write([NO_MARK; WORDS]);
    if asked_for {
        board::start_rom_bootloader();
    }
}

fn write(words: [u32; WORDS]) {
    let start = (&raw mut REQUEST).cast::<u32>();
    for (index, word) in words.into_iter().enumerate() {
        // Safety: inside the static, and no reference to it exists. Only thread mode comes here.
        unsafe { write_volatile(start.add(index), word) };
    }
    cortex_m::asm::dsb();
}

fn read() -> [u32; 2] {
    let start = (&raw const REQUEST).cast::<u32>();
    // Safety: as in `write`; after a reset by software the words hold what `write` has put there.
    core::array::from_fn(|index| unsafe { read_volatile(start.add(index)) })
}
