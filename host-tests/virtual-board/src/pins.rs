//! The pins of the part that a board uses by themselves, not as a peripheral's.

use std::time::Duration;

use rigless::device::Level;
use rigless::soc::stm32h743::peripherals::gpio::PORTS;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use crate::chip::Chip;
use crate::nodes::since_start;

/// Addresses of the first port's registers, and from one port to the next (RM0433 §2.3).
pub(crate) const FIRST_PORT: u64 = 0x5802_0000;
pub(crate) const PORT_BYTES: u64 = 0x400;

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
}

/// A pin: `Pin::new(Port::B, 0)` is PB0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pin {
    port: Port,
    number: u8,
}

/// The e-stop input: closed to ground on a machine that may run, pulled up inside the part.
pub const E_STOP: Pin = Pin::new(Port::E, 11);
/// The enable output: the drives have power while it is high; a resistor outside pulls it down.
pub const ENABLE: Pin = Pin::new(Port::E, 9);
/// The light, LD1: on while it is high.
pub const LIGHT: Pin = Pin::new(Port::B, 0);

impl Pin {
    /// # Panics
    ///
    /// From 16 on.
    #[must_use]
    pub const fn new(port: Port, number: u8) -> Self {
        assert!(number < 16, "a port has sixteen pins");
        Self { port, number }
    }

    /// Its port's place among the ports of the part.
    pub(crate) const fn port(self) -> usize {
        self.port as usize
    }

    /// Its place in the port.
    pub(crate) const fn number(self) -> u8 {
        self.number
    }
}

/// What the firmware drives on the pins of a port that it has made general-purpose outputs: one bit for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Driven {
    /// The outputs.
    pub(crate) outputs: u16,
    /// Those of them that are high.
    pub(crate) high: u16,
}

impl Driven {
    fn level(self, pin: u8) -> Option<Level> {
        let bit = 1 << pin;
        (self.outputs & bit != 0).then(|| Level::from(self.high & bit != 0))
    }
}

/// A change of what the firmware drives on a pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// When, since the board was switched on.
    pub at: Duration,
    /// What from then on; `None`: the pin is no output, and what is outside decides its level.
    pub level: Option<Level>,
}

/// Everything that the firmware has driven on its general-purpose outputs.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct OutputLog {
    now: [Driven; PORTS.len()],
    changes: Vec<(usize, u8, Change)>,
}

impl OutputLog {
    /// Looks at a port, after whatever may have changed it.
    pub(crate) fn look(&mut self, chip: &Chip, port: usize, at: VirtualNanos) {
        let (before, now) = (self.now[port], chip.driven(port));
        self.now[port] = now;
        for pin in 0..16 {
            let level = now.level(pin);
            if level != before.level(pin) {
                self.changes.push((port, pin, Change { at: since_start(at), level }));
            }
        }
    }

    /// Looks at every port.
    pub(crate) fn look_at_all(&mut self, chip: &Chip, at: VirtualNanos) {
        (0..chip.ports()).for_each(|port| self.look(chip, port, at));
    }

    /// The changes of one pin.
    pub(crate) fn of(&self, pin: Pin) -> Vec<Change> {
        let of_pin =
            |(port, number, _): &&(usize, u8, Change)| (*port, *number) == (pin.port(), pin.number());
        self.changes.iter().filter(of_pin).map(|(_, _, change)| *change).collect()
    }
}
