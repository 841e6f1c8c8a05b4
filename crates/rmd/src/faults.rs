//! The error word of 0x9A.

use codec::{FieldInfo, FieldKind, Shown, Visit};

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

/// How a motor gets rid of a fault (RMD V3.6 §8.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultLevel {
    /// Level 2: the motor resumes by itself once the cause is gone.
    Recovers,
    /// Level 1: only after its cause is removed and the motor restarted.
    UntilRestart,
}

/// One bit of the error word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultInfo {
    /// The bit.
    pub fault: Faults,
    /// Its name in snake_case.
    pub name: &'static str,
    /// Its level.
    pub level: FaultLevel,
}

/// Every bit the manual lists, the lowest first.
pub const FAULTS: &[FaultInfo] = &[
    info(Faults::STALL, "stall"),
    info(Faults::UNDER_VOLTAGE, "under_voltage"),
    info(Faults::OVER_VOLTAGE, "over_voltage"),
    info(Faults::PHASE_OVER_CURRENT, "phase_over_current"),
    info(Faults::OVER_POWER, "over_power"),
    info(Faults::CALIBRATION, "calibration"),
    info(Faults::OVER_SPEED, "over_speed"),
    info(Faults::MOTOR_OVER_TEMPERATURE, "motor_over_temperature"),
    info(Faults::ENCODER_CALIBRATION, "encoder_calibration"),
];

const fn info(fault: Faults, name: &'static str) -> FaultInfo {
    let until_restart = Faults::UNTIL_RESTART.contains(fault);
    let level = if until_restart { FaultLevel::UntilRestart } else { FaultLevel::Recovers };
    FaultInfo { fault, name, level }
}

impl Faults {
    /// Level 1: these faults stay until the motor restarts. From every other listed one the motor
    /// resumes by itself (RMD V3.6 §8.1, §8.2).
    pub const UNTIL_RESTART: Faults =
        Faults::STALL.union(Faults::PHASE_OVER_CURRENT).union(Faults::CALIBRATION);

    /// The table's row of every listed bit that is set, the lowest first.
    pub fn infos(self) -> impl Iterator<Item = &'static FaultInfo> {
        FAULTS.iter().filter(move |info| self.contains(info.fault))
    }

    /// The worst level of the listed bits that are set.
    pub fn level(self) -> Option<FaultLevel> {
        self.infos().map(|info| info.level).max()
    }

    /// Hands on the name of every listed bit in a word, as [`FieldValue`](crate::FieldValue) has
    /// it.
    pub(crate) fn visit_names(word: u32, visit: &mut dyn FnMut(&'static str)) {
        let listed = FAULTS.iter().filter(|info| word & u32::from(info.fault.bits()) != 0);
        listed.for_each(|info| visit(info.name));
    }
}

impl Shown for Faults {
    const INFO: FieldInfo = FieldInfo::other(FieldKind::Flags, "");

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        field.visit_flags(visit, self.bits(), Faults::visit_names);
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Faults {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Faults({=u16:#06x})", self.bits());
    }
}
