//! Starts of the gateway, what it keeps over a reset, and from when on it hears its hosts.

use super::World;
use super::ports::Input;
use crate::action::{Action, Ask};
use crate::plant::{BOARD, BOARD_AGAIN, LISTENER};
use gateway::{Board, Gateway, Instant, RETAINED_WORDS};
use std::fmt::{Result, Write};

/// The firmware opens its host links at the latest so long after a start, µs.
const LINKS_OPEN_AFTER_US: u64 = 100_000;
/// What is in memory that was never written.
const NEVER_WRITTEN: u32 = 0xA5A5_A5A5;

/// The life of the board.
#[derive(Clone)]
pub struct Life {
    /// Words that outlive a reset.
    memory: Vec<u32>,
    /// When the host links are opened at the latest, as long as they are closed.
    links_open_by: Option<u64>,
    /// The processor is reset with the last of so many words saved, which is garbage or not.
    reset_after: Option<(u32, bool)>,
    e_stop_open: bool,
}

impl Life {
    pub fn new() -> Self {
        Self {
            memory: vec![NEVER_WRITTEN; RETAINED_WORDS],
            links_open_by: None,
            reset_after: None,
            e_stop_open: false,
        }
    }

    /// The words that outlive a reset.
    pub fn memory(&self) -> &[u32] {
        &self.memory
    }

    /// Writes all but the [memory](Self::memory).
    pub fn write_state(&self, to: &mut impl Write) -> Result {
        let Self { memory: _, links_open_by, reset_after, e_stop_open } = self;
        write!(to, "{links_open_by:?} {reset_after:?} {e_stop_open}")
    }

    pub fn links_open_by(&self) -> Option<u64> {
        self.links_open_by
    }

    pub fn reset_while_saving(&mut self, words: u32, garbles: bool) {
        self.reset_after = Some((words.max(1), garbles));
    }

    pub fn set_e_stop(&mut self, open: bool) {
        self.e_stop_open = open;
    }

    fn write(&mut self, index: usize, word: u32) {
        let Some((left, garbles)) = &mut self.reset_after else {
            self.memory[index] = word;
            return;
        };
        if *left == 0 {
            return;
        }
        *left -= 1;
        self.memory[index] = if *left == 0 && *garbles { !word } else { word };
    }
}

impl World {
    /// Keeps what the gateway wants to outlive a reset.
    pub(super) fn save(&mut self) {
        let Self { gateway, life, oracle, .. } = self;
        // Whether a configuration was kept that nobody has been told of, the model cannot know.
        let waits = life.reset_after.take_if(|_| oracle.is_configuring());
        gateway.save(|index, word| life.write(index, word));
        life.reset_after = waits.or(life.reset_after);
    }

    pub(super) fn is_reset_while_saving(&self) -> bool {
        matches!(self.life.reset_after, Some((0, _)))
    }

    /// The watchdog resets the gateway; `interrupted`: before it could say what it has taken in last.
    pub(super) fn reset(&mut self, interrupted: bool) {
        self.note(|| "the watchdog resets the gateway".into());
        self.oracle.reset(self.now_us, interrupted);
        self.start(&BOARD_AGAIN, true);
    }

    pub(super) fn lose_power(&mut self) {
        self.note(|| "the gateway loses its power".into());
        self.oracle.power_lost(self.now_us);
        // Who sets it up again begins anew, too.
        self.epochs.fill(0);
        self.start(&BOARD, false);
    }

    /// The gateway starts. The motors go on; what they answer meanwhile is not heard.
    fn start(&mut self, board: &'static Board, keeps: bool) {
        *self.gateway = Gateway::new(board);
        self.inputs.clear();
        for bus in &mut self.buses {
            bus.forget();
            bus.is_not_heard();
            bus.generation = None;
        }
        self.life.reset_after = None;
        self.life.links_open_by = Some(self.now_us + LINKS_OPEN_AFTER_US);
        let words: &[u32] = if keeps { &self.life.memory } else { &[] };
        self.gateway.restore(Instant::from_micros(self.now_us), words);
        if !keeps {
            self.life.memory.fill(NEVER_WRITTEN);
        }
        self.counts.starts += 1;
        self.feed(Input::Pin { open: self.life.e_stop_open });
    }

    /// Opens the host links when the stops after a start have left, or could have: whether it did. The host that listens asks first how everything is.
    pub(super) fn open_links(&mut self) -> bool {
        let Some(by) = self.life.links_open_by else { return false };
        if self.gateway.stops_under_way() && self.now_us < by {
            return false;
        }
        self.life.links_open_by = None;
        for ask in
            [Ask::Hello, Ask::Status, Ask::List, Ask::Incidents { first: 0 }, Ask::Incidents { first: 8 }]
        {
            self.act(&Action::Ask { link: LISTENER, ask });
        }
        true
    }
}
