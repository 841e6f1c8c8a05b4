//! The flash interface of the STM32H743 (RM0433, embedded flash memory): for the firmware, which
//! writes to bank 2, from which nothing runs, and for its loader. The processor stands still as
//! soon as it needs something from a bank that is busy.
//!
//! By registers: the driver has no deadline for an operation, and takes a flag that a read has left
//! for a failure of the write after it.

use core::arch::asm;
use core::time::Duration;

use cortex_m::peripheral::SCB;

use super::pac::flash::regs::Ccr;
use super::pac::{FLASH, flash::Bank};

/// Bytes of a sector, which is erased as a whole, and of a word, which is written as a whole.
pub const PAGE: usize = 128 << 10;
pub const WORD: usize = 32;
/// Twice what they take at most (data sheet DS12110, flash memory programming).
pub const ERASE_LIMIT: Duration = Duration::from_secs(4);
pub const WRITE_LIMIT: Duration = Duration::from_millis(2);

const BANK_2: u32 = 0x0810_0000;
const BANK_BYTES: u32 = 1 << 20;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// CCR.BFHFNMIGN: loads that fail are not faults where nothing may interrupt (ARMv7-M Architecture
/// Reference Manual, B3.2.8).
const IGNORE_FAULTS: u32 = 1 << 8;

const fn bank(address: u32) -> Bank {
    FLASH.bank((address >= BANK_2) as usize)
}

/// Whether there is a second bank: always.
pub fn has_two_banks() -> bool {
    true
}

fn unlock(bank: Bank) {
    bank.ccr().write_value(Ccr(u32::MAX));
    if bank.cr().read().lock() {
        KEYS.iter().for_each(|key| bank.keyr().write_value(*key));
    }
}

/// Begins to erase the sector at an address. With the widest parallelism, as after reset: the
/// boards supply 3.3 V.
#[expect(clippy::cast_possible_truncation, reason = "eight sectors")]
pub fn begin_erase(address: u32) {
    let bank = bank(address);
    unlock(bank);
    let sector = address % BANK_BYTES / PAGE as u32;
    bank.cr().modify(|w| {
        w.set_ser(true);
        w.set_snb(sector as u8);
    });
    bank.cr().modify(|w| w.set_start(true));
    cortex_m::asm::dsb();
}

/// Begins to write the word at an address.
pub fn begin_write(address: u32, word: &[u8; WORD]) {
    let bank = bank(address);
    unlock(bank);
    bank.cr().modify(|w| w.set_pg(true));
    // The interface refuses what comes before the bit is set.
    cortex_m::asm::dsb();
    let (parts, _) = word.as_chunks();
    for (at, part) in (address..).step_by(size_of::<u32>()).zip(parts) {
        // Safety: an aligned word of pages that hold nothing of what runs; the interface takes it
        // for its buffer.
        unsafe { (at as *mut u32).write_volatile(u32::from_le_bytes(*part)) }
    }
    cortex_m::asm::dsb();
}

/// Whether what was begun at an address has succeeded; nothing while it is under way.
pub fn result(address: u32) -> Option<bool> {
    let status = bank(address).sr().read();
    let is_busy = status.bsy() || status.qw() || status.wbne();
    let failed =
        status.wrperr() || status.pgserr() || status.strberr() || status.incerr() || status.operr();
    (!is_busy).then_some(!failed)
}

/// Locks the bank of an address again.
pub fn end(address: u32) {
    bank(address).cr().modify(|w| {
        w.set_ser(false);
        w.set_pg(false);
        w.set_lock(true);
    });
}

/// Reads the word at an address. One that has two wrong bits, as a loss of power leaves it, is a
/// bus fault on this chip, and reads as zeros here.
pub fn read(address: u32, word: &mut [u8; WORD]) {
    // What stands there by now is of another load.
    bank(address).ccr().write(|w| w.set_clr_dbeccerr(true));
    // Safety: aligned words of the flash, read where nothing can interrupt: so no other load's
    // fault is ignored. The masks are as before in the end, as no interrupt handler reads these
    // pages.
    let status = unsafe {
        asm!("cpsid f");
        (*SCB::PTR).ccr.modify(|bits| bits | IGNORE_FAULTS);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        let (parts, _) = word.as_chunks_mut();
        for (at, part) in (address..).step_by(size_of::<u32>()).zip(parts) {
            *part = (at as *const u32).read_volatile().to_le_bytes();
        }
        cortex_m::asm::dsb();
        (*SCB::PTR).ccr.modify(|bits| bits & !IGNORE_FAULTS);
        let status = bank(address).sr().read();
        asm!("cpsie f");
        status
    };
    if status.dbeccerr() {
        bank(address).ccr().write(|w| w.set_clr_dbeccerr(true));
        *word = [0; WORD];
    }
}

/// A torn word is a bus fault here, and [`read`] expects it.
pub fn torn_word_was_read() -> bool {
    false
}
