//! The gains of the motor's three control loops.

use crate::payload::Payload;

codec::fields! {
    /// Gains of 0x30, 0x31 and 0x32, each in 1/256 of a maximum that depends on the motor model
    /// (RMD V3.6 §2.1).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    struct PidGains, layout Payload;

    /// Proportional gain of the current loop.
    current_kp: u8 = 2 as "current_kp";
    /// Integral gain of the current loop.
    current_ki: u8 = 3 as "current_ki";
    /// Proportional gain of the speed loop.
    speed_kp: u8 = 4 as "speed_kp";
    /// Integral gain of the speed loop.
    speed_ki: u8 = 5 as "speed_ki";
    /// Proportional gain of the position loop.
    position_kp: u8 = 6 as "position_kp";
    /// Integral gain of the position loop.
    position_ki: u8 = 7 as "position_ki";
}
