//! Physical values as the integers of a wire, rounded; a value beyond the integer's range becomes
//! its end, as in a motor's own arithmetic.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts from floats saturate"
)]

pub(super) fn to_i8(value: f64) -> i8 {
    value.round() as i8
}

pub(super) fn to_i16(value: f64) -> i16 {
    value.round() as i16
}

/// Starts again at the other end.
pub(super) fn to_wrapped_i16(value: f64) -> i16 {
    value.round() as i64 as i16
}

pub(super) fn to_u16(value: f64) -> u16 {
    value.round() as u16
}

pub(super) fn to_i32(value: f64) -> i32 {
    value.round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_and_saturate() {
        assert_eq!((to_i16(1.5), to_i16(-1.4), to_i16(1e9)), (2, -1, i16::MAX));
        assert_eq!((to_u16(-3.0), to_i8(-200.0), to_i32(2.0e10)), (0, i8::MIN, i32::MAX));
        assert_eq!((to_wrapped_i16(32_768.0), to_wrapped_i16(-65_537.0)), (i16::MIN, -1));
    }
}
