//! The gains of the motor's three control loops.

use crate::field::{DATA_LEN, request as field};

/// Gains of 0x30, 0x31 and 0x32, each in 1/256 of a maximum that depends on the motor model (RMD V3.6 §2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PidGains {
    /// Proportional gain of the current loop.
    pub current_kp: u8,
    /// Integral gain of the current loop.
    pub current_ki: u8,
    /// Proportional gain of the speed loop.
    pub speed_kp: u8,
    /// Integral gain of the speed loop.
    pub speed_ki: u8,
    /// Proportional gain of the position loop.
    pub position_kp: u8,
    /// Integral gain of the position loop.
    pub position_ki: u8,
}

impl PidGains {
    pub(crate) fn decode(data: &[u8; DATA_LEN]) -> PidGains {
        let [current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki] = field::GAINS.get(data);
        PidGains { current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki }
    }

    pub(crate) fn put(self, data: &mut [u8; DATA_LEN]) {
        let PidGains { current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki } = self;
        field::GAINS.put(data, [current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki]);
    }
}
