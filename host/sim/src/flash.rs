//! A NOR flash whose power can fail at every operation.

use std::fs::{File, OpenOptions, TryLockError};
use std::future::Future;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use config_store::ConfigStore;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

const ERASED: u8 = 0xFF;
/// The bytes of a word that was cut short, of which the error-correcting code can make nothing, as
/// the firmware reads it: each second one here.
const TORN: u8 = 0;

/// A flash of whole pages of `PAGE` bytes, which are erased together. It is written in words of
/// `WORD` bytes, each once after it was erased, or with zeros: chips with an error-correcting code
/// take no more.
#[derive(Debug)]
pub struct Flash<const PAGE: usize, const WORD: usize> {
    bytes: Vec<u8>,
    /// Operations until the power fails, in the middle of the one after them.
    left: Option<usize>,
    /// What a word that is cut short becomes.
    random: fastrand::Rng,
    /// Operations so far.
    operations: usize,
    file: Option<File>,
}

/// The flash of a NUCLEO-G474RE: pages of 2 KiB, words of 8 bytes.
pub type G474Flash = Flash<2048, 8>;
/// Bank 2 of a NUCLEO-H743ZI: sectors of 128 KiB, words of 32 bytes.
pub type H743Flash = Flash<0x2_0000, 32>;

impl<const PAGE: usize, const WORD: usize> Flash<PAGE, WORD> {
    /// An erased flash.
    pub fn new(pages: usize) -> Self {
        let (bytes, random) = (vec![ERASED; pages * PAGE], fastrand::Rng::with_seed(1));
        Self { bytes, left: None, random, operations: 0, file: None }
    }

    /// A flash that is kept in a file.
    ///
    /// # Errors
    /// The file cannot be read or written, has another length, or another program keeps a flash in
    /// it.
    pub fn in_file(path: &Path, pages: usize) -> io::Result<Self> {
        let mut flash = Self::new(pages);
        let mut options = OpenOptions::new();
        let mut file = options.read(true).write(true).create(true).truncate(false).open(path)?;
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            let text = "another program keeps its storage there";
            return Err(io::Error::new(io::ErrorKind::ResourceBusy, text));
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        match (bytes.len(), flash.bytes.len()) {
            (0, _) => file.write_all(&flash.bytes)?,
            (has, needs) if has == needs => flash.bytes = bytes,
            (has, needs) => {
                let text = format!("it has {has} bytes, and a storage has {needs}");
                return Err(io::Error::new(io::ErrorKind::InvalidData, text));
            }
        }
        flash.file = Some(file);
        Ok(flash)
    }

    /// The power fails in the middle of the operation after so many, by `seed`.
    pub fn cut_after(&mut self, operations: usize, seed: u64) {
        (self.left, self.random) = (Some(operations), fastrand::Rng::with_seed(seed));
    }

    /// Power is back.
    pub fn power_on(&mut self) {
        self.left = None;
    }

    /// Writes and erasures so far.
    pub fn operations(&self) -> usize {
        self.operations
    }

    /// What is in it, to be damaged.
    pub fn bytes(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// Whether the next operation is carried out whole.
    fn has_power(&mut self) -> Result<bool, Failure> {
        self.operations += 1;
        match &mut self.left {
            None => Ok(true),
            Some(usize::MAX) => Err(Failure::NoPower),
            Some(0) => {
                self.left = Some(usize::MAX);
                Ok(false)
            }
            Some(left) => {
                *left -= 1;
                Ok(true)
            }
        }
    }

    fn keep(&mut self, range: Range<usize>) -> Result<(), Failure> {
        let Some(file) = &mut self.file else { return Ok(()) };
        let written = file.seek(SeekFrom::Start(range.start as u64));
        let written = written.and_then(|_| file.write_all(&self.bytes[range]));
        written.and_then(|()| file.flush()).map_err(|_| Failure::File)
    }
}

/// Why the flash does nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// It has no power.
    NoPower,
    /// Not whole words or pages of it.
    Range,
    /// A word is written that is not erased.
    NotErased,
    /// Its file cannot be written.
    File,
}

impl NorFlashError for Failure {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const PAGE: usize, const WORD: usize> ErrorType for Flash<PAGE, WORD> {
    type Error = Failure;
}

impl<const PAGE: usize, const WORD: usize> ReadNorFlash for Flash<PAGE, WORD> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        let from = offset as usize;
        let read = self.bytes.get(from..from + bytes.len()).ok_or(Failure::Range)?;
        bytes.copy_from_slice(read);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const PAGE: usize, const WORD: usize> NorFlash for Flash<PAGE, WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        let (from, to) = (from as usize, to as usize);
        if !from.is_multiple_of(PAGE) || !to.is_multiple_of(PAGE) || to > self.bytes.len() {
            return Err(Failure::Range);
        }
        for page in (from..to).step_by(PAGE) {
            let whole = self.has_power()?;
            for word in self.bytes[page..page + PAGE].chunks_mut(WORD) {
                // An erased one stays so.
                if !whole && word.iter().any(|byte| *byte != ERASED) && self.random.bool() {
                    word.fill(TORN);
                    continue;
                }
                for byte in word {
                    // Erasing sets bits, each in its own time.
                    *byte |= if whole { ERASED } else { self.random.u8(..) };
                }
            }
            self.keep(page..page + PAGE)?;
            if !whole {
                return Err(Failure::NoPower);
            }
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        let from = offset as usize;
        let end = from + bytes.len();
        if !from.is_multiple_of(WORD) || !end.is_multiple_of(WORD) || end > self.bytes.len() {
            return Err(Failure::Range);
        }
        for (at, word) in (from..).step_by(WORD).zip(bytes.chunks(WORD)) {
            // Zeros mark what is over, also where a cut has begun to (RM0440, PROGERR).
            let is_erased = self.bytes[at..at + WORD].iter().all(|byte| *byte == ERASED);
            if !is_erased && word.iter().any(|byte| *byte != 0) {
                return Err(Failure::NotErased);
            }
            let whole = self.has_power()?;
            let is_hidden = !whole && self.random.bool();
            for (byte, new) in self.bytes[at..at + WORD].iter_mut().zip(word) {
                *byte = match whole {
                    true => *byte & *new,
                    false if is_hidden => TORN,
                    false => *byte & (*new | self.random.u8(..)),
                };
            }
            self.keep(at..at + WORD)?;
            if !whole {
                return Err(Failure::NoPower);
            }
        }
        Ok(())
    }
}

/// The storage of a simulated board.
pub type Storage = ConfigStore<G474Flash>;

/// Pages of it.
const STORAGE_PAGES: usize = 16;

/// The storage of a simulated board, in a file or only as long as the program runs.
///
/// # Errors
/// The file cannot be used.
pub fn storage(path: Option<&Path>) -> io::Result<Storage> {
    let flash = match path {
        Some(path) => G474Flash::in_file(path, STORAGE_PAGES)?,
        None => G474Flash::new(STORAGE_PAGES),
    };
    let end = u32::try_from(flash.capacity()).unwrap_or(0);
    ConfigStore::new(flash, 0..end).ok_or_else(|| io::Error::other("it has less than two pages"))
}

/// What this flash is asked never has to wait.
///
/// # Panics
/// If it does.
pub fn at_once<T>(future: impl Future<Output = T>) -> T {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => result,
        Poll::Pending => panic!("the simulated flash does not wait"),
    }
}
