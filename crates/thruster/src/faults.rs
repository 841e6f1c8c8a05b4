//! The fault word of EF and FR.

bitflags::bitflags! {
    /// Faults, several at once (Thruster manual §3): low byte is byte 7 of the reply, high byte is byte 6.
    ///
    /// Bits without a name stay as received: the example of §2.6 sets the reserved bit 14.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
    pub struct Faults: u16 {
        /// EEPROM access failed; output off, no recovery by itself.
        const EE_ACCESS = 1 << 0;
        /// EEPROM data invalid; output off, no recovery by itself.
        const EE_DATA = 1 << 1;
        /// Over-current; output off, no recovery by itself.
        const OVER_CURRENT = 1 << 2;
        /// Over-voltage; reported only.
        const OVER_VOLTAGE = 1 << 3;
        /// Under-voltage; reported only.
        const UNDER_VOLTAGE = 1 << 4;
        /// Stall; output off, no recovery by itself.
        const STALL = 1 << 6;
        /// Encoder; position commands have no effect, no recovery by itself.
        const ENCODER = 1 << 7;
        /// Driver over 120 °C; output limited until at most 100 °C.
        const DRIVER_HOT = 1 << 8;
        /// Motor over 120 °C; output limited until at most 100 °C.
        const MOTOR_HOT = 1 << 9;
        /// Zero protection; output barred until the signal has crossed zero.
        const ZERO_PROTECTION = 1 << 10;
        /// Communication timeout; output off until the next command, which also clears this bit.
        const TIMEOUT = 1 << 11;
        /// Driver temperature sensor; reported only.
        const DRIVER_SENSOR = 1 << 12;
        /// Motor temperature sensor; reported only.
        const MOTOR_SENSOR = 1 << 13;
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Faults {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "Faults({=u16:#06x})", self.bits());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thruster manual §3: the table of bytes 6 and 7.
    #[test]
    fn bits_are_those_of_the_table() {
        let table: [(Faults, [u8; 2]); 13] = [
            (Faults::EE_ACCESS, [0x00, 0x01]),
            (Faults::EE_DATA, [0x00, 0x02]),
            (Faults::OVER_CURRENT, [0x00, 0x04]),
            (Faults::OVER_VOLTAGE, [0x00, 0x08]),
            (Faults::UNDER_VOLTAGE, [0x00, 0x10]),
            (Faults::STALL, [0x00, 0x40]),
            (Faults::ENCODER, [0x00, 0x80]),
            (Faults::DRIVER_HOT, [0x01, 0x00]),
            (Faults::MOTOR_HOT, [0x02, 0x00]),
            (Faults::ZERO_PROTECTION, [0x04, 0x00]),
            (Faults::TIMEOUT, [0x08, 0x00]),
            (Faults::DRIVER_SENSOR, [0x10, 0x00]),
            (Faults::MOTOR_SENSOR, [0x20, 0x00]),
        ];
        for (faults, bytes) in table {
            assert_eq!(faults.bits().to_be_bytes(), bytes);
        }
    }
}
