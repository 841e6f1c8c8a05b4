//! What the firmware drives on the pins that it uses by themselves, not as a peripheral's, over
//! time.

use std::time::Duration;

use rigless::device::Level;
use rigless::soc::stm32h743::peripherals::gpio::PORTS;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};
use virtual_stm32::Chip;
use virtual_stm32::pins::{Driven, Pin};

use crate::nodes::since_start;

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
        let of_pin = |(port, number, _): &&(usize, u8, Change)| {
            (*port, *number) == (pin.port(), pin.number())
        };
        self.changes.iter().filter(of_pin).map(|(_, _, change)| *change).collect()
    }
}
