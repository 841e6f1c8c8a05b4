//! Which of the four accelerations 0x43 writes.

use codec::check_range;

use crate::error::EncodeError;

/// Index of an acceleration or deceleration (RMD V3.6 §2.5.4); other values than the four are kept as received.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ramp(pub u8);

impl Ramp {
    /// Speeding up in position moves.
    pub const POSITION_ACCELERATION: Ramp = Ramp(0);
    /// Slowing down in position moves.
    pub const POSITION_DECELERATION: Ramp = Ramp(1);
    /// Speeding up to a commanded velocity, in either direction.
    pub const VELOCITY_ACCELERATION: Ramp = Ramp(2);
    /// Slowing down to a commanded velocity of the same direction.
    pub const VELOCITY_DECELERATION: Ramp = Ramp(3);

    /// Name of the four the manual lists.
    pub const fn name(self) -> Option<&'static str> {
        match self {
            Ramp::POSITION_ACCELERATION => Some("position_acceleration"),
            Ramp::POSITION_DECELERATION => Some("position_deceleration"),
            Ramp::VELOCITY_ACCELERATION => Some("velocity_acceleration"),
            Ramp::VELOCITY_DECELERATION => Some("velocity_deceleration"),
            Ramp(_) => None,
        }
    }

    pub(crate) fn check(self) -> Result<(), EncodeError> {
        let last = i64::from(Ramp::VELOCITY_DECELERATION.0);
        check_range("index", i64::from(self.0), i64::from(Ramp::POSITION_ACCELERATION.0), last)
    }
}
