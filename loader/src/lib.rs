//! What starts first on a board: it exchanges images where an update waits, goes back where the new
//! one was not confirmed, and says whether there is an image to start.
//!
//! The exchange is `embassy-boot`'s: a page at a time, and after each a word that counts, so that
//! it goes on where a loss of power has cut it.
#![no_std]
#![forbid(unsafe_code)]

use core::ops::{Range, RangeInclusive};

use embassy_boot::{BootError, BootLoader, BootLoaderConfig, State};
use embedded_storage::nor_flash::NorFlash;

/// How often it is tried before the loader gives up: an operation of the flash that fails once
/// succeeds the next time.
const TRIES: usize = 4;

/// What to do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// Start the image.
    Image,
    /// There is none: wait for one.
    NoImage,
    /// The flash fails in the middle of an exchange, and there is no whole image: try again later.
    Later,
}

/// Exchanges images where that is due. `has_image` says whether the active partition holds one;
/// `buffer` has a word of the flash; `start_watch` is called once before the first operation.
pub fn prepare<A, D, S>(
    partitions: &mut Partitions<A, D, S>,
    buffer: &mut [u8],
    start_watch: impl FnOnce(),
    has_image: impl Fn() -> bool,
) -> Next
where
    A: NorFlash,
    D: NorFlash,
    S: NorFlash,
{
    let mut start_watch = Some(start_watch);
    for _ in 0..TRIES {
        match partitions.prepare_once(buffer, &mut start_watch) {
            Err(_) => {}
            Ok(_) if has_image() => return Next::Image,
            // What was swapped in is none: the next try goes back.
            Ok(State::Swap) => {}
            Ok(_) => return Next::NoImage,
        }
    }
    match partitions.is_whole(buffer) {
        Ok(true) if has_image() => Next::Image,
        Ok(true) => Next::NoImage,
        _ => Next::Later,
    }
}

/// Where the images lie, and which is to run.
pub struct Partitions<A, D, S> {
    /// What runs.
    pub active: A,
    /// The other image, and a page more.
    pub update: D,
    /// What is to be done, and how far it has come.
    pub state: S,
}

impl<A: NorFlash, D: NorFlash, S: NorFlash> Partitions<A, D, S> {
    fn prepare_once(
        &mut self,
        buffer: &mut [u8],
        start_watch: &mut Option<impl FnOnce()>,
    ) -> Result<State, BootError> {
        let Self { active, update: dfu, state } = self;
        let mut loader = BootLoader::new(BootLoaderConfig { active, dfu, state });
        if loader.read_state(buffer)? == State::Swap
            && let Some(start) = start_watch.take()
        {
            start();
        }
        loader.prepare_boot(buffer)
    }

    /// Whether the active partition is all of one image: no exchange is under way there.
    fn is_whole(&mut self, buffer: &mut [u8]) -> Result<bool, S::Error> {
        let word = buffer.get_mut(..S::WRITE_SIZE).unwrap_or_default();
        let pages = self.active.capacity() / A::ERASE_SIZE.max(D::ERASE_SIZE);
        let mut done = 0;
        // As embassy-boot lays it out: what to do, whether the progress counts, the progress.
        for index in 0..4 * pages {
            let offset = u32::try_from((2 + index) * S::WRITE_SIZE).unwrap_or(u32::MAX);
            self.state.read(offset, word)?;
            if word.contains(&ERASED) {
                break;
            }
            done = index + 1;
        }
        Ok([0, 2 * pages, 4 * pages].contains(&done))
    }
}

/// What an erased byte reads as.
const ERASED: u8 = 0xFF;

/// Whether a vector table is that of an image: its stack pointer in the RAM, its entry in the
/// image, as Thumb code.
pub fn is_image(stack: u32, entry: u32, ram: RangeInclusive<u32>, image: Range<u32>) -> bool {
    ram.contains(&stack) && stack.is_multiple_of(8) && image.contains(&entry) && entry % 2 == 1
}
