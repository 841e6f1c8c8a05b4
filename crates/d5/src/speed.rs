//! The speed word of registers 0x20 and 0x26: bit 15 is the direction, the other 15 bits the
//! magnitude in °/s.

use codec::check_range;

use crate::error::EncodeError;
use crate::units::DegreesPerSecond;

/// Bit 15: set is clockwise (D5 manual, common commands, row 3).
const CLOCKWISE: u16 = 0x8000;
/// Highest magnitude of the word in °/s.
pub const SPEED_MAX: i16 = 0x7FFF;

/// The speed word; −32768 has none.
pub fn encode_speed(speed: DegreesPerSecond) -> Result<u16, EncodeError> {
    let max = i64::from(SPEED_MAX);
    check_range("speed", i64::from(speed.0), -max, max)?;
    let direction = if speed.0 < 0 { CLOCKWISE } else { 0 };
    Ok(direction | speed.0.unsigned_abs())
}

/// The speed of a word; both zeros, `0x0000` and `0x8000`, are 0.
pub fn decode_speed(word: u16) -> DegreesPerSecond {
    // 15 bits always fit, so the fallback is never used.
    let magnitude = i16::try_from(word & !CLOCKWISE).unwrap_or(SPEED_MAX);
    DegreesPerSecond(if word & CLOCKWISE == 0 { magnitude } else { -magnitude })
}
