//! Starts of the gateway, what it keeps over a reset, and from when on it hears its hosts.

use super::World;
use super::ports::Input;
use super::storage::Storage;
use crate::action::{Action, Ask};
use crate::plant::{BOARD, BOARD_AGAIN, LISTENER};
use gateway::{Board, Gateway, Instant, RETAINED_WORDS, Set};
use std::fmt::{Result, Write};

/// The firmware opens its host links at the latest so long after a start, µs.
const LINKS_OPEN_AFTER_US: u64 = 100_000;
/// What is in memory that was never written.
const NEVER_WRITTEN: u32 = 0xA5A5_A5A5;

/// What the random generator gives at the first start, shortly before epochs wrap around, and from
/// one start to the next.
pub const FIRST_RANDOM_NUMBER: u32 = u32::MAX - 40;
const RANDOM_STEP: u32 = 0x9E37_79B9;

/// To a reset of the processor.
#[derive(Debug, Clone, Copy)]
pub enum Countdown {
    /// With the last of so many words stored, which is garbage or not.
    Words { left: u32, garbles: bool },
    /// After so many steps of those that follow from events.
    Steps { left: u32 },
}

/// The life of the board.
#[derive(Clone)]
pub struct Life {
    /// Words that outlive a reset.
    memory: Vec<u32>,
    /// When the host links are opened at the latest, as long as they are closed.
    links_open_by: Option<u64>,
    /// What the random generator gave at the latest start.
    random_number: u32,
    countdown: Option<Countdown>,
    is_suspended: bool,
    e_stop_open: bool,
    /// The words that the latest event has stored, and those of the latest e-stop.
    stored: Vec<usize>,
    latched: Vec<usize>,
    pub storage: Storage,
}

impl Life {
    pub fn new() -> Self {
        Self {
            memory: vec![NEVER_WRITTEN; RETAINED_WORDS],
            links_open_by: None,
            random_number: FIRST_RANDOM_NUMBER,
            countdown: None,
            is_suspended: false,
            e_stop_open: false,
            stored: Vec::new(),
            latched: Vec::new(),
            storage: Storage::default(),
        }
    }

    /// The words that outlive a reset.
    pub fn memory(&self) -> &[u32] {
        &self.memory
    }

    /// Writes all but the [memory](Self::memory).
    pub fn write_state(&self, to: &mut impl Write) -> Result {
        let Self {
            memory: _,
            links_open_by,
            random_number,
            countdown,
            is_suspended,
            e_stop_open,
            stored: _,
            latched,
            storage,
        } = self;
        storage.write_state(to)?;
        write!(
            to,
            "{links_open_by:?} {random_number} {countdown:?} {is_suspended} {e_stop_open} {latched:?}"
        )
    }

    pub fn links_open_by(&self) -> Option<u64> {
        self.links_open_by
    }

    pub fn reset_after(&mut self, countdown: Countdown) {
        self.countdown = Some(countdown);
    }

    /// Whether a configuration was stored that nobody has been told of, the model cannot know: as
    /// long as one waits for its answer, no reset interrupts it.
    pub fn suspend_reset(&mut self, is_configuring: bool) {
        self.is_suspended = is_configuring;
    }

    /// Puts words into the memory, each a step.
    pub fn store(&mut self) -> impl FnMut(usize, u32) {
        |index, word| {
            let is_garbled =
                matches!(self.countdown, Some(Countdown::Words { left: 1, garbles: true }));
            if self.takes_step(true) {
                self.stored.push(index);
                self.memory[index] = if is_garbled && !self.is_suspended { !word } else { word };
            }
        }
    }

    /// Whether one of the steps that follow from an event is taken, in their order: a word stored,
    /// a frame handed over or asked back, a host told. If not, the reset came first.
    pub fn takes_step(&mut self, is_word: bool) -> bool {
        let left = match &mut self.countdown {
            Some(Countdown::Words { left, .. }) if is_word || *left == 0 => left,
            Some(Countdown::Steps { left }) => left,
            _ => return true,
        };
        if self.is_suspended {
            return true;
        }
        let is_taken = *left > 0;
        *left = left.saturating_sub(1);
        is_taken
    }

    /// Whether the reset has come.
    pub fn is_reset(&self) -> bool {
        let is_over = matches!(
            self.countdown,
            Some(Countdown::Words { left: 0, .. } | Countdown::Steps { left: 0 })
        );
        is_over && !self.is_suspended
    }

    pub fn set_e_stop(&mut self, open: bool) {
        self.e_stop_open = open;
    }

    /// The words that were stored with the latest event are those of an e-stop, or not.
    pub fn stored(&mut self, latches: bool) {
        let stored = std::mem::take(&mut self.stored);
        if !stored.is_empty() {
            self.latched = if latches { stored } else { Vec::new() };
        }
    }

    /// Damages so many words of those that the latest e-stop stored: whether there were any.
    pub fn damage(&mut self, words: u8) -> bool {
        let damaged = self.latched.iter().rev().take(words.max(1).into());
        damaged.clone().for_each(|index| self.memory[*index] ^= 1 << 7);
        damaged.count() > 0
    }
}

impl World {
    /// The watchdog resets the gateway; `interrupted`: before it could say what it has taken in
    /// last.
    pub(super) fn reset(&mut self, interrupted: bool) {
        self.cut_storing();
        self.note(|| "the watchdog resets the gateway".into());
        self.oracle.reset(self.now_us, interrupted);
        self.start(&BOARD_AGAIN, true);
    }

    /// The watchdog resets the gateway, and what the latest e-stop has written is damaged or not.
    pub(super) fn reset_damaged(&mut self, damaged: bool) {
        self.cut_storing();
        self.note(|| format!("the watchdog resets the gateway, its memory damaged: {damaged}"));
        self.oracle.reset(self.now_us, false);
        self.start(&BOARD_AGAIN, true);
    }

    pub(super) fn lose_power(&mut self) {
        self.cut_storing();
        self.note(|| "the gateway loses its power".into());
        self.oracle.power_lost(self.now_us);
        // Who sets it up again begins anew, too.
        self.epochs.fill(0);
        self.start(&BOARD, false);
    }

    /// The gateway starts. The motors go on; what they answer meanwhile is not heard.
    fn start(&mut self, board: &'static Board, keeps: bool) {
        self.life.random_number = self.life.random_number.wrapping_add(RANDOM_STEP);
        *self.gateway = Gateway::new(board, Some(self.life.random_number));
        self.named = Set::ALL;
        self.inputs.clear();
        for bus in &mut self.buses {
            bus.forget();
            bus.is_not_heard();
            bus.generation = None;
        }
        self.life.countdown = None;
        self.life.links_open_by = Some(self.now_us + LINKS_OPEN_AFTER_US);
        let words: &[u32] = if keeps { &self.life.memory } else { &[] };
        let now = Instant::from_micros(self.now_us);
        self.gateway.restore(now, words);
        self.life.storage.load(now, &mut self.gateway);
        if !keeps {
            self.life.memory.fill(NEVER_WRITTEN);
        }
        self.counts.starts += 1;
        self.feed(Input::Pin { open: self.life.e_stop_open });
    }

    /// Opens the host links when the stops after a start have left, or could have: whether it did.
    /// The host that listens asks first how everything is.
    pub(super) fn open_links(&mut self) -> bool {
        let Some(by) = self.life.links_open_by else { return false };
        if self.gateway.stops_under_way() && self.now_us < by {
            return false;
        }
        self.life.links_open_by = None;
        for ask in [
            Ask::Hello,
            Ask::Status,
            Ask::List,
            Ask::Incidents { first: 0 },
            Ask::Incidents { first: 8 },
        ] {
            self.act(&Action::Ask { link: LISTENER, ask });
        }
        true
    }
}
