//! The computer's end of a host UART.

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::DEFAULT_BAUD;
use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::store;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use crate::nodes::since_start;
use virtual_stm32::serial_port::{FarEnd, Settings};

/// Of how many parts the rates of two ends may differ by one, and a byte survives: its last bit is
/// looked at in its midst, 9.5 bits behind its first edge.
const TOLERATED_PART: u64 = 40;

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

/// A USB-to-serial adapter with room for everything: it sends what it is given without a pause
/// between bytes, and keeps what the board sends until somebody takes it.
///
/// At another rate than the port every byte arrives as another one, at the board with a framing
/// error. It is sent at the pace of the port all the same: how many bytes such noise is, is no
/// matter.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct HostUart {
    baud: u32,
    unsent: VecDeque<Unsent>,
    /// The byte on its way to the board has a framing error.
    damages: bool,
    received: Vec<Received>,
    settings: Settings,
}

store!(HostUart);

impl HostUart {
    /// An adapter at the rate of a start, with nothing to send.
    pub fn new() -> Self {
        Self {
            baud: DEFAULT_BAUD,
            unsent: VecDeque::new(),
            damages: false,
            received: Vec::new(),
            settings: Settings::default(),
        }
    }

    /// Runs at another rate from now on, the byte under way included.
    pub fn set_baud(&mut self, baud: u32) {
        self.baud = baud;
    }

    /// Whether a byte survives: the port runs at the same rate.
    fn is_understood(&self) -> bool {
        let baud = u64::from(self.baud);
        self.settings.bits_per_second().abs_diff(baud) * TOLERATED_PART <= baud
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

impl Default for HostUart {
    fn default() -> Self {
        Self::new()
    }
}

impl Peer for HostUart {
    fn receive(&mut self, word: u16, timeline: &mut Timeline<'_, '_>) {
        let [byte, _] = word.to_le_bytes();
        let byte = if self.is_understood() { byte } else { !byte.rotate_left(3) };
        self.received.push(Received { at: since_start(timeline.now()), byte });
    }

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        let Unsent { byte, damaged } = self.unsent.pop_front()?;
        self.damages = damaged || !self.is_understood();
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
