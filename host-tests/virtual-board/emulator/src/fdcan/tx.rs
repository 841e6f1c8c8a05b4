//! Transmission: dedicated buffers, FIFO or queue, requests and cancellation.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use super::element::{self, Outgoing};
use super::registers::{count, element_words, field};
use crate::message_ram::MessageRam;

/// Buffers of a controller at most: one bit each in the registers.
pub const MAX_BUFFERS: usize = 32;

/// The registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Transmitter {
    /// TXBC.
    pub config: u32,
    /// TXESC.
    pub element_size: u32,
    /// TXBTIE.
    pub sent_interrupts: u32,
    /// TXBCIE.
    pub cancelled_interrupts: u32,
    /// TXBRP.
    pending: u32,
    /// TXBCR, until done.
    to_cancel: u32,
    /// TXBTO.
    sent: u32,
    /// TXBCF.
    cancelled: u32,
    /// Of the FIFO: elements from its start.
    put: usize,
    get: usize,
    fill: usize,
}

/// How an attempt to send ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attempt {
    /// Sent and acknowledged.
    Sent,
    /// Arbitration lost, or an error.
    Failed,
}

/// What has followed from a request or an attempt.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Outcome {
    /// TC is to be raised.
    pub completed: bool,
    /// TCF is to be raised.
    pub cancelled: bool,
    /// TFE is to be raised.
    pub fifo_empty: bool,
}

impl Transmitter {
    /// After a reset.
    pub const RESET: Self = Self {
        config: 0,
        element_size: 0,
        sent_interrupts: 0,
        cancelled_interrupts: 0,
        pending: 0,
        to_cancel: 0,
        sent: 0,
        cancelled: 0,
        put: 0,
        get: 0,
        fill: 0,
    };

    /// CCE was set: TXFQS, TXBRP, TXBTO and TXBCF start anew.
    pub fn restart(&mut self) {
        *self = Self {
            config: self.config,
            element_size: self.element_size,
            sent_interrupts: self.sent_interrupts,
            cancelled_interrupts: self.cancelled_interrupts,
            ..Self::RESET
        };
    }

    fn dedicated(&self) -> usize {
        count(self.config, 16, 6).min(MAX_BUFFERS)
    }

    /// Elements of the FIFO or queue.
    fn shared(&self) -> usize {
        count(self.config, 24, 6).min(MAX_BUFFERS - self.dedicated())
    }

    fn is_queue(&self) -> bool {
        field(self.config, 30, 1) == 1
    }

    fn exists(&self) -> u32 {
        mask(self.dedicated() + self.shared())
    }

    /// Whether anything is to be sent.
    #[must_use]
    pub fn is_pending(&self) -> bool {
        self.pending != 0
    }

    /// TXBAR is written. A request for a pending buffer is ignored. False if one for the FIFO does
    /// not stand at its put index, which the manual asks for.
    #[must_use]
    pub fn request(&mut self, written: u32) -> bool {
        let new = written & self.exists() & !self.pending;
        self.pending |= new;
        self.sent &= !new;
        self.cancelled &= !new;
        if self.is_queue() {
            return true;
        }
        let (first, size) = (self.dedicated(), self.shared());
        let mut left = new & !mask(first);
        while left != 0 && self.fill < size && left >> (first + self.put) & 1 == 1 {
            left &= !(1 << (first + self.put));
            self.put = (self.put + 1) % size;
            self.fill += 1;
        }
        left == 0
    }

    /// TXBCR is written; `sending`: the buffer that is on the bus now, which can be taken back only
    /// when its attempt has ended.
    pub fn cancel(&mut self, written: u32, sending: Option<usize>) -> Outcome {
        let wanted = written & self.exists();
        let on_bus = sending.map_or(0, |index| 1 << index) & self.pending;
        self.to_cancel |= wanted & on_bus;
        self.withdraw(wanted & !on_bus)
    }

    /// Takes requests back; also for buffers without one the end of the cancellation is reported.
    fn withdraw(&mut self, buffers: u32) -> Outcome {
        self.pending &= !buffers;
        self.to_cancel &= !buffers;
        self.cancelled |= buffers;
        let fifo_empty = self.advance_fifo();
        Outcome {
            completed: false,
            cancelled: buffers & self.cancelled_interrupts != 0,
            fifo_empty,
        }
    }

    /// Takes back what was to be taken back when it is no longer on the bus.
    pub fn left_bus(&mut self) -> Outcome {
        self.withdraw(self.to_cancel)
    }

    /// The buffer to send next, with its frame: of the dedicated ones and of the queue, or the head
    /// of the FIFO, the one that wins arbitration; of equals the one in the lowest buffer.
    ///
    /// # Errors
    ///
    /// If it lies beyond the end of the RAM.
    pub fn choose(&self, ram: &MessageRam) -> Result<Option<(usize, Outgoing)>, BeyondRam> {
        let mut best: Option<(usize, Outgoing)> = None;
        for index in (0..MAX_BUFFERS).filter(|index| self.pending >> index & 1 == 1) {
            let waits_in_fifo = !self.is_queue()
                && index >= self.dedicated()
                && index - self.dedicated() != self.get;
            if waits_in_fifo {
                continue;
            }
            let outgoing = self.frame(ram, index).ok_or(BeyondRam)?;
            if best.is_none_or(|(_, best)| outgoing.frame.arbitrates(&best.frame) == Ordering::Less)
            {
                best = Some((index, outgoing));
            }
        }
        Ok(best)
    }

    fn frame(&self, ram: &MessageRam, index: usize) -> Option<Outgoing> {
        let start = count(self.config, 2, 14) + index * element_words(self.element_size);
        element::outgoing(ram, start)
    }

    /// The marker with which an event is to be stored when the frame in a buffer has been sent.
    #[must_use]
    pub fn marker(&self, ram: &MessageRam, index: usize) -> Option<u8> {
        self.frame(ram, index)?.event_marker
    }

    /// Whether the buffer is to be cancelled while it is on the bus.
    #[must_use]
    pub fn is_to_cancel(&self, index: usize) -> bool {
        self.to_cancel >> index & 1 == 1
    }

    /// The attempt to send a buffer has ended; `once`: without another one (DAR).
    pub fn attempted(&mut self, index: usize, attempt: Attempt, once: bool) -> Outcome {
        let bit = 1 << index;
        let cancelled = self.is_to_cancel(index);
        match attempt {
            Attempt::Sent => {
                self.pending &= !bit;
                self.to_cancel &= !bit;
                self.sent |= bit;
                if cancelled {
                    self.cancelled |= bit;
                }
                let fifo_empty = self.advance_fifo();
                Outcome {
                    completed: self.sent_interrupts & bit != 0,
                    cancelled: cancelled && self.cancelled_interrupts & bit != 0,
                    fifo_empty,
                }
            }
            Attempt::Failed if cancelled || once => self.withdraw(bit),
            Attempt::Failed => Outcome::default(),
        }
    }

    /// Frees the head of the FIFO as far as nothing is pending there. True if that emptied it.
    fn advance_fifo(&mut self) -> bool {
        let (first, size) = (self.dedicated(), self.shared());
        let before = self.fill;
        while self.fill > 0 && self.pending >> (first + self.get) & 1 == 0 {
            self.get = (self.get + 1) % size;
            self.fill -= 1;
        }
        before > 0 && self.fill == 0
    }

    /// TXFQS.
    #[must_use]
    pub fn status(&self) -> u32 {
        let bits = |value: usize| u32::try_from(value).expect("at most 32");
        let (first, size) = (self.dedicated(), self.shared());
        if self.is_queue() {
            let free = (first..first + size).find(|index| self.pending >> index & 1 == 0);
            let full = size > 0 && free.is_none();
            return bits(free.unwrap_or(first)) << 16 | u32::from(full) << 21;
        }
        let full = size > 0 && self.fill == size;
        bits(size - self.fill)
            | bits(first + self.get) << 8
            | bits(first + self.put) << 16
            | u32::from(full) << 21
    }

    /// TXBRP.
    #[must_use]
    pub fn pending(&self) -> u32 {
        self.pending
    }

    /// TXBCR.
    #[must_use]
    pub fn cancel_requests(&self) -> u32 {
        self.to_cancel
    }

    /// TXBTO.
    #[must_use]
    pub fn sent(&self) -> u32 {
        self.sent
    }

    /// TXBCF.
    #[must_use]
    pub fn cancelled(&self) -> u32 {
        self.cancelled
    }
}

/// A buffer lies beyond the end of the message RAM.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BeyondRam;

/// The lowest `bits` bits.
fn mask(bits: usize) -> u32 {
    u32::try_from((1u64 << bits) - 1).expect("at most 32 bits")
}
