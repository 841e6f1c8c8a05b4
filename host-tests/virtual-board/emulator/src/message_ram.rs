//! The message RAM that the FDCAN controllers share: 2560 words at 0x4000_AC00.
//!
//! Source: stm32-metapac 21 (`FDCANRAM` at 0x4000_AC00) and RM0433's 10 Kbyte. The controllers
//! reach the same words through a clone of [`MessageRam`]; the processor reaches them through
//! [`MessageRamWindow`].
//!
//! On revision Y the processor can read wrong words while both controllers run (ES0392). How often,
//! and what, no source says: here it is every seventh word, which reads as the one before it.

use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use rigless::device::{DeviceContext, ErasedDevice, RegisterFile, RequestChange};
use rigless::snapshot::{Error, Reader, Store, Writer};
use rigless::soc::{Gate, RegisterSpec, Width, Window};
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

/// Words of the RAM.
pub const WORDS: usize = 2560;
/// Where the processor finds it.
pub const BASE: u64 = 0x4000_AC00;
/// Its name on the bus.
pub const NAME: &str = "FDCAN_RAM";
/// Bytes of a word.
const WORD_BYTES: u64 = 4;
/// Its size in bytes.
const SIZE: NonZeroU64 = NonZeroU64::new(WORDS as u64 * WORD_BYTES).expect("not empty");

/// The words. Clones reach the same words.
#[derive(Debug, Clone)]
pub struct MessageRam(Arc<[AtomicU32]>);

impl MessageRam {
    /// All zero. After power-on the part's RAM holds anything; a model must choose.
    #[must_use]
    pub fn new() -> Self {
        Self((0..WORDS).map(|_| AtomicU32::new(0)).collect())
    }

    /// The word at `index`, or `None` beyond the end.
    #[must_use]
    pub fn word(&self, index: usize) -> Option<u32> {
        self.0.get(index).map(|word| word.load(Ordering::Relaxed))
    }

    /// Sets the word at `index`; false beyond the end.
    #[must_use]
    pub fn set_word(&self, index: usize, value: u32) -> bool {
        self.0.get(index).map(|word| word.store(value, Ordering::Relaxed)).is_some()
    }
}

impl Default for MessageRam {
    fn default() -> Self {
        Self::new()
    }
}

impl Store for MessageRam {
    fn store(&self, to: &mut Writer) -> Result<(), Error> {
        let words: Vec<u32> = self.0.iter().map(|word| word.load(Ordering::Relaxed)).collect();
        to.put(&words)
    }

    fn load(&mut self, from: &mut Reader) -> Result<(), Error> {
        let words: Vec<u32> = from.take()?;
        self.0.iter().zip(words).for_each(|(word, value)| word.store(value, Ordering::Relaxed));
        Ok(())
    }
}

/// Of so many words that the processor reads while it is disturbed, one is wrong. Prime to the
/// words of a frame.
const DISTURBED_PERIOD: u64 = 7;

/// What two controllers do to the reads of the processor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Disturbance {
    active: bool,
    reads: u64,
    /// The word that was read last.
    before: u32,
    wrong: u64,
}

impl Disturbance {
    fn read(&mut self, word: u32) -> u32 {
        let before = std::mem::replace(&mut self.before, word);
        self.reads += u64::from(self.active);
        if self.active && self.reads.is_multiple_of(DISTURBED_PERIOD) {
            self.wrong += u64::from(before != word);
            return before;
        }
        word
    }
}

/// The RAM as the processor's bus reaches it.
#[derive(Debug)]
pub struct MessageRamWindow {
    words: MessageRam,
    layout: &'static [RegisterSpec],
    disturbance: Disturbance,
}

impl Store for MessageRamWindow {
    fn store(&self, to: &mut Writer) -> Result<(), Error> {
        to.put(&self.disturbance)
    }

    fn load(&mut self, from: &mut Reader) -> Result<(), Error> {
        self.disturbance = from.take()?;
        Ok(())
    }
}

impl MessageRamWindow {
    /// The window to add to the part's bus: it answers while the FDCAN's clock is on.
    #[must_use]
    pub const fn window() -> Window {
        Window::new(NAME, BASE, SIZE).gated(Gate::by("RCC", "APB1HENR", "FDCANEN"))
    }

    /// Over `words`, for the slot whose table is `layout`.
    #[must_use]
    pub fn new(words: MessageRam, layout: &'static [RegisterSpec]) -> Self {
        Self { words, layout, disturbance: Disturbance::default() }
    }

    /// Whether the reads of the processor are disturbed from now on.
    pub fn disturb(&mut self, active: bool) {
        self.disturbance.active = active;
    }

    /// How many words the processor has read wrong.
    #[must_use]
    pub fn wrong_reads(&self) -> u64 {
        self.disturbance.wrong
    }

    fn word_at(&self, offset: u64) -> u32 {
        usize::try_from(offset / WORD_BYTES)
            .ok()
            .and_then(|index| self.words.word(index))
            .unwrap_or(0)
    }
}

/// What a device does that is a window to RAM and nothing else: it has no registers.
macro_rules! without_registers {
    () => {
        fn read(
            &mut self,
            _: usize,
            _: &mut RegisterFile,
            _: &mut DeviceContext<'_>,
        ) -> Option<u64> {
            None
        }

        fn write(&mut self, _: usize, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

        fn on_event(&mut self, _: EventId, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

        fn on_request(
            &mut self,
            _: RequestChange,
            _: &mut RegisterFile,
            _: &mut DeviceContext<'_>,
        ) {
        }

        fn on_clock(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

        fn poll(&mut self, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

        /// A system reset leaves RAM as it is.
        fn reset(&mut self) {}

        fn on_access(&mut self, _: u64, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

        fn on_refused(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}
    };
}
pub(crate) use without_registers;

impl ErasedDevice for MessageRamWindow {
    fn layout(&self) -> &'static [RegisterSpec] {
        self.layout
    }

    without_registers!();

    fn read_window(&mut self, offset: u64, width: Width, context: &mut DeviceContext<'_>) -> u64 {
        if width != Width::W32 {
            context.tell(NAME, "read otherwise than as a word");
        }
        let word = self.disturbance.read(self.word_at(offset));
        u64::from(word) >> (offset % WORD_BYTES * 8)
    }

    fn write_window(
        &mut self,
        offset: u64,
        width: Width,
        value: u64,
        context: &mut DeviceContext<'_>,
    ) {
        let word = usize::try_from(offset / WORD_BYTES).ok().zip(u32::try_from(value).ok());
        match (width, word) {
            (Width::W32, Some((index, value))) if self.words.set_word(index, value) => {}
            _ => context.tell(NAME, "written otherwise than as a word"),
        }
    }

    fn peek_window(&self, offset: u64, _: Width, _: VirtualNanos) -> Option<u64> {
        Some(u64::from(self.word_at(offset)) >> (offset % WORD_BYTES * 8))
    }
}
