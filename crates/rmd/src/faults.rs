//! The error word of 0x9A.

use self::FaultLevel::{Recovers, UntilRestart};

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

const fn info(fault: Faults, name: &'static str, level: FaultLevel) -> FaultInfo {
    FaultInfo { fault, name, level }
}

codec::flags! {
    /// Error word, a bit mask: several faults may stand at once (RMD V3.6 §2.12.3, levels in §8.2).
    ///
    /// Bits without a name here are kept as received. The hardware over-current of §8.2 has no bit
    /// in the manual.
    struct Faults: u16;

    /// Every bit that the manual or a newer one lists, the lowest first.
    FAULTS of FaultInfo by info;

    /// The motor stalls: high current at low speed for some time. Level 1.
    STALL = 0x0002, UntilRestart;
    /// The supply is below its limit. Level 2.
    UNDER_VOLTAGE = 0x0004, Recovers;
    /// The supply is above its limit. Level 2.
    OVER_VOLTAGE = 0x0008, Recovers;
    /// The phase current exceeded its limit. Level 1.
    PHASE_OVER_CURRENT = 0x0010, UntilRestart;
    /// The input power exceeded its limit. Level 2.
    OVER_POWER = 0x0040, Recovers;
    /// Calibration parameters could not be written or were lost. Level 1.
    CALIBRATION = 0x0080, UntilRestart;
    /// The motor turns faster than its limit. Level 2.
    OVER_SPEED = 0x0100, Recovers;
    /// Parts on the board are too hot: above 110 °C until below 90 °C (V4.3). Level 2.
    COMPONENT_OVER_TEMPERATURE = 0x0800, Recovers;
    /// The motor is too hot. Level 2.
    MOTOR_OVER_TEMPERATURE = 0x1000, Recovers;
    /// The encoder's calibration is too far from its standard. Level 2; V4.4 keeps it until a
    /// restart.
    ENCODER_CALIBRATION = 0x2000, Recovers;
    /// What the encoder says cannot be read (V4.3). Kept until a restart (V4.4).
    ENCODER_DATA = 0x4000, UntilRestart;
}

impl Faults {
    /// Level 1: these faults stay until the motor restarts. From every other listed one the motor
    /// resumes by itself (RMD V3.6 §8.1, §8.2).
    pub const UNTIL_RESTART: Faults = Faults::STALL
        .union(Faults::PHASE_OVER_CURRENT)
        .union(Faults::CALIBRATION)
        .union(Faults::ENCODER_DATA);

    /// The worst level of the listed bits that are set.
    pub fn level(self) -> Option<FaultLevel> {
        self.infos().map(|info| info.level).max()
    }
}
