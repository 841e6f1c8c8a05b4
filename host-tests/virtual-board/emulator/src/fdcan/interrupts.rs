//! IR, IE, ILS and ILE: flags, which of them interrupt, and on which line.

use serde::{Deserialize, Serialize};

use super::registers::ir;

/// The interrupt lines of a controller.
pub const LINES: usize = 2;

/// The registers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interrupts {
    /// IR.
    pub flags: u32,
    /// IE.
    pub enabled: u32,
    /// ILS.
    pub select: u32,
    /// ILE.
    pub line_enable: u32,
}

impl Interrupts {
    /// Sets flags.
    pub fn raise(&mut self, flags: u32) {
        self.flags |= flags;
    }

    /// IR is written: every 1 clears its flag.
    pub fn clear(&mut self, written: u32) {
        self.flags &= !written;
    }

    /// IE is written.
    pub fn enable(&mut self, written: u32) {
        self.enabled = written & ir::ALL;
    }

    /// ILS is written.
    pub fn select_lines(&mut self, written: u32) {
        self.select = written & ir::ALL;
    }

    /// ILE is written.
    pub fn enable_lines(&mut self, written: u32) {
        self.line_enable = written & 0b11;
    }

    /// Whether each line is high.
    #[must_use]
    pub fn lines(&self) -> [bool; LINES] {
        let active = self.flags & self.enabled;
        [
            active & !self.select != 0 && self.line_enable & 0b01 != 0,
            active & self.select != 0 && self.line_enable & 0b10 != 0,
        ]
    }
}
