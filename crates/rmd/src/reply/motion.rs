//! The state in the replies to 0x9C and to the closed-loop commands.

use codec::{Visit, check_range};

use crate::error::EncodeError;
use crate::field::{DATA_LEN, reply as field};
use crate::table::field as f;
use crate::units::{Celsius, Centiamps, Degrees, DegreesPerSecond};

/// State in the replies to 0x9C and to the closed-loop commands (RMD V3.6 §2.13.3, §2.17.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motion {
    /// Motor temperature.
    pub temperature: Celsius,
    /// Measured torque current.
    pub current: Centiamps,
    /// Measured speed of the output shaft.
    pub speed: DegreesPerSecond,
    /// Angle of the output shaft from the zero point, −32767..=32767.
    pub angle: Degrees,
}

impl Motion {
    pub(super) fn decode(data: &[u8; DATA_LEN]) -> Motion {
        Motion {
            temperature: Celsius(i8::from_le_bytes(field::TEMPERATURE.get(data))),
            current: Centiamps(i16::from_le_bytes(field::CURRENT.get(data))),
            speed: DegreesPerSecond(i16::from_le_bytes(field::SPEED.get(data))),
            angle: Degrees(i16::from_le_bytes(field::ANGLE.get(data))),
        }
    }

    pub(super) fn put(self, data: &mut [u8; DATA_LEN]) {
        field::TEMPERATURE.put(data, self.temperature.0.to_le_bytes());
        field::CURRENT.put(data, self.current.0.to_le_bytes());
        field::SPEED.put(data, self.speed.0.to_le_bytes());
        field::ANGLE.put(data, self.angle.0.to_le_bytes());
    }

    pub(super) fn check(&self) -> Result<(), EncodeError> {
        let angle = i64::from(self.angle.0);
        check_range("angle", angle, i64::from(field::ANGLE_MIN), i64::from(field::ANGLE_MAX))
    }

    pub(super) fn visit(&self, visit: &mut Visit<'_>) {
        f::TEMPERATURE.visit_count(visit, self.temperature.0);
        f::CURRENT.visit_count(visit, self.current.0);
        f::MEASURED_SPEED.visit_count(visit, self.speed.0);
        f::MEASURED_ANGLE.visit_count(visit, self.angle.0);
    }
}
