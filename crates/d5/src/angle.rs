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

#[cfg(test)]
mod tests {
    use super::*;

    /// D5 manual, common commands, row 5: bytes `83 AB` are −21629°.
    #[test]
    fn the_angle_is_twos_complement() {
        assert_eq!(decode_angle(u16::from_le_bytes([0x83, 0xAB])), Degrees(-21_629));
        assert_eq!(encode_angle(Degrees(-21_629)).map(u16::to_le_bytes), Ok([0x83, 0xAB]));
        assert_eq!(encode_angle(Degrees(1)).map(u16::to_le_bytes), Ok([0x01, 0x00]));
    }

    /// D5 manual, register 0x28: −32767..=32767.
    #[test]
    fn the_angle_ends_at_32767() {
        let refused =
            EncodeError::OutOfRange { field: "angle", value: -32_768, min: -32_767, max: 32_767 };
        assert_eq!(encode_angle(Degrees(-32_768)), Err(refused));
        assert_eq!(decode_angle(0x8000), Degrees(-32_768));
    }
}
