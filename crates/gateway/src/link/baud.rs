//! The rate of a host link on a UART: what its host has asked for, until nothing valid is heard.

use crate::filled::filled;
use host_protocol::{DEFAULT_BAUD, Error};
use serde::{Deserialize, Serialize};

/// So often in a row something unreadable comes before the host counts as lost at this rate.
const UNREADABLE: u8 = 3;
/// What is unreadable within so long is one thing, a frame at another rate for example, µs.
const ONE_FRAME_US: u64 = 5_000;

/// The rate of a link.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Baud {
    #[serde(skip)]
    offered: Option<&'static [u32]>,
    /// The one that it runs at, where it is another one than the default.
    other: Option<u32>,
    /// It is next, when the replies that wait have left.
    next: Option<u32>,
    /// How much was unreadable since the last valid frame, and when the last of it came, µs.
    unreadable: u8,
    unreadable_us: u64,
    /// It has changed since its port was last told.
    has_changed: bool,
}

impl Baud {
    /// The default rate, and no other is offered. All zeros.
    pub const NONE: Self = Self {
        offered: None,
        other: None,
        next: None,
        unreadable: 0,
        unreadable_us: 0,
        has_changed: false,
    };

    /// The rates that its port offers, which a snapshot leaves out.
    pub fn attach(&mut self, offered: &'static [u32]) {
        self.offered = Some(offered);
    }

    /// The one that it runs at, where it is a UART.
    pub fn now(&self) -> u32 {
        self.other.unwrap_or(DEFAULT_BAUD)
    }

    /// The host asks for another rate, which begins when the replies have left.
    pub fn ask(&mut self, baud: u32) -> Result<(), Error> {
        let offers = self.offered.unwrap_or_default();
        if offers.is_empty() {
            return Err(Error::LinkHasNoBaud {});
        }
        if !offers.contains(&baud) {
            let offered = filled(offers.iter().copied());
            return Err(Error::BaudNotOffered { baud, offered });
        }
        self.next = Some(baud);
        Ok(())
    }

    /// The reply to what was asked is forgotten.
    pub fn forget_next(&mut self) {
        self.next = None;
    }

    /// No reply waits any more.
    pub fn replies_have_left(&mut self) {
        if let Some(baud) = self.next.take() {
            self.change(baud);
        }
    }

    pub fn heard(&mut self) {
        self.unreadable = 0;
    }

    /// Something came that is no frame, or no bytes. Bytes of a host at another rate are like that.
    pub fn unreadable(&mut self, now_us: u64) {
        if self.unreadable > 0 && now_us < self.unreadable_us + ONE_FRAME_US {
            return;
        }
        self.unreadable_us = now_us;
        self.unreadable = self.unreadable.saturating_add(1);
        if self.unreadable >= UNREADABLE {
            self.change(DEFAULT_BAUD);
        }
    }

    /// When [`tick`](Self::tick) is due, for a host that counts as silent then.
    pub fn deadline(&self, silent_at_us: u64) -> Option<u64> {
        self.other.map(|_| silent_at_us)
    }

    pub fn tick(&mut self, now_us: u64, silent_at_us: u64) {
        if self.deadline(silent_at_us).is_some_and(|at| at <= now_us) {
            self.change(DEFAULT_BAUD);
        }
    }

    fn change(&mut self, baud: u32) {
        self.unreadable = 0;
        self.has_changed |= self.now() != baud;
        self.other = (baud != DEFAULT_BAUD).then_some(baud);
    }

    /// Whether it has changed since this was last asked.
    pub fn take_changed(&mut self) -> bool {
        core::mem::take(&mut self.has_changed)
    }
}
