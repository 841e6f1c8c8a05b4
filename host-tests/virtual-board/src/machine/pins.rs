//! A pin in the test's hands: drives it from outside, reads what the firmware drives.

use std::time::Duration;

use rigless::device::Level;

use super::Machine;
use crate::nodes::instant;
use crate::pins::Change;
use virtual_stm32::pins::{Pin, Port};

/// A pin of a board.
pub struct PinProbe<'m> {
    machine: &'m mut Machine,
    pin: Pin,
}

impl Machine {
    /// A pin of the board: `machine.pin(Port::E, 9)`.
    /// Panics if the part has no such pin.
    pub fn pin(&mut self, port: Port, number: u8) -> PinProbe<'_> {
        self.probe(Pin::new(port, number))
    }

    /// The e-stop input.
    pub fn e_stop(&mut self) -> PinProbe<'_> {
        self.probe(self.board().e_stop)
    }

    /// The enable output.
    pub fn enable_output(&mut self) -> PinProbe<'_> {
        self.probe(self.board().enable)
    }

    /// The light.
    pub fn light(&mut self) -> PinProbe<'_> {
        self.probe(self.board().light)
    }

    /// Any pin.
    pub fn probe(&mut self, pin: Pin) -> PinProbe<'_> {
        PinProbe { machine: self, pin }
    }

    /// Opens the chain of emergency stops, as a pressed button or a cut cable does, or closes it.
    pub fn open_e_stop(&mut self, open: bool) {
        let level = if open { None } else { Some(Level::Low) };
        self.e_stop().drive(level);
    }
}

impl PinProbe<'_> {
    /// Drives the pin from outside from now on; `None` lets go of it.
    pub fn drive(self, level: Option<Level>) {
        let at = instant(self.machine.now());
        self.machine.part_mut().drive_pin(self.pin, level, at);
    }

    /// What the firmware drives; `None` while the pin is no general-purpose output.
    pub fn driven(self) -> Option<Level> {
        self.changes().last().and_then(|change| change.level)
    }

    /// When that changed last; `None`: never since the board was switched on.
    pub fn changed(self) -> Option<Duration> {
        self.changes().last().map(|change| change.at)
    }

    /// Every change of what the firmware drives, since the board was switched on: to the nanosecond
    /// of the access.
    pub fn changes(self) -> Vec<Change> {
        let Self { machine, pin } = self;
        machine.core.order(move |_, _, _, recorder| recorder.outputs().of(pin))
    }

    /// Whether the part reads it as high.
    pub fn reads_high(self) -> bool {
        self.machine.part().reads_high(self.pin)
    }
}
