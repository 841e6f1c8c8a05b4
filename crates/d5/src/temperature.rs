//! The temperature byte of registers 0x0B, 0x2E and 0x2F: bit 7 is the sign, the other 7 bits the
//! magnitude in °C.

use codec::check_range;

use crate::error::EncodeError;
use crate::units::Celsius;

/// Bit 7: set is below zero. Stated for register 0x0B, taken to hold for 0x2E and 0x2F as well.
const BELOW_ZERO: u8 = 0x80;
/// Highest magnitude of the byte in °C.
pub const TEMPERATURE_MAX: i8 = 0x7F;

/// The temperature byte; −128 has none.
pub fn encode_temperature(temperature: Celsius) -> Result<u8, EncodeError> {
    let max = i64::from(TEMPERATURE_MAX);
    check_range("temperature", i64::from(temperature.0), -max, max)?;
    let sign = if temperature.0 < 0 { BELOW_ZERO } else { 0 };
    Ok(sign | temperature.0.unsigned_abs())
}

/// The temperature of a byte; both zeros, `0x00` and `0x80`, are 0.
pub fn decode_temperature(byte: u8) -> Celsius {
    // 7 bits always fit, so the fallback is never used.
    let magnitude = i8::try_from(byte & !BELOW_ZERO).unwrap_or(TEMPERATURE_MAX);
    Celsius(if byte & BELOW_ZERO == 0 { magnitude } else { -magnitude })
}
