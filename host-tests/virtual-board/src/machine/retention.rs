//! What the RAM that start-up leaves alone holds after a reset: everything but the last write.
//!
//! The RAM of this part computes its check bits when it is written, and a write waits for the next
//! one to the same RAM before it is carried out: one that a reset overtakes is lost (RM0433 §2.4
//! says so of incomplete words). The model is stricter than the part, and loses a whole word as
//! well. After power-on the RAM holds anything.

use rigless::emulator::{Host, Watch};
use rigless::soc::Width;
use serde::{Deserialize, Serialize};

use crate::board::RetainedRam;

/// Bytes of a word, which has check bits of its own.
const WORD_BYTES: u64 = 4;
/// One instruction stores at most 32 words (VSTM of sixteen double words).
const MOST_WORDS: u64 = 32;

/// The RAM with the write that still waits.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Retention {
    ram: RetainedRam,
    /// Every word as written.
    words: Vec<u32>,
    /// The last word that was written, and what was there before.
    waiting: Option<(u64, u32)>,
}

impl Retention {
    /// All zero.
    pub(crate) fn new(ram: RetainedRam) -> Self {
        Self { ram, words: vec![0; index(ram.bytes)], waiting: None }
    }

    /// What reports each write to it.
    pub(crate) fn watch(ram: RetainedRam) -> Watch {
        Watch::Writes { address: ram.base, length: ram.bytes }
    }

    /// Whether an address is in it.
    pub(crate) fn holds(&self, address: u64) -> bool {
        address.checked_sub(self.ram.base).is_some_and(|offset| offset < self.ram.bytes)
    }

    /// The supply has come: anything may be in it, the same in each run.
    pub(crate) fn power_up(&mut self, host: &mut dyn Host) {
        self.waiting = None;
        let mut noise = fastrand::Rng::with_seed(1);
        for (offset, word) in (0..).step_by(4).zip(&mut self.words) {
            *word = noise.u32(..);
            write(host, self.ram.base + offset, *word);
        }
    }

    /// The core has stored there.
    pub(crate) fn written(&mut self, address: u64, host: &mut dyn Host) {
        let first = (address - self.ram.base) / WORD_BYTES * WORD_BYTES;
        let mut waiting = (first, self.words[index(first)]);
        let end = (first + MOST_WORDS * WORD_BYTES).min(self.ram.bytes);
        for offset in (first..end).step_by(4) {
            let (before, now) = (self.words[index(offset)], read(host, self.ram.base + offset));
            if before != now {
                waiting = (offset, before);
                self.words[index(offset)] = now;
            }
        }
        self.waiting = self.ram.loses_last_write.then_some(waiting);
    }

    /// The part was reset: what waited is lost.
    pub(crate) fn reset(&mut self, host: &mut dyn Host) {
        if let Some((offset, before)) = self.waiting.take() {
            self.words[index(offset)] = before;
            write(host, self.ram.base + offset, before);
        }
    }
}

fn index(offset: u64) -> usize {
    usize::try_from(offset / WORD_BYTES).expect("inside the RAM")
}

fn read(host: &mut dyn Host, address: u64) -> u32 {
    let word = host.read(address, Width::W32).expect("the part has this RAM");
    u32::try_from(word).expect("a word")
}

fn write(host: &mut dyn Host, address: u64, word: u32) {
    host.write(address, Width::W32, word.into()).expect("the part has this RAM");
}
