//! The pins of a chip: sixteen to a port.

use rigless::device::Level;
use serde::{Deserialize, Serialize};

/// A port of sixteen pins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "letters")]
pub enum Port {
    A,
    B,
    C,
    D,
    E,
    F,
    G,
    H,
    I,
    J,
    K,
}

/// A pin: `Pin::new(Port::B, 0)` is PB0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pin {
    port: Port,
    number: u8,
}

impl Pin {
    /// # Panics
    ///
    /// From 16 on.
    #[must_use]
    pub const fn new(port: Port, number: u8) -> Self {
        assert!(number < 16, "a port has sixteen pins");
        Self { port, number }
    }

    /// Its port's place among the ports of the chip.
    #[must_use]
    pub const fn port(self) -> usize {
        self.port as usize
    }

    /// Its place in the port.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.number
    }
}

/// What the firmware drives on the pins of a port that it has made general-purpose outputs: one bit
/// for each pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Driven {
    /// The outputs; an open drain that is released is none.
    pub outputs: u16,
    /// Those of them that are high.
    pub high: u16,
}

impl Driven {
    /// The level of one pin, 0 to 15; `None` where the firmware drives none.
    #[must_use]
    pub fn level(self, pin: u8) -> Option<Level> {
        let bit = 1 << pin;
        (self.outputs & bit != 0).then(|| Level::from(self.high & bit != 0))
    }
}
