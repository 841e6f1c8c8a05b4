//! The fault byte of register 0x12.

bitflags::bitflags! {
    /// Faults, several at once (D5 manual, error states at address 0x12).
    ///
    /// Bits without a name stay as received.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
    pub struct Faults: u8 {
        /// Circuit board too hot.
        const BOARD_HOT = 0x01;
        /// Over-current; [`Register::CLEAR_PROTECTION`](crate::Register::CLEAR_PROTECTION) clears it.
        const OVER_CURRENT = 0x02;
        /// Over-voltage.
        const OVER_VOLTAGE = 0x04;
        /// Under-voltage.
        const UNDER_VOLTAGE = 0x08;
        /// Stall; [`Register::CLEAR_PROTECTION`](crate::Register::CLEAR_PROTECTION) clears it.
        const STALL = 0x40;
        /// Motor too hot.
        const MOTOR_HOT = 0x80;
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Faults {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "Faults({=u8:#04x})", self.bits());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D5 manual, error states at address 0x12: bits 0x10 and 0x20 have no name and stay.
    #[test]
    fn bits_are_those_of_the_table() {
        assert_eq!(Faults::from_bits_retain(0x42), Faults::STALL | Faults::OVER_CURRENT);
        assert_eq!(Faults::from_bits_retain(0x8D), Faults::all() - Faults::STALL - Faults::OVER_CURRENT);
        assert_eq!(Faults::from_bits_retain(0x31).bits(), 0x31);
    }
}
