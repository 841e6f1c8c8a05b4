//! The fault word of EF and FR.

use codec::{FieldInfo, FieldKind, Shown, Visit};

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

/// What a device does about a fault, besides reporting it (Thruster manual §3, protections).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultAction {
    /// Nothing more.
    Report,
    /// Its output is limited.
    LimitOutput,
    /// Its output is switched off.
    OutputOff,
    /// Output is barred.
    BarOutput,
    /// Position commands have no effect.
    IgnorePosition,
}

/// How a fault ends (Thruster manual §3, protections).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultRecovery {
    /// With its cause.
    BySelf,
    /// At or below this temperature, °C.
    Cooled(u8),
    /// When the signal crosses zero.
    ZeroSignal,
    /// With the next command.
    NextCommand,
    /// Not by itself.
    Never,
}

/// One row of the manual's table of faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FaultInfo {
    /// Its bit.
    pub fault: Faults,
    /// Its name in snake_case.
    pub name: &'static str,
    /// 1: serious, the output is off. 2: the output is limited, or the fault only reported.
    pub level: u8,
    /// What the device does about it.
    pub action: FaultAction,
    /// How it ends.
    pub recovery: FaultRecovery,
    /// The temperature that causes it, °C, where the manual gives one.
    pub threshold: Option<u8>,
}

/// At this temperature the output is limited, °C (Thruster manual §3).
const HOT: u8 = 120;
/// At this temperature it no longer is, °C (Thruster manual §3).
const COOL: u8 = 100;

const fn row(
    fault: Faults,
    name: &'static str,
    level: u8,
    action: FaultAction,
    recovery: FaultRecovery,
) -> FaultInfo {
    let threshold = if matches!(recovery, FaultRecovery::Cooled(_)) { Some(HOT) } else { None };
    FaultInfo { fault, name, level, action, recovery, threshold }
}

/// Every fault of the manual, by bit (Thruster manual §3, protections).
pub const FAULTS: &[FaultInfo] = {
    use FaultAction::{BarOutput, IgnorePosition, LimitOutput, OutputOff, Report};
    use FaultRecovery::{BySelf, Cooled, Never, NextCommand, ZeroSignal};
    &[
        row(Faults::EE_ACCESS, "ee_access", 1, OutputOff, Never),
        row(Faults::EE_DATA, "ee_data", 1, OutputOff, Never),
        row(Faults::OVER_CURRENT, "over_current", 1, OutputOff, Never),
        row(Faults::OVER_VOLTAGE, "over_voltage", 2, Report, BySelf),
        row(Faults::UNDER_VOLTAGE, "under_voltage", 2, Report, BySelf),
        row(Faults::STALL, "stall", 1, OutputOff, Never),
        row(Faults::ENCODER, "encoder", 2, IgnorePosition, Never),
        row(Faults::DRIVER_HOT, "driver_hot", 2, LimitOutput, Cooled(COOL)),
        row(Faults::MOTOR_HOT, "motor_hot", 2, LimitOutput, Cooled(COOL)),
        row(Faults::ZERO_PROTECTION, "zero_protection", 2, BarOutput, ZeroSignal),
        row(Faults::TIMEOUT, "timeout", 2, OutputOff, NextCommand),
        row(Faults::DRIVER_SENSOR, "driver_sensor", 2, Report, BySelf),
        row(Faults::MOTOR_SENSOR, "motor_sensor", 2, Report, BySelf),
    ]
};

impl Faults {
    /// What a device only reports, its output unlimited: bits 3, 4, 12 and 13 (Thruster manual §3,
    /// protections).
    pub const REPORTED: Faults =
        Self::OVER_VOLTAGE.union(Self::UNDER_VOLTAGE).union(Self::TEMPERATURE_SENSORS);
    /// A temperature sensor that is broken, so that its temperature means nothing (Thruster manual
    /// §3).
    pub const TEMPERATURE_SENSORS: Faults = Self::DRIVER_SENSOR.union(Self::MOTOR_SENSOR);

    /// The table's row of every listed bit that is set, the lowest first.
    pub fn infos(self) -> impl Iterator<Item = &'static FaultInfo> {
        FAULTS.iter().filter(move |info| self.contains(info.fault))
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
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "Faults({=u16:#06x})", self.bits());
    }
}
