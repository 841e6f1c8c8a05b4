//! The travelled angle of register 0x28: two's complement, unlike the speed.

use codec::check_range;

use crate::error::EncodeError;
use crate::units::Degrees;

/// Largest angle in either direction, in degrees (D5 manual, common commands, row 5).
pub const ANGLE_MAX: i16 = 32_767;

/// The angle word; −32768 lies outside the manual's range.
pub fn encode_angle(angle: Degrees) -> Result<u16, EncodeError> {
    let max = i64::from(ANGLE_MAX);
    check_range("angle", i64::from(angle.0), -max, max)?;
    Ok(u16::from_le_bytes(angle.0.to_le_bytes()))
}

/// The angle of a word.
pub fn decode_angle(word: u16) -> Degrees {
    Degrees(i16::from_le_bytes(word.to_le_bytes()))
}
