//! The controller itself: its state, its part in the bus, and what frames do to it.

mod joining;
mod processor;
mod receiver;
mod sender;

use rigless::snapshot::store;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

pub use self::joining::SEQUENCE_BITS;
use super::BitTime;
use super::errors::Errors;
use super::event_fifo::EventFifo;
use super::interrupts::Interrupts;
use super::registers::{cccr, field, ir, reset};
use super::rx::Receiver;
use super::timestamp::Timestamp;
use super::tx::Transmitter;
use crate::message_ram::MessageRam;

/// Sequences that a controller which went bus-off waits for.
const RECOVERY_SEQUENCES: u16 = 129;

/// Whether the controller takes part in the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Presence {
    /// INIT is set.
    Off,
    /// INIT is clear; the line must have been recessive for so many sequences more, counted from an
    /// instant on.
    Waiting {
        /// Sequences still to come.
        left: u16,
        /// The end of the last one, or when INIT was cleared.
        since: VirtualNanos,
    },
    /// Yes.
    On,
}

/// What the controller does on the bus: the codes of PSR.ACT.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activity {
    /// Waiting for the bus to be idle, or off.
    Synchronizing = 0b00,
    /// Neither sender nor receiver.
    Idle = 0b01,
    /// Receiving.
    Receiver = 0b10,
    /// Sending.
    Transmitter = 0b11,
}

/// What the controller could not do as the part does.
pub type Untold = (&'static str, &'static str);

/// The registers and state that are kept by value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Kept {
    cccr: u32,
    nbtp: u32,
    dbtp: u32,
    test: u32,
    rwd: u32,
    tocc: u32,
    tdcr: u32,
    interrupts: Interrupts,
    errors: Errors,
    receiver: Receiver,
    transmitter: Transmitter,
    events: EventFifo,
    timestamp: Timestamp,
    presence: Presence,
    /// The buffer on the bus.
    sending: Option<usize>,
    /// Since when there has been something to send.
    ready: Option<VirtualNanos>,
    suspended_until: VirtualNanos,
}

impl Kept {
    const RESET: Self = Self {
        cccr: reset::CCCR,
        nbtp: reset::NBTP,
        dbtp: reset::DBTP,
        test: 0,
        rwd: 0,
        tocc: reset::TOCC,
        tdcr: 0,
        interrupts: Interrupts { flags: 0, enabled: 0, select: 0, line_enable: 0 },
        errors: Errors::RESET,
        receiver: Receiver::RESET,
        transmitter: Transmitter::RESET,
        events: EventFifo::RESET,
        timestamp: Timestamp::RESET,
        presence: Presence::Off,
        sending: None,
        ready: None,
        suspended_until: VirtualNanos(0),
    };
}

/// One controller.
#[derive(Debug)]
pub struct Controller {
    kept: Kept,
    /// The kernel clock.
    kernel_hz: u64,
    ram: MessageRam,
}

store!(Controller { values: [kept, kernel_hz], parts: [], built: [ram] });

impl Controller {
    /// Out of reset.
    pub fn new(ram: MessageRam) -> Self {
        Self { kept: Kept::RESET, kernel_hz: 0, ram }
    }

    /// A reset: of the part or of the controller alone. The kernel clock is another's.
    pub fn reset(&mut self) {
        self.kept = Kept::RESET;
    }

    /// The kernel clock changed.
    pub fn follow_clock(&mut self, now: VirtualNanos, hz: u64) {
        self.kernel_hz = hz;
        self.follow_bit(now);
    }

    /// The nominal bit, from NBTP and the kernel clock; `None` while that stands.
    pub fn bit(&self) -> Option<BitTime> {
        let nbtp = self.kept.nbtp;
        let prescaler = u64::from(field(nbtp, 16, 9)) + 1;
        let before_sample = u64::from(field(nbtp, 8, 8)) + 1;
        let after_sample = u64::from(field(nbtp, 0, 7)) + 1;
        BitTime::of_cycles(prescaler * (1 + before_sample + after_sample), self.kernel_hz)
    }

    fn follow_bit(&mut self, now: VirtualNanos) {
        let bit = self.bit();
        self.kept.timestamp.follow(now, bit);
    }

    fn is_set(&self, bit: u32) -> bool {
        self.kept.cccr & bit != 0
    }

    /// Whether it takes part in the bus.
    pub fn is_on(&self) -> bool {
        self.kept.presence == Presence::On
    }

    /// Whether it acknowledges what it receives: not when it only monitors.
    pub fn acknowledges(&self) -> bool {
        self.is_on() && !self.is_set(cccr::MON)
    }

    /// Whether it may send: not in restricted operation.
    pub fn may_send(&self) -> bool {
        self.acknowledges() && !self.is_set(cccr::ASM)
    }

    /// Whether its error flags destroy frames.
    pub fn is_error_active(&self) -> bool {
        self.may_send() && !self.kept.errors.passive()
    }

    /// Its sender has failed to reach the message RAM.
    pub fn restrict(&mut self) {
        self.kept.cccr |= cccr::ASM;
        self.kept.interrupts.raise(ir::MRAF);
    }

    /// The levels of its interrupt lines.
    pub fn lines(&self) -> [bool; 2] {
        self.kept.interrupts.lines()
    }
}
