//! The exchange of images in a flash whose power fails at any operation, as the virtual board's
//! flash does, or which fails.

use std::cell::RefCell;

use embassy_boot::{BlockingFirmwareState, State};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use loader::{Next, Partitions, prepare};

const WORD: usize = 32;
/// Three words: what is written into a page is cut at its begin, in its middle, at its end.
const PAGE: usize = 3 * WORD;
const PAGES: usize = 4;
const IMAGE: usize = PAGES * PAGE;
/// What to do, whether the progress counts, the progress there and back, and one word more: with
/// only as many as embassy-boot asks for, it takes progress that does not count for one page less
/// than all.
const STATE: usize = (2 + 4 * PAGES + 1) * WORD;
/// Where the partitions begin.
const UPDATE: usize = IMAGE;
const STATE_AT: usize = UPDATE + IMAGE + PAGE;

/// What becomes of an operation.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mishap {
    /// The power fails in its middle, and nothing happens until it is back.
    Cut { seed: u64 },
    /// It does nothing, once.
    Fails,
    /// From it on each does nothing.
    Broken,
}

/// Several partitions, which fail together.
struct Flash {
    bytes: Vec<u8>,
    operations: usize,
    mishap: Option<(usize, Mishap)>,
    is_off: bool,
}

#[derive(Debug)]
struct Failure;

impl NorFlashError for Failure {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Flash {
    /// Writes a word, or erases what is there.
    fn operate(&mut self, at: usize, length: usize, word: Option<&[u8]>) -> Result<(), Failure> {
        let number = self.operations;
        self.operations += 1;
        let mishap = self
            .mishap
            .filter(|(at, mishap)| number == *at || (number > *at && *mishap == Mishap::Broken));
        let bytes = &mut self.bytes[at..at + length];
        match mishap {
            _ if self.is_off => return Err(Failure),
            Some((_, Mishap::Cut { seed })) => {
                self.is_off = true;
                tear(bytes, word, seed);
                return Err(Failure);
            }
            Some(_) => return Err(Failure),
            None => {}
        }
        match word {
            Some(word) => {
                let is_mended = word.iter().all(|byte| *byte == 0);
                assert!(is_mended || bytes.iter().all(|byte| *byte == 0xFF), "not erased");
                bytes.iter_mut().zip(word).for_each(|(byte, new)| *byte &= new);
            }
            None => bytes.fill(0xFF),
        }
        Ok(())
    }
}

/// As the virtual board does it: an erasure sets bits, each in its own time, a word clears them.
/// Words of which the error-correcting code can make nothing read as zeros.
fn tear(bytes: &mut [u8], word: Option<&[u8]>, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    let hidden = seed.is_multiple_of(2);
    for old in bytes.chunks_mut(WORD) {
        let is_erased = old.iter().all(|byte| *byte == 0xFF);
        let is_hidden = hidden && (word.is_some() || (!is_erased && random.bool()));
        for (at, byte) in old.iter_mut().enumerate() {
            *byte = match word {
                _ if is_hidden => 0,
                Some(word) => *byte & (word[at] | random.u8(..)),
                None => *byte | random.u8(..),
            };
        }
    }
}

/// Whole pages of it.
#[derive(Clone, Copy)]
struct Part<'a, const ERASE: usize> {
    flash: &'a RefCell<Flash>,
    at: usize,
    length: usize,
}

impl<const ERASE: usize> ErrorType for Part<'_, ERASE> {
    type Error = Failure;
}

impl<const ERASE: usize> ReadNorFlash for Part<'_, ERASE> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        let at = self.at + offset as usize;
        bytes.copy_from_slice(&self.flash.borrow().bytes[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.length
    }
}

impl<const ERASE: usize> NorFlash for Part<'_, ERASE> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = ERASE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        for offset in (from..to).step_by(ERASE) {
            self.flash.borrow_mut().operate(self.at + offset as usize, ERASE, None)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        for (at, word) in (self.at + offset as usize..).step_by(WORD).zip(bytes.chunks(WORD)) {
            self.flash.borrow_mut().operate(at, WORD, Some(word))?;
        }
        Ok(())
    }
}

/// An image, of which each word is another.
fn image(name: u8) -> Vec<u8> {
    let words = (0..).take(PAGES * PAGE / WORD);
    words.flat_map(|number: u8| [name].into_iter().chain([number ^ name; WORD - 1])).collect()
}

const OLD: u8 = b'a';
const NEW: u8 = b'b';

/// A board with an old image, and a new one beside it.
struct Board {
    flash: RefCell<Flash>,
    /// The new image confirms itself.
    confirms: bool,
}

impl Board {
    fn new(mishap: Option<(usize, Mishap)>, confirms: bool) -> Self {
        let mut bytes = [image(OLD), image(NEW)].concat();
        bytes.resize(STATE_AT + STATE, 0xFF);
        let flash = RefCell::new(Flash { bytes, operations: 0, mishap, is_off: false });
        Self { flash, confirms }
    }

    fn part<const ERASE: usize>(&self, at: usize, length: usize) -> Part<'_, ERASE> {
        Part { flash: &self.flash, at, length }
    }

    /// As the running image does it; whether it came to its end.
    fn mark(&self, mark: impl Fn(&mut BlockingFirmwareState<'_, Part<'_, STATE>>) -> bool) -> bool {
        let mut word = [0; WORD];
        mark(&mut BlockingFirmwareState::new(self.part(STATE_AT, STATE), &mut word))
    }

    fn state(&self) -> State {
        let mut word = [0; WORD];
        let state =
            BlockingFirmwareState::new(self.part::<STATE>(STATE_AT, STATE), &mut word).get_state();
        state.expect("it can be read")
    }

    fn start(&self) -> Next {
        self.flash.borrow_mut().is_off = false;
        let active = self.part::<PAGE>(0, IMAGE);
        let update = self.part::<PAGE>(UPDATE, IMAGE + PAGE);
        let mut partitions =
            Partitions { active, update, state: self.part::<STATE>(STATE_AT, STATE) };
        let has_image = || [OLD, NEW].contains(&self.flash.borrow().bytes[0]);
        prepare(&mut partitions, &mut [0; WORD], || {}, has_image)
    }

    /// Starts until it runs an image, and which.
    fn run(&self) -> u8 {
        for _ in 0..2 {
            let next = self.start();
            if self.flash.borrow().is_off {
                continue;
            }
            assert_eq!(next, Next::Image);
            let active = self.flash.borrow().bytes[..IMAGE].to_vec();
            assert!(active == image(OLD) || active == image(NEW), "the images are mixed");
            return active[0];
        }
        panic!("there is one cut at most");
    }

    /// An update, of which the host sees the end: what runs then, for good.
    fn update(&self) -> u8 {
        // What the power has cut is asked for again.
        while self.run() == OLD && !self.mark(|state| state.mark_updated().is_ok()) {}
        // The trial.
        let mut runs = self.run();
        if self.confirms {
            while runs == NEW && !self.mark(|state| state.mark_booted().is_ok()) {
                runs = self.run();
            }
        }
        let (second, third) = (self.run(), self.run());
        assert_eq!(second, third, "what runs stays");
        assert_ne!(self.state(), State::Swap, "nothing waits");
        third
    }
}

/// How many operations an update has.
fn operations(confirms: bool) -> usize {
    let board = Board::new(None, confirms);
    assert_eq!(board.update(), if confirms { NEW } else { OLD });
    board.flash.borrow().operations
}

#[test]
fn a_cut_at_each_operation_leaves_an_image_that_starts_and_the_update_ends_as_it_would() {
    for confirms in [true, false] {
        let operations = operations(confirms);
        assert!(operations > 2 * PAGES * (1 + PAGE / WORD), "{operations}");
        for (operation, seed) in (0..operations).flat_map(|at| (0..16).map(move |seed| (at, seed)))
        {
            let board = Board::new(Some((operation, Mishap::Cut { seed })), confirms);
            let runs = board.update();
            // A trial that a cut ends is over: the image before runs again.
            assert!(runs == OLD || confirms, "{operation} of {operations}, seed {seed}");
        }
    }
}

#[test]
fn an_operation_that_fails_once_is_tried_again() {
    let marking = 3;
    for operation in marking..operations(false) {
        let board = Board::new(Some((operation, Mishap::Fails)), false);
        assert_eq!(board.update(), OLD, "{operation}");
        assert_eq!(board.flash.borrow().mishap.map(|(at, _)| at), Some(operation));
    }
}

#[test]
fn a_flash_that_is_broken_never_starts_mixed_images() {
    let (mut whole, mut later) = (0, 0);
    for operation in 3..operations(false) {
        let board = Board::new(Some((operation, Mishap::Broken)), false);
        assert_eq!(board.run(), OLD);
        assert!(board.mark(|state| state.mark_updated().is_ok()));
        for _ in 0..2 {
            let next = board.start();
            let active = board.flash.borrow().bytes[..IMAGE].to_vec();
            let is_whole = active == image(OLD) || active == image(NEW);
            match next {
                Next::Image => whole += usize::from(is_whole),
                next => {
                    assert_eq!(next, Next::Later);
                    later += 1;
                }
            }
            assert!(next != Next::Image || is_whole, "{operation}");
        }
    }
    assert!(whole > 0 && later > 0);
}

#[test]
fn an_image_that_is_none_is_taken_back_at_once() {
    let board = Board::new(None, true);
    board.flash.borrow_mut().bytes[UPDATE] = 0xFF;
    assert!(board.mark(|state| state.mark_updated().is_ok()));
    assert_eq!(board.run(), OLD);
    assert_eq!(board.state(), State::Revert);
}

#[test]
fn a_board_without_an_image_waits_for_one() {
    let board = Board::new(None, true);
    board.flash.borrow_mut().bytes.fill(0xFF);
    assert_eq!(board.start(), Next::NoImage);
    assert_eq!(board.flash.borrow().operations, 0);
}

#[test]
fn a_vector_table_is_that_of_an_image_or_not() {
    let is = |stack, entry| loader::is_image(stack, entry, 0x2000_0000..=0x2002_0000, 0x100..0x200);
    assert!(is(0x2002_0000, 0x101));
    assert!(!is(0x2002_0008, 0x101) && !is(0xFFFF_FFFF, 0xFFFF_FFFF) && !is(0, 0));
    assert!(!is(0x2000_0004, 0x101), "aligned to 8");
    assert!(!is(0x2002_0000, 0x100), "Thumb");
    assert!(!is(0x2002_0000, 0x201), "outside");
}
