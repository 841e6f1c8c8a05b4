//! An endpoint register of the STM32G474's USB (RM0440, USB_EPnR).
//!
//! | Bits | A write |
//! |---|---|
//! | EA, EP_KIND, EP_TYPE | sets them |
//! | STAT_RX, STAT_TX, DTOG_RX, DTOG_TX | a 1 toggles the bit, a 0 leaves it |
//! | CTR_RX, CTR_TX | a 0 clears the bit, a 1 leaves it |
//! | SETUP | does nothing |

use serde::{Deserialize, Serialize};

use crate::usb::function::Toggle;

/// The endpoint's address on the USB.
pub const EA: u16 = 0xF;
/// How an IN token is answered.
pub const STAT_TX: u16 = 3 << 4;
/// Which packet is sent next.
pub const DTOG_TX: u16 = 1 << 6;
/// A packet was sent and acknowledged.
pub const CTR_TX: u16 = 1 << 7;
/// Of a control endpoint: the status stage comes next, empty; of a bulk endpoint: two buffers.
pub const EP_KIND: u16 = 1 << 8;
/// Bulk, control, isochronous, interrupt.
pub const EP_TYPE: u16 = 3 << 9;
/// What was received last was a SETUP.
pub const SETUP: u16 = 1 << 11;
/// How an OUT token is answered.
pub const STAT_RX: u16 = 3 << 12;
/// Which packet is expected next.
pub const DTOG_RX: u16 = 1 << 14;
/// A packet was received.
pub const CTR_RX: u16 = 1 << 15;

const SET: u16 = EA | EP_KIND | EP_TYPE;
const TOGGLED: u16 = STAT_RX | STAT_TX | DTOG_RX | DTOG_TX;
const CLEARED: u16 = CTR_RX | CTR_TX;

/// How an endpoint answers in one direction (STAT_RX, STAT_TX).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Not at all.
    Disabled,
    /// With STALL.
    Stall,
    /// With NAK.
    Nak,
    /// By taking or giving a packet.
    Valid,
}

/// What an endpoint is for (EP_TYPE).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Bulk transfers.
    Bulk,
    /// Control transfers.
    Control,
    /// Isochronous transfers.
    Isochronous,
    /// Interrupt transfers.
    Interrupt,
}

/// The register.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Endpoint(u16);

impl Endpoint {
    /// What a read finds. Reading changes nothing.
    #[must_use]
    pub const fn read(self) -> u16 {
        self.0
    }

    /// Takes what the processor writes.
    pub const fn write(&mut self, value: u16) {
        let old = self.0;
        self.0 = value & SET | (old ^ value) & TOGGLED | old & value & CLEARED | old & SETUP;
    }

    /// What a reset on the bus leaves: that packets were sent and received.
    pub const fn reset(&mut self) {
        self.0 &= CLEARED;
    }

    /// Its address on the USB.
    #[must_use]
    pub const fn address(self) -> u8 {
        self.0.to_le_bytes()[0] & 0xF
    }

    /// Whether any of these bits is set.
    #[must_use]
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits != 0
    }

    /// What it is for.
    #[must_use]
    pub const fn kind(self) -> Kind {
        match (self.0 & EP_TYPE) >> EP_TYPE.trailing_zeros() {
            0 => Kind::Bulk,
            1 => Kind::Control,
            2 => Kind::Isochronous,
            _ => Kind::Interrupt,
        }
    }

    /// How it answers OUT tokens.
    #[must_use]
    pub const fn receives(self) -> Status {
        self.status(STAT_RX)
    }

    /// How it answers IN tokens.
    #[must_use]
    pub const fn transmits(self) -> Status {
        self.status(STAT_TX)
    }

    const fn status(self, bits: u16) -> Status {
        match (self.0 & bits) >> bits.trailing_zeros() {
            0 => Status::Disabled,
            1 => Status::Stall,
            2 => Status::Nak,
            _ => Status::Valid,
        }
    }

    /// Which packet it expects.
    #[must_use]
    pub const fn expects(self) -> Toggle {
        if self.has(DTOG_RX) { Toggle::Data1 } else { Toggle::Data0 }
    }

    /// Which packet it sends.
    #[must_use]
    pub const fn sends(self) -> Toggle {
        if self.has(DTOG_TX) { Toggle::Data1 } else { Toggle::Data0 }
    }

    /// A packet was received and acknowledged: the next is not taken before the firmware allows it.
    pub const fn received(&mut self) {
        self.0 = self.0 & !(STAT_RX | SETUP) ^ DTOG_RX | NAK << STAT_RX.trailing_zeros() | CTR_RX;
    }

    /// A SETUP was received: both directions wait for the firmware, and both go on with DATA1.
    pub const fn set_up(&mut self) {
        let waiting = NAK << STAT_RX.trailing_zeros() | NAK << STAT_TX.trailing_zeros();
        self.0 = self.0 & !(STAT_RX | STAT_TX) | waiting | DTOG_RX | DTOG_TX | SETUP | CTR_RX;
    }

    /// The host has acknowledged what was sent: nothing more is sent before the firmware allows it.
    pub const fn sent(&mut self) {
        self.0 = self.0 & !STAT_TX ^ DTOG_TX | NAK << STAT_TX.trailing_zeros() | CTR_TX;
    }
}

/// The code of [`Status::Nak`].
const NAK: u16 = 2;
