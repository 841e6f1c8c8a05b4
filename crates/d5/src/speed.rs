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

#[cfg(test)]
mod tests {
    use super::*;

    /// D5 manual, common commands, rows 2 and 3: bytes `58 02` and `58 82`.
    #[test]
    fn counter_clockwise_is_positive() {
        assert_eq!(encode_speed(DegreesPerSecond(600)).map(u16::to_le_bytes), Ok([0x58, 0x02]));
        assert_eq!(encode_speed(DegreesPerSecond(-600)).map(u16::to_le_bytes), Ok([0x58, 0x82]));
        assert_eq!(decode_speed(u16::from_le_bytes([0x58, 0x02])), DegreesPerSecond(600));
        assert_eq!(decode_speed(u16::from_le_bytes([0x58, 0x82])), DegreesPerSecond(-600));
    }

    /// D5 manual, frame format: the example says 60 °/s, its bytes `60 80` mean 96.
    #[test]
    fn the_bytes_of_the_60_degree_example_mean_96() {
        assert_eq!(decode_speed(u16::from_le_bytes([0x60, 0x80])), DegreesPerSecond(-96));
    }

    /// D5 manual, common commands, row 3: a direction without magnitude is standstill.
    #[test]
    fn both_zeros_are_standstill() {
        assert_eq!(decode_speed(u16::from_le_bytes([0x00, 0x80])), DegreesPerSecond(0));
        assert_eq!(encode_speed(DegreesPerSecond(0)).map(u16::to_le_bytes), Ok([0x00, 0x00]));
    }

    /// D5 manual, register 0x20: 15 bits of magnitude.
    #[test]
    fn the_magnitude_has_15_bits() {
        assert_eq!(encode_speed(DegreesPerSecond(32_767)).map(u16::to_le_bytes), Ok([0xFF, 0x7F]));
        assert_eq!(encode_speed(DegreesPerSecond(-32_767)).map(u16::to_le_bytes), Ok([0xFF, 0xFF]));
        assert_eq!(decode_speed(0xFFFF), DegreesPerSecond(-32_767));
        let refused =
            EncodeError::OutOfRange { field: "speed", value: -32_768, min: -32_767, max: 32_767 };
        assert_eq!(encode_speed(DegreesPerSecond(-32_768)), Err(refused));
    }
}
