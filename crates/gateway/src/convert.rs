//! SI units against the manuals' units: the only place that knows both.
//!
//! Rounding is to the nearest wire unit, ties away from zero, once: products are taken in f64, because multi-turn counts
//! exceed the 24 bits that f32 keeps. A value that the wire cannot carry gives `None`, never a clamped value; NaN and
//! infinities give `None`. The axis's direction is applied by the callers in `motor`.

use core::f64::consts::PI;

/// Degrees in one radian.
const DEGREES: f64 = 180.0 / PI;
/// Revolutions per minute in one rad/s.
const RPM: f64 = 60.0 / (2.0 * PI);

/// Wire units for `value` SI units at `per_si` wire units each; `None` where an `i32` cannot hold them.
fn to_wire(value: f32, per_si: f64) -> Option<i32> {
    let count = libm::round(f64::from(value) * per_si);
    if count >= f64::from(i32::MIN) && count <= f64::from(i32::MAX) {
        // In range by the comparison above, which NaN fails.
        #[allow(clippy::cast_possible_truncation)]
        return Some(count as i32);
    }
    None
}

/// SI units for `count` wire units at `per_si` wire units each.
fn from_wire(count: i32, per_si: f64) -> f32 {
    #[allow(clippy::cast_possible_truncation)]
    let value = (f64::from(count) / per_si) as f32;
    value
}

/// rad → 0.01° (RMD positions), and rad/s → 0.01 °/s (RMD 0xA2).
pub(crate) fn rad_to_centidegrees(rad: f32) -> Option<i32> {
    to_wire(rad, DEGREES * 100.0)
}

/// 0.01° → rad.
pub(crate) fn centidegrees_to_rad(centidegrees: i32) -> f32 {
    from_wire(centidegrees, DEGREES * 100.0)
}

/// rad → 0.1° (thruster positions).
pub(crate) fn rad_to_decidegrees(rad: f32) -> Option<i32> {
    to_wire(rad, DEGREES * 10.0)
}

/// 0.1° → rad.
pub(crate) fn decidegrees_to_rad(decidegrees: i32) -> f32 {
    from_wire(decidegrees, DEGREES * 10.0)
}

/// rad → °, and rad/s → °/s (RMD speed limits, D5 speeds).
pub(crate) fn rad_to_degrees(rad: f32) -> Option<i32> {
    to_wire(rad, DEGREES)
}

/// ° → rad, and °/s → rad/s.
pub(crate) fn degrees_to_rad(degrees: i32) -> f32 {
    from_wire(degrees, DEGREES)
}

/// rad/s → rpm.
pub(crate) fn rad_s_to_rpm(rad_s: f32) -> Option<i32> {
    to_wire(rad_s, RPM)
}

/// rpm → rad/s.
pub(crate) fn rpm_to_rad_s(rpm: i32) -> f32 {
    from_wire(rpm, RPM)
}

/// A → 0.01 A, and fractions of full signal → percent.
pub(crate) fn to_hundredths(value: f32) -> Option<i32> {
    to_wire(value, 100.0)
}

/// 0.01 A → A.
pub(crate) fn from_hundredths(count: i32) -> f32 {
    from_wire(count, 100.0)
}

/// 0.1 A → A, 0.1 V → V.
pub(crate) fn from_tenths(count: i32) -> f32 {
    from_wire(count, 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_to_the_nearest_wire_unit() {
        assert_eq!(to_hundredths(1.0), Some(100));
        assert_eq!(to_hundredths(0.014_9), Some(1));
        assert_eq!(to_hundredths(0.015_1), Some(2));
        assert_eq!(to_hundredths(-0.05), Some(-5));
        assert_eq!(to_hundredths(-0.004), Some(0));
        assert_eq!(rad_to_centidegrees(core::f32::consts::PI), Some(18_000));
        assert_eq!(rad_to_degrees(10.471_976), Some(600));
        assert_eq!(rad_s_to_rpm(core::f32::consts::PI), Some(30));
        assert_eq!(rad_to_decidegrees(-core::f32::consts::FRAC_PI_2), Some(-900));
    }

    #[test]
    fn what_the_wire_cannot_carry_is_refused_not_clamped() {
        assert_eq!(to_hundredths(f32::NAN), None);
        assert_eq!(to_hundredths(f32::INFINITY), None);
        assert_eq!(to_hundredths(f32::NEG_INFINITY), None);
        assert_eq!(rad_to_centidegrees(4.0e5), None); // 2.29e9 hundredths of a degree: beyond i32
        assert_eq!(rad_to_centidegrees(-3.7e5), Some(-2_119_943_842));
    }

    #[test]
    fn wire_units_come_back_in_si() {
        assert_eq!(centidegrees_to_rad(18_000), core::f32::consts::PI);
        assert_eq!(degrees_to_rad(-180), -core::f32::consts::PI);
        assert_eq!(rpm_to_rad_s(30), core::f32::consts::PI);
        assert_eq!(decidegrees_to_rad(900), core::f32::consts::FRAC_PI_2);
        assert_eq!(from_hundredths(-150), -1.5);
        assert_eq!(from_tenths(241), 24.1);
    }
}
