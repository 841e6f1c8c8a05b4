//! Reception: the two FIFOs, the dedicated buffers, the report of high-priority frames.

use rigless::chip::can::Frame;
use serde::{Deserialize, Serialize};

use super::element;
use super::filter::{Filters, Place, Verdict};
use super::interrupts::Interrupts;
use super::registers::{count, element_words, field, ir};
use crate::message_ram::MessageRam;

/// Receive FIFOs of a controller.
pub const FIFOS: usize = 2;
/// Most elements of a FIFO.
const MAX_FIFO: usize = 64;

/// HPMS.MSI: where a high-priority frame went.
const STORED_NOWHERE: u32 = 0b00;
const LOST: u32 = 0b01;
const STORED_IN_FIFO_0: u32 = 0b10;

/// What keeps the model from storing a frame as it should.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoreError {
    /// The element lies beyond the end of the message RAM.
    BeyondRam,
    /// A message of the debug unit.
    Debug,
}

/// One receive FIFO.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fifo {
    /// RXFnC.
    pub config: u32,
    put: usize,
    get: usize,
    fill: usize,
}

/// What became of a frame for a FIFO.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stored {
    At(usize),
    Lost,
}

impl Fifo {
    fn size(&self) -> usize {
        count(self.config, 16, 7).min(MAX_FIFO)
    }

    fn watermark(&self) -> usize {
        count(self.config, 24, 7)
    }

    fn overwrites(&self) -> bool {
        field(self.config, 31, 1) == 1
    }

    fn is_full(&self) -> bool {
        self.size() > 0 && self.fill == self.size()
    }

    /// Takes a place for a frame; the flags in the position of FIFO 0.
    fn take_place(&mut self) -> (Stored, u32) {
        let size = self.size();
        if size == 0 || self.is_full() && !self.overwrites() {
            return (Stored::Lost, ir::RF0L);
        }
        if self.is_full() {
            self.get = (self.get + 1) % size;
            self.fill -= 1;
        }
        let place = self.put;
        self.put = (self.put + 1) % size;
        self.fill += 1;
        let mut flags = ir::RF0N;
        if self.fill == self.watermark() {
            flags |= ir::RF0W;
        }
        if self.is_full() {
            flags |= ir::RF0F;
        }
        (Stored::At(place), flags)
    }

    /// RXFnA is written: everything up to and with this element has been read.
    fn acknowledge(&mut self, index: usize) {
        let size = self.size();
        if index >= size || self.fill == 0 {
            return;
        }
        let read = (index + size - self.get) % size + 1;
        self.fill -= read.min(self.fill);
        self.get = (index + 1) % size;
    }

    /// RXFnS, without RFnL.
    fn status(&self) -> u32 {
        let bits = |value: usize| u32::try_from(value).expect("at most 64");
        bits(self.fill)
            | bits(self.get) << 8
            | bits(self.put) << 16
            | u32::from(self.is_full()) << 24
    }
}

/// The registers of reception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receiver {
    /// The FIFOs.
    pub fifos: [Fifo; FIFOS],
    /// The filters.
    pub filters: Filters,
    /// RXBC.
    pub buffers: u32,
    /// RXESC.
    pub element_sizes: u32,
    /// NDAT2 and NDAT1.
    new_data: u64,
    /// HPMS.
    high_priority: u32,
}

impl Receiver {
    /// After a reset.
    pub const RESET: Self = Self {
        fifos: [Fifo { config: 0, put: 0, get: 0, fill: 0 }; FIFOS],
        filters: Filters::RESET,
        buffers: 0,
        element_sizes: 0,
        new_data: 0,
        high_priority: 0,
    };

    /// CCE was set: HPMS and the states of the FIFOs start anew.
    pub fn restart(&mut self) {
        self.high_priority = 0;
        self.fifos = self.fifos.map(|fifo| Fifo { config: fifo.config, ..Fifo::default() });
    }

    /// A frame arrived whose start was at `timestamp`.
    pub fn receive(
        &mut self,
        ram: &MessageRam,
        frame: &Frame,
        timestamp: u16,
        interrupts: &mut Interrupts,
    ) -> Result<(), StoreError> {
        let verdict = self.filters.judge(ram, frame, self.new_data);
        let mut stored = None;
        let start = match verdict.place {
            Place::Nowhere => None,
            Place::Debug => return Err(StoreError::Debug),
            Place::Fifo(index) => {
                let fifo = &mut self.fifos[index];
                let (place, flags) = fifo.take_place();
                interrupts.raise(flags << (ir::RX_FIFO_SHIFT * u32::from(index == 1)));
                stored = Some((index, place));
                match place {
                    Stored::Lost => None,
                    Stored::At(place) => {
                        let words = element_words(self.element_sizes >> (4 * index));
                        Some(count(fifo.config, 2, 14) + place * words)
                    }
                }
            }
            Place::Buffer(buffer) => {
                self.new_data |= 1 << buffer;
                interrupts.raise(ir::DRX);
                Some(count(self.buffers, 2, 14) + buffer * element_words(self.element_sizes >> 8))
            }
        };
        if verdict.priority {
            self.report_priority(&verdict, stored, frame.id.is_extended());
            interrupts.raise(ir::HPM);
        }
        match start {
            Some(start)
                if !element::store_received(ram, start, frame, verdict.filter, timestamp) =>
            {
                Err(StoreError::BeyondRam)
            }
            _ => Ok(()),
        }
    }

    fn report_priority(
        &mut self,
        verdict: &Verdict,
        stored: Option<(usize, Stored)>,
        extended: bool,
    ) {
        let (indicator, place) = match stored {
            None => (STORED_NOWHERE, 0),
            Some((_, Stored::Lost)) => (LOST, 0),
            Some((fifo, Stored::At(place))) => (STORED_IN_FIFO_0 + u32::from(fifo == 1), place),
        };
        let place = u32::try_from(place).expect("at most 64");
        self.high_priority = u32::from(extended) << 15
            | u32::from(verdict.filter.unwrap_or(0)) << 8
            | indicator << 6
            | place;
    }

    /// RXFnS; RFnL stands as long as the flag in IR.
    #[must_use]
    pub fn fifo_status(&self, fifo: usize, interrupts: &Interrupts) -> u32 {
        let lost = interrupts.flags >> (ir::RX_FIFO_SHIFT * u32::from(fifo == 1)) & ir::RF0L != 0;
        self.fifos[fifo].status() | u32::from(lost) << 25
    }

    /// RXFnA is written.
    pub fn acknowledge(&mut self, fifo: usize, written: u32) {
        self.fifos[fifo].acknowledge(count(written, 0, 6));
    }

    /// NDAT1, NDAT2: `half` 0 or 1.
    #[must_use]
    pub fn new_data(&self, half: u32) -> u32 {
        u32::try_from(self.new_data >> (32 * half) & u64::from(u32::MAX)).expect("32 bits")
    }

    /// NDAT1 or NDAT2 is written: every 1 clears.
    pub fn clear_new_data(&mut self, half: u32, written: u32) {
        self.new_data &= !(u64::from(written) << (32 * half));
    }

    /// HPMS.
    #[must_use]
    pub fn high_priority(&self) -> u32 {
        self.high_priority
    }
}
