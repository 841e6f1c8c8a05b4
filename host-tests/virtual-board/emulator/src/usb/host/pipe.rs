//! A bulk endpoint as the host keeps it.

use std::collections::VecDeque;
use std::time::Duration;

use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use crate::usb::function::{Handshake, Toggle};

/// Bytes of the longest packet of a bulk or control endpoint at full speed.
pub const PACKET: u16 = 64;
/// How long the host waits after a NAK.
const NAK_PAUSE: u64 = 50_000;
/// Transactions without an answer, in a row, that end a transfer.
pub const MOST_ERRORS: u8 = 3;

/// A packet from the board.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Packet {
    /// When its acknowledgement ended.
    pub at: Duration,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// When an endpoint that has said NAK is asked again.
pub trait Retry {
    /// Whether it is asked now.
    fn due(self, now: VirtualNanos) -> bool;
    /// After a NAK that ended then.
    fn later(end: VirtualNanos) -> Self;
}

impl Retry for Option<VirtualNanos> {
    fn due(self, now: VirtualNanos) -> bool {
        self.is_none_or(|at| at <= now)
    }

    fn later(end: VirtualNanos) -> Self {
        Some(VirtualNanos(end.0 + NAK_PAUSE))
    }
}

/// The endpoint.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Pipe {
    /// Its number; 0 while it is not open.
    pub endpoint: u8,
    /// Of the next packet.
    pub toggle: Toggle,
    /// Packets to send.
    pub queue: VecDeque<Vec<u8>>,
    /// After a NAK: when it is tried again.
    pub retry: Option<VirtualNanos>,
    /// Transactions without an answer, in a row.
    pub errors: u8,
    /// Given up.
    pub halted: bool,
}

impl Pipe {
    /// Open, with DATA0 to come.
    pub fn new(endpoint: u8) -> Self {
        Self { endpoint, ..Self::default() }
    }

    /// Whether a transaction may begin.
    pub fn is_due(&self, now: VirtualNanos) -> bool {
        self.endpoint != 0 && !self.halted && self.retry.due(now)
    }

    /// The function has answered without bytes; the transaction ended then.
    pub fn answered(&mut self, end: VirtualNanos, answer: Handshake) {
        self.retry = None;
        self.errors = if answer == Handshake::NoResponse { self.errors + 1 } else { 0 };
        match answer {
            Handshake::Ack => {
                self.queue.pop_front();
                self.toggle = self.toggle.next();
            }
            Handshake::Nak => self.retry = Retry::later(end),
            Handshake::Stall => self.halted = true,
            Handshake::NoResponse => self.halted = self.errors == MOST_ERRORS,
        }
    }
}
