//! The error word of 0x9A.

bitflags::bitflags! {
    /// Error word, a bit mask: several faults may stand at once (RMD V3.6 §2.12.3, levels in §8.2).
    ///
    /// Bits without a name here are kept as received. The hardware over-current of §8.2 has no bit in the manual.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
    pub struct Faults: u16 {
        /// The motor stalls: high current at low speed for some time. Level 1.
        const STALL = 0x0002;
        /// The supply is below its limit. Level 2.
        const UNDER_VOLTAGE = 0x0004;
        /// The supply is above its limit. Level 2.
        const OVER_VOLTAGE = 0x0008;
        /// The phase current exceeded its limit. Level 1.
        const PHASE_OVER_CURRENT = 0x0010;
        /// The input power exceeded its limit. Level 2.
        const OVER_POWER = 0x0040;
        /// Calibration parameters could not be written or were lost. Level 1.
        const CALIBRATION = 0x0080;
        /// The motor turns faster than its limit. Level 2.
        const OVER_SPEED = 0x0100;
        /// The motor is too hot. Level 2.
        const MOTOR_OVER_TEMPERATURE = 0x1000;
        /// The encoder's calibration is too far from its standard. Level 2.
        const ENCODER_CALIBRATION = 0x2000;
    }
}

impl Faults {
    /// Level 1: these faults stay until the motor restarts. From every other listed one the motor resumes by itself
    /// (RMD V3.6 §8.1, §8.2).
    pub const UNTIL_RESTART: Faults =
        Faults::STALL.union(Faults::PHASE_OVER_CURRENT).union(Faults::CALIBRATION);
}

#[cfg(feature = "defmt")]
impl defmt::Format for Faults {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Faults({=u16:#06x})", self.bits());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RMD V3.6 §2.12.3, table of error values.
    #[test]
    fn every_listed_bit_has_its_name() {
        let listed: [(u16, &str); 9] = [
            (0x0002, "STALL"),
            (0x0004, "UNDER_VOLTAGE"),
            (0x0008, "OVER_VOLTAGE"),
            (0x0010, "PHASE_OVER_CURRENT"),
            (0x0040, "OVER_POWER"),
            (0x0080, "CALIBRATION"),
            (0x0100, "OVER_SPEED"),
            (0x1000, "MOTOR_OVER_TEMPERATURE"),
            (0x2000, "ENCODER_CALIBRATION"),
        ];
        let named = Faults::all().iter_names().map(|(name, fault)| (fault.bits(), name));
        assert!(named.eq(listed));
    }

    /// RMD V3.6 §8.2: the level 1 rows that have a bit.
    #[test]
    fn level_1_is_stall_phase_current_and_calibration() {
        assert_eq!(Faults::UNTIL_RESTART.bits(), 0x0092);
    }
}
