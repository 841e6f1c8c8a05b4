//! The flash interface of the STM32G474, as far as the storage needs it: the end of bank 2 (RM0440,
//! embedded flash memory for category 3 devices).
//!
//! The image is longer than bank 1, so the processor stands still while bank 2 is busy and it needs
//! something from there: 25 ms at most for a page, 0.1 ms for a word (data sheet DS12288, flash
//! memory characteristics). The watchdog bears that.
//!
//! By registers: the driver has no deadline for an operation.

use core::sync::atomic::{AtomicU8, Ordering};
use core::time::Duration;

use super::pac::FLASH;

/// Bytes of a page, which is erased as a whole, and of a word, which is written as a whole.
pub const PAGE: usize = 2 << 10;
pub const WORD: usize = 8;
/// Several times what they take at most.
pub const ERASE_LIMIT: Duration = Duration::from_millis(100);
pub const WRITE_LIMIT: Duration = Duration::from_millis(2);

const BANK_1: u32 = 0x0800_0000;
const BANK_2: u32 = 0x0804_0000;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Whether a word of the storage is being read, and whether it is torn.
static READING: AtomicU8 = AtomicU8::new(IDLE);
const IDLE: u8 = 0;
const UNDER_WAY: u8 = 1;
const TORN: u8 = 2;

/// Whether the option DBANK divides the flash. Without it the pages are others, and the program
/// runs from the one bank.
pub fn has_two_banks() -> bool {
    FLASH.optr().read().dbank()
}

/// The data cache would keep what was there before, and may be corrupted by reads meanwhile (ST's
/// HAL switches it off for each operation).
fn set_data_cache(on: bool) {
    if on {
        FLASH.acr().modify(|w| w.set_dcrst(true));
        FLASH.acr().modify(|w| w.set_dcrst(false));
    }
    FLASH.acr().modify(|w| w.set_dcen(on));
}

fn unlock() {
    set_data_cache(false);
    // A flag that is set is cleared by writing it.
    FLASH.sr().modify(|_| {});
    if FLASH.cr().read().lock() {
        KEYS.iter().for_each(|key| FLASH.keyr().write_value(*key));
    }
}

/// Begins to erase the page at an address.
#[expect(clippy::cast_possible_truncation, reason = "128 pages")]
pub fn begin_erase(address: u32) {
    unlock();
    let page = (address - BANK_2) / PAGE as u32;
    FLASH.cr().modify(|w| {
        w.set_per(true);
        w.set_bker(true);
        w.set_pnb(page as u8);
    });
    FLASH.cr().modify(|w| w.set_strt(true));
}

/// Begins to write the word at an address.
pub fn begin_write(address: u32, word: &[u8; WORD]) {
    unlock();
    FLASH.cr().modify(|w| w.set_pg(true));
    let (parts, _) = word.as_chunks();
    for (at, part) in (address..).step_by(size_of::<u32>()).zip(parts) {
        // Safety: an aligned word of the storage's pages, which hold nothing of the program; the
        // interface takes it, and begins with the second.
        unsafe { (at as *mut u32).write_volatile(u32::from_le_bytes(*part)) }
        cortex_m::asm::dsb();
    }
}

/// Whether what was begun at an address has succeeded; nothing while it is under way.
pub fn result(_address: u32) -> Option<bool> {
    let status = FLASH.sr().read();
    let failed = status.operr()
        || status.progerr()
        || status.wrperr()
        || status.pgaerr()
        || status.sizerr()
        || status.pgserr();
    (!status.bsy()).then_some(!failed)
}

/// Locks the flash again, whatever the address.
pub fn end(_address: u32) {
    FLASH.cr().modify(|w| {
        w.set_per(false);
        w.set_bker(false);
        w.set_pg(false);
        w.set_lock(true);
    });
    set_data_cache(true);
}

/// Reads the word at an address. One that has two wrong bits, as a loss of power leaves it, raises
/// the NMI, and reads as zeros here.
pub fn read(address: u32, word: &mut [u8; WORD]) {
    cortex_m::interrupt::free(|_| {
        set_data_cache(false);
        FLASH.eccr().modify(|_| {});
        // Safety: aligned words of the flash. What the interface still holds is not checked again:
        // so another word is read before.
        unsafe { (BANK_1 as *const u32).read_volatile() };
        READING.store(UNDER_WAY, Ordering::SeqCst);
        let (parts, _) = word.as_chunks_mut();
        for (at, part) in (address..).step_by(size_of::<u32>()).zip(parts) {
            // Safety: as above.
            *part = unsafe { (at as *const u32).read_volatile() }.to_le_bytes();
        }
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        if READING.swap(IDLE, Ordering::SeqCst) == TORN {
            *word = [0; WORD];
        }
        set_data_cache(true);
    });
}

/// Whether this is why the NMI was raised: [`read`] has met a torn word. It goes on.
pub fn torn_word_was_read() -> bool {
    let is_torn = FLASH.eccr().read().eccd() && READING.load(Ordering::SeqCst) != IDLE;
    if is_torn {
        FLASH.eccr().modify(|_| {});
        READING.store(TORN, Ordering::SeqCst);
    }
    is_torn
}
