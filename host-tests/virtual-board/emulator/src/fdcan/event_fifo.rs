//! The transmit event FIFO: what was sent, by marker, in order.

use rigless::chip::can::Frame;
use serde::{Deserialize, Serialize};

use super::element::{self, EVENT_WORDS, EventType};
use super::interrupts::Interrupts;
use super::registers::{count, ir};
use crate::message_ram::MessageRam;

/// Most entries.
const MAX_ENTRIES: usize = 32;

/// The registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EventFifo {
    /// TXEFC.
    pub config: u32,
    put: usize,
    get: usize,
    fill: usize,
}

impl EventFifo {
    /// After a reset.
    pub const RESET: Self = Self { config: 0, put: 0, get: 0, fill: 0 };

    fn size(&self) -> usize {
        count(self.config, 16, 6).min(MAX_ENTRIES)
    }

    fn is_full(&self) -> bool {
        self.size() > 0 && self.fill == self.size()
    }

    /// CCE was set: TXEFS starts anew.
    pub fn restart(&mut self) {
        *self = Self { config: self.config, ..Self::RESET };
    }

    /// Stores an event. False if it lies beyond the end of the RAM.
    pub fn store(
        &mut self,
        ram: &MessageRam,
        sent: &Frame,
        marker: u8,
        kind: EventType,
        timestamp: u16,
        interrupts: &mut Interrupts,
    ) -> bool {
        let size = self.size();
        if size == 0 || self.is_full() {
            interrupts.raise(ir::TEFL);
            return true;
        }
        let start = count(self.config, 2, 14) + self.put * EVENT_WORDS;
        self.put = (self.put + 1) % size;
        self.fill += 1;
        interrupts.raise(ir::TEFN);
        if self.fill == count(self.config, 24, 6) {
            interrupts.raise(ir::TEFW);
        }
        if self.is_full() {
            interrupts.raise(ir::TEFF);
        }
        element::store_event(ram, start, sent, marker, kind, timestamp)
    }

    /// TXEFA is written: everything up to and with this entry has been read.
    pub fn acknowledge(&mut self, written: u32) {
        let (size, index) = (self.size(), count(written, 0, 5));
        if index >= size || self.fill == 0 {
            return;
        }
        let read = (index + size - self.get) % size + 1;
        self.fill -= read.min(self.fill);
        self.get = (index + 1) % size;
    }

    /// TXEFS; TEFL stands as long as the flag in IR.
    #[must_use]
    pub fn status(&self, interrupts: &Interrupts) -> u32 {
        let bits = |value: usize| u32::try_from(value).expect("at most 32");
        bits(self.fill)
            | bits(self.get) << 8
            | bits(self.put) << 16
            | u32::from(self.is_full()) << 24
            | u32::from(interrupts.flags & ir::TEFL != 0) << 25
    }
}
