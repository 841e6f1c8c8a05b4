//! The state in the replies to 0x9C and to the closed-loop commands.

use crate::payload::Payload;
use crate::units::{Celsius, Centiamps, Degrees, DegreesPerSecond};

codec::fields! {
    /// State in the replies to 0x9C and to the closed-loop commands (RMD V3.6 §2.13.3, §2.17.3).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    struct Motion, layout Payload;

    /// Motor temperature.
    temperature: Celsius = 1 as "temperature_c";
    /// Measured torque current.
    current: Centiamps = 2 as "current_a";
    /// Measured speed of the output shaft.
    speed: DegreesPerSecond = 4 as "speed_dps";
    /// Angle of the output shaft from the zero point.
    angle: Degrees = 6 as "angle_deg";
}
