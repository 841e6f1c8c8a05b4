//! The computer's end of a host UART.

use std::collections::VecDeque;
use std::time::Duration;

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::store;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use crate::nodes::since_start;
use virtual_stm32::serial_port::{FarEnd, Settings};

/// A byte from the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Received {
    /// When its stop bit ended.
    pub at: Duration,
    /// The byte.
    pub byte: u8,
}

/// A byte to the board.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Unsent {
    byte: u8,
    damaged: bool,
}

/// A USB-to-serial adapter with room for everything: it sends what it is given at the pace of the
/// port, without a pause between bytes, and keeps what the board sends until somebody takes it. It
/// runs at the port's own rate.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct HostUart {
    unsent: VecDeque<Unsent>,
    /// The byte on its way to the board has a framing error.
    damages: bool,
    received: Vec<Received>,
    settings: Settings,
}

store!(HostUart);

impl HostUart {
    /// An adapter with nothing to send.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sends bytes after those that it still has to send.
    pub fn send(&mut self, bytes: &[u8]) {
        self.unsent.extend(bytes.iter().map(|byte| Unsent { byte: *byte, damaged: false }));
    }

    /// The same with a framing error in each: the board receives other bytes, and is told so.
    pub fn send_damaged(&mut self, bytes: &[u8]) {
        self.unsent.extend(bytes.iter().map(|byte| Unsent { byte: *byte, damaged: true }));
    }

    /// Bytes whose start bit has not been sent.
    pub fn unsent(&self) -> usize {
        self.unsent.len()
    }

    /// Whether the board has sent something that nobody has taken yet.
    pub fn has_received(&self) -> bool {
        !self.received.is_empty()
    }

    /// Takes what the board has sent since the last time.
    pub fn take(&mut self) -> Vec<u8> {
        self.take_timed().into_iter().map(|received| received.byte).collect()
    }

    /// Takes what the board has sent since the last time, with the times.
    pub fn take_timed(&mut self) -> Vec<Received> {
        std::mem::take(&mut self.received)
    }

    /// Forgets what it has still to send, and what it has received.
    pub fn clear(&mut self) {
        self.unsent.clear();
        self.received.clear();
    }

    /// How the firmware has set the port up.
    pub fn settings(&self) -> Settings {
        self.settings
    }
}

impl Peer for HostUart {
    fn receive(&mut self, word: u16, timeline: &mut Timeline<'_, '_>) {
        let [byte, _] = word.to_le_bytes();
        self.received.push(Received { at: since_start(timeline.now()), byte });
    }

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        let Unsent { byte, damaged } = self.unsent.pop_front()?;
        self.damages = damaged;
        Some(u16::from(byte))
    }
}

impl FarEnd for HostUart {
    fn port_set_up(&mut self, settings: Settings) {
        self.settings = settings;
    }

    fn damages(&mut self) -> bool {
        self.damages
    }
}

#[cfg(test)]
mod tests;
