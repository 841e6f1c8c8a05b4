//! The fault word of EF and FR.

use self::FaultAction::{BarOutput, IgnorePosition, LimitOutput, OutputOff, Report};
use self::FaultRecovery::{BySelf, Cooled, Never, NextCommand, ZeroSignal};

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

const fn info(
    fault: Faults,
    name: &'static str,
    level: u8,
    action: FaultAction,
    recovery: FaultRecovery,
) -> FaultInfo {
    let threshold = if matches!(recovery, FaultRecovery::Cooled(_)) { Some(HOT) } else { None };
    FaultInfo { fault, name, level, action, recovery, threshold }
}

codec::flags! {
    /// Faults, several at once (Thruster manual §3): low byte is byte 7 of the reply, high byte is
    /// byte 6.
    ///
    /// Bits without a name stay as received: the example of §2.6 sets the reserved bit 14.
    struct Faults: u16;

    /// Every fault of the manual, by bit (Thruster manual §3, protections).
    FAULTS of FaultInfo by info;

    /// EEPROM access failed; output off, no recovery by itself.
    EE_ACCESS = 1 << 0, 1, OutputOff, Never;
    /// EEPROM data invalid; output off, no recovery by itself.
    EE_DATA = 1 << 1, 1, OutputOff, Never;
    /// Over-current; output off, no recovery by itself.
    OVER_CURRENT = 1 << 2, 1, OutputOff, Never;
    /// Over-voltage; reported only.
    OVER_VOLTAGE = 1 << 3, 2, Report, BySelf;
    /// Under-voltage; reported only.
    UNDER_VOLTAGE = 1 << 4, 2, Report, BySelf;
    /// Stall; output off, no recovery by itself.
    STALL = 1 << 6, 1, OutputOff, Never;
    /// Encoder; position commands have no effect, no recovery by itself.
    ENCODER = 1 << 7, 2, IgnorePosition, Never;
    /// Driver over 120 °C; output limited until at most 100 °C.
    DRIVER_HOT = 1 << 8, 2, LimitOutput, Cooled(COOL);
    /// Motor over 120 °C; output limited until at most 100 °C.
    MOTOR_HOT = 1 << 9, 2, LimitOutput, Cooled(COOL);
    /// Zero protection; output barred until the signal has crossed zero.
    ZERO_PROTECTION = 1 << 10, 2, BarOutput, ZeroSignal;
    /// Communication timeout; output off until the next command, which also clears this bit.
    TIMEOUT = 1 << 11, 2, OutputOff, NextCommand;
    /// Driver temperature sensor; reported only.
    DRIVER_SENSOR = 1 << 12, 2, Report, BySelf;
    /// Motor temperature sensor; reported only.
    MOTOR_SENSOR = 1 << 13, 2, Report, BySelf;
}

impl Faults {
    /// What a device only reports, its output unlimited: bits 3, 4, 12 and 13 (Thruster manual §3,
    /// protections).
    pub const REPORTED: Faults =
        Self::OVER_VOLTAGE.union(Self::UNDER_VOLTAGE).union(Self::TEMPERATURE_SENSORS);
    /// A temperature sensor that is broken, so that its temperature means nothing (Thruster manual
    /// §3).
    pub const TEMPERATURE_SENSORS: Faults = Self::DRIVER_SENSOR.union(Self::MOTOR_SENSOR);
}
