//! A part of the flash, written while the processor waits.

use core::ops::Range;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::flash::{self, PAGE, WORD};
use crate::watchdog;

/// The clock after a reset.
const CLOCK_MHZ: u32 = 64;
/// How often it is looked for the end of an operation, and how often at most: four times what the
/// firmware waits. The watchdog waits longer.
const WRITE_POLL_US: u32 = 50;
const ERASE_POLL_US: u32 = 1000;
const WRITE_POLLS: u128 = 4 * flash::WRITE_LIMIT.as_micros() / WRITE_POLL_US as u128;
const ERASE_POLLS: u128 = 4 * flash::ERASE_LIMIT.as_micros() / ERASE_POLL_US as u128;

unsafe extern "C" {
    /// Begins and ends; h743_layout.x.
    static _active_start: u8;
    static _active_end: u8;
    static _update_start: u8;
    static _update_end: u8;
    static _state_start: u8;
    static _state_end: u8;
}

/// Whole sectors.
#[derive(Clone, Copy)]
pub struct Partition {
    start: u32,
    end: u32,
}

impl Partition {
    /// What runs.
    pub fn active() -> Self {
        Self::between(&raw const _active_start, &raw const _active_end)
    }

    /// The other image.
    pub fn update() -> Self {
        Self::between(&raw const _update_start, &raw const _update_end)
    }

    /// Which is to run.
    pub fn state() -> Self {
        Self::between(&raw const _state_start, &raw const _state_end)
    }

    fn between(start: *const u8, end: *const u8) -> Self {
        Self { start: start as u32, end: end as u32 }
    }

    /// Where it lies.
    pub fn addresses(&self) -> Range<u32> {
        self.start..self.end
    }

    /// What its first two words say.
    pub fn first_words(&self) -> [u32; 2] {
        let mut bytes = [0; WORD];
        flash::read(self.start, &mut bytes);
        let (words, _) = bytes.as_chunks();
        core::array::from_fn(|index| words.get(index).map_or(0, |word| u32::from_le_bytes(*word)))
    }
}

/// The flash did not do what it was told.
#[derive(Debug)]
pub struct Failure;

impl NorFlashError for Failure {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Partition {
    type Error = Failure;
}

impl ReadNorFlash for Partition {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        let (words, _) = bytes.as_chunks_mut();
        for (address, word) in (self.start + offset..self.end).step_by(WORD).zip(words) {
            flash::read(address, word);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        (self.end - self.start) as usize
    }
}

impl NorFlash for Partition {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        for address in (self.start + from..self.start + to).step_by(PAGE) {
            watchdog::feed();
            flash::begin_erase(address);
            ended(address, ERASE_POLL_US, ERASE_POLLS)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        let (words, _) = bytes.as_chunks();
        for (address, word) in (self.start + offset..self.end).step_by(WORD).zip(words) {
            watchdog::feed();
            let (mut before, mut after) = ([0; WORD], [0; WORD]);
            flash::read(address, &mut before);
            flash::begin_write(address, word);
            ended(address, WRITE_POLL_US, WRITE_POLLS)?;
            flash::read(address, &mut after);
            // Where a cut has torn a word that counts, zeros are written over it, and what it reads
            // as then is nobody's business, as long as it is not erased.
            let is_mended = before != [0xFF; WORD] && *word == [0; WORD];
            if after != *word && !is_mended {
                return Err(Failure);
            }
        }
        Ok(())
    }
}

/// Waits for the end of what was begun. Its clock is on after a reset, and off again at the end.
fn ended(address: u32, poll_us: u32, polls: u128) -> Result<(), Failure> {
    // Safety: nobody else has it.
    let mut timer = unsafe { cortex_m::Peripherals::steal() }.SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(poll_us * CLOCK_MHZ);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
    let result = (0..polls).find_map(|_| {
        let result = flash::result(address);
        if result.is_none() {
            cortex_m::asm::wfi();
        }
        result
    });
    stop(&mut timer);
    flash::end(address);
    if result == Some(true) { Ok(()) } else { Err(Failure) }
}

fn stop(timer: &mut SYST) {
    timer.disable_counter();
    timer.disable_interrupt();
    SCB::clear_pendst();
}
