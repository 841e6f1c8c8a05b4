//! Pages of the flash: those that keep the configuration over a loss of power, and those of another
//! image.
//!
//! The chip takes up to seconds for an operation; meanwhile every other task runs. Each operation
//! has a deadline, and what was written is read back.
//!
//! A word that a loss of power has torn reads as zeros. None is written twice but with zeros, where
//! it did not take what was written: some chips allow that, and on the others the word may stay
//! torn (RM0440, PROGERR; RM0433, "overwriting"). It reads as zeros either way.

use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, Timer};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::board::flash::{self, PAGE, WORD};

/// How often it is looked for the end of an operation.
const ERASE_POLL: Duration = Duration::from_millis(1);
const WRITE_POLL: Duration = Duration::from_micros(50);
/// Words that are read before others have their turn: all of it is read at a start.
const READS_AT_ONCE: usize = 16;

unsafe extern "C" {
    /// Begin and end of the stored configuration; the board's memory regions.
    static _storage_start: u8;
    static _storage_end: u8;
}

#[cfg(has_loader)]
unsafe extern "C" {
    /// Begin and end of the place of another image, and of what is to become of it.
    static _update_start: u8;
    static _update_end: u8;
    static _state_start: u8;
    static _state_end: u8;
}

/// Whole pages of the flash, which have one owner.
pub struct Pages {
    start: u32,
    length: u32,
    /// Words read so far.
    reads: usize,
}

impl Pages {
    /// Those of the stored configuration, once; nothing where the program may run from them.
    pub fn of_configuration() -> Option<Self> {
        let pages = Self::between(&raw const _storage_start, &raw const _storage_end);
        flash::has_two_banks().then_some(pages)
    }

    /// Those of another image, and those that say what is to become of it; once.
    #[cfg(has_loader)]
    pub fn of_images() -> [Self; 2] {
        [
            Self::between(&raw const _update_start, &raw const _update_end),
            Self::between(&raw const _state_start, &raw const _state_end),
        ]
    }

    /// Of addresses.
    fn between(start: *const u8, end: *const u8) -> Self {
        Self { start: start as u32, length: end as u32 - start as u32, reads: 0 }
    }

    /// Bytes of all of them.
    pub fn length(&self) -> u32 {
        self.length
    }

    /// Waits for the end of what was begun at an address.
    async fn ended(
        address: u32,
        poll: Duration,
        limit: core::time::Duration,
    ) -> Result<(), Failure> {
        // Never the difference of two times, which panics where the second one is the earlier.
        let until = Instant::now() + Duration::try_from(limit).unwrap_or(Duration::MIN);
        let result = loop {
            match flash::result(address) {
                Some(succeeded) => break succeeded,
                None if Instant::now() >= until => break false,
                None => Timer::after(poll).await,
            }
        };
        flash::end(address);
        if result { Ok(()) } else { Err(Failure) }
    }

    async fn write_word(address: u32, word: &[u8; WORD]) -> Result<(), Failure> {
        if flash::result(address).is_none() {
            return Err(Failure);
        }
        flash::begin_write(address, word);
        Self::ended(address, WRITE_POLL, flash::WRITE_LIMIT).await?;
        let mut written = [0; WORD];
        flash::read(address, &mut written);
        if written == *word { Ok(()) } else { Err(Failure) }
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

impl ErrorType for Pages {
    type Error = Failure;
}

impl ReadNorFlash for Pages {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        let mut at = offset as usize;
        let mut rest = bytes;
        let mut word = [0; WORD];
        while !rest.is_empty() {
            let skipped = at % WORD;
            if at >= self.capacity() {
                return Err(Failure);
            }
            self.reads = self.reads.wrapping_add(1);
            if self.reads.is_multiple_of(READS_AT_ONCE) {
                yield_now().await;
            }
            let begin = u32::try_from(at - skipped).map_err(|_| Failure)?;
            flash::read(self.start + begin, &mut word);
            let (now, later) = rest.split_at_mut(rest.len().min(WORD - skipped));
            now.copy_from_slice(word.get(skipped..skipped + now.len()).ok_or(Failure)?);
            at += now.len();
            rest = later;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.length as usize
    }
}

impl NorFlash for Pages {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        for offset in (from..to.min(self.length)).step_by(PAGE) {
            let address = self.start + offset;
            if flash::result(address).is_none() {
                return Err(Failure);
            }
            flash::begin_erase(address);
            Self::ended(address, ERASE_POLL, flash::ERASE_LIMIT).await?;
            // What feeds the watchdog may have stood still.
            Timer::after(ERASE_POLL).await;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        let (words, _) = bytes.as_chunks();
        for (at, word) in (offset..self.length).step_by(WORD).zip(words) {
            let result = Self::write_word(self.start + at, word).await;
            if result.is_err() && *word != [0; WORD] {
                // Nobody is to take it for an erased one.
                let _ = Self::write_word(self.start + at, &[0; WORD]).await;
            }
            result?;
        }
        Ok(())
    }
}
