//! SI units against the manuals' units: the only place that knows both.
//!
//! Rounding is to the nearest wire unit, ties away from zero, once; where that lies beyond a limit
//! of the axis which the value keeps, it is the unit before. A value that the wire cannot carry
//! gives `None`, never a clamped value; NaN and infinities give `None`. The axis's direction is
//! applied by the callers in `motor`.
//!
//! Multi-turn counts exceed the 24 bits that f32 keeps, and the boards' processors compute f64 in
//! software or not at all; so the products are integers of 64 bits, and f64 is left to the
//! compiler.

use core::f64::consts::PI;

/// A positive factor, `mantissa` × 2^`exponent`.
#[derive(Debug, Clone, Copy)]
struct Factor {
    mantissa: u64,
    exponent: i32,
}

impl Factor {
    /// `value` with a mantissa of `bits` bits, at most 51.
    const fn new(value: f64, bits: u32) -> Self {
        assert!(value > 0.0 && bits <= 51);
        let limit = (1u64 << bits) as f64;
        let (mut mantissa, mut exponent) = (value, 0);
        while mantissa < limit / 2.0 {
            mantissa *= 2.0;
            exponent -= 1;
        }
        while mantissa >= limit {
            mantissa /= 2.0;
            exponent += 1;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        Self { mantissa: (mantissa + 0.5) as u64, exponent }
    }
}

/// How many wire units one SI unit is.
pub(crate) struct Scale {
    /// 40 bits: with the 24 of an f32 the product fills a u64.
    per_si: Factor,
    /// 32 bits: with the 31 of a wire count the product stays below a u64.
    in_si: Factor,
}

impl Scale {
    const fn new(per_si: f64) -> Self {
        Self { per_si: Factor::new(per_si, 40), in_si: Factor::new(1.0 / per_si, 32) }
    }

    /// The wire units nearest to `value`.
    pub fn nearest(&self, value: f32) -> Option<i32> {
        to_wire(value, self)
    }

    /// The wire units nearest to `value` that keep the limits, lowest and highest, if `value` does
    /// (GUARANTEES G2).
    pub fn within(&self, value: f32, (min, max): (f32, f32)) -> Option<i32> {
        let nearest = self.nearest(value)?;
        if value > max || value < min {
            return Some(nearest);
        }
        let kept = if self.to_si(nearest) > max {
            nearest.checked_sub(1)?
        } else if self.to_si(nearest) < min {
            nearest.checked_add(1)?
        } else {
            nearest
        };
        (min..=max).contains(&self.to_si(kept)).then_some(kept)
    }

    /// SI units for `count` wire units.
    pub fn to_si(&self, count: i32) -> f32 {
        from_wire(count, self)
    }
}

/// Degrees in one radian.
const DEGREES_PER_RAD: f64 = 180.0 / PI;
/// ° in one rad, and °/s in one rad/s (RMD speed limits, D5 speeds).
pub(crate) const DEGREES: Scale = Scale::new(DEGREES_PER_RAD);
/// 0.1° in one rad (thruster positions).
pub(crate) const DECIDEGREES: Scale = Scale::new(DEGREES_PER_RAD * 10.0);
/// 0.01° in one rad (RMD positions), and 0.01 °/s in one rad/s (RMD 0xA2).
pub(crate) const CENTIDEGREES: Scale = Scale::new(DEGREES_PER_RAD * 100.0);
/// Revolutions per minute in one rad/s.
pub(crate) const RPM: Scale = Scale::new(60.0 / (2.0 * PI));
const TENTHS: Scale = Scale::new(10.0);
/// 0.01 A in one A, and percent in one full signal.
pub(crate) const HUNDREDTHS: Scale = Scale::new(100.0);

/// The parts of an f32: bits of its fraction, what its exponent is counted from, and the exponent
/// of NaN and infinity.
const FRACTION_BITS: u32 = 23;
const EXPONENT_BIAS: i32 = 127;
const EXPONENT_MASK: u32 = 0xFF;

/// Wire units for `value` SI units; `None` where an `i32` cannot hold them.
fn to_wire(value: f32, scale: &Scale) -> Option<i32> {
    let bits = value.to_bits();
    let exponent = (bits >> FRACTION_BITS) & EXPONENT_MASK;
    let fraction = bits & ((1 << FRACTION_BITS) - 1);
    if exponent == EXPONENT_MASK {
        return None;
    }
    // Subnormal numbers have the exponent of the smallest normal ones, without the leading 1.
    let mantissa = if exponent == 0 { fraction } else { fraction | 1 << FRACTION_BITS };
    let exponent = exponent.max(1).cast_signed() - EXPONENT_BIAS - FRACTION_BITS.cast_signed();
    let product = u64::from(mantissa) * scale.per_si.mantissa;
    let magnitude = round_shift(product, exponent + scale.per_si.exponent)?;
    let count = i64::try_from(magnitude).ok()?;
    i32::try_from(if value.is_sign_negative() { -count } else { count }).ok()
}

/// `product` × 2^`exponent`, rounded half up; `None` where that exceeds a u64.
fn round_shift(product: u64, exponent: i32) -> Option<u64> {
    if product == 0 {
        return Some(0);
    }
    if exponent >= 0 {
        return product
            .checked_shl(exponent.unsigned_abs())
            .filter(|shifted| shifted >> exponent == product);
    }
    let half = exponent.unsigned_abs() - 1;
    // Halves and whole units below the point: one bit more than the result.
    let halves = product.checked_shr(half).unwrap_or(0);
    Some(halves / 2 + halves % 2)
}

/// SI units for `count` wire units.
fn from_wire(count: i32, scale: &Scale) -> f32 {
    let product = u64::from(count.unsigned_abs()) * scale.in_si.mantissa;
    let power = (scale.in_si.exponent + EXPONENT_BIAS).cast_unsigned() << FRACTION_BITS;
    #[allow(clippy::cast_precision_loss)]
    let magnitude = product as f32 * f32::from_bits(power);
    if count < 0 { -magnitude } else { magnitude }
}

/// 0.01° → rad.
pub(crate) fn centidegrees_to_rad(centidegrees: i32) -> f32 {
    from_wire(centidegrees, &CENTIDEGREES)
}

/// 0.1° → rad.
pub(crate) fn decidegrees_to_rad(decidegrees: i32) -> f32 {
    from_wire(decidegrees, &DECIDEGREES)
}

/// ° → rad, and °/s → rad/s.
pub(crate) fn degrees_to_rad(degrees: i32) -> f32 {
    from_wire(degrees, &DEGREES)
}

/// rpm → rad/s.
pub(crate) fn rpm_to_rad_s(rpm: i32) -> f32 {
    from_wire(rpm, &RPM)
}

/// 0.01 A → A.
pub(crate) fn from_hundredths(count: i32) -> f32 {
    from_wire(count, &HUNDREDTHS)
}

/// 0.1 A → A, 0.1 V → V.
pub(crate) fn from_tenths(count: i32) -> f32 {
    from_wire(count, &TENTHS)
}

/// The word of `bits` bits, at most 16, for a value between the two ends of a range: the lower end
/// is 0, a whole range has 2^`bits` steps, and the upper end is the highest word. It is the nearest
/// that keeps the limits, if `value` does. `None` outside the range, for NaN, and where no word
/// lies within the limits.
pub(crate) fn to_span(value: f32, range: (f32, f32), bits: u32, limits: (f32, f32)) -> Option<u16> {
    let (min, max) = range;
    if !(min..=max).contains(&value) {
        return None;
    }
    #[allow(clippy::cast_precision_loss)]
    let steps = (1u32 << bits) as f32;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let nearest = ((value - min) * (steps / (max - min)) + 0.5) as u32;
    let nearest = u16::try_from(nearest.min((1 << bits) - 1)).ok()?;
    let (lowest, highest) = limits;
    if value > highest || value < lowest {
        return Some(nearest);
    }
    let stands_for = |word| from_span(word, range, steps);
    let kept = if stands_for(nearest) > highest {
        nearest.checked_sub(1)?
    } else if stands_for(nearest) < lowest {
        nearest.checked_add(1).filter(|word| u32::from(*word) < 1 << bits)?
    } else {
        nearest
    };
    (lowest..=highest).contains(&stands_for(kept)).then_some(kept)
}

/// The value between the two ends of a range that a word stands for: `divisor` is the word of the
/// upper end.
pub(crate) fn from_span(word: u16, range: (f32, f32), divisor: f32) -> f32 {
    let (min, max) = range;
    f32::from(word) / divisor * (max - min) + min
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNLIMITED: (f32, f32) = (f32::NEG_INFINITY, f32::INFINITY);

    #[test]
    fn rounds_to_the_nearest_wire_unit() {
        assert_eq!(HUNDREDTHS.nearest(1.0), Some(100));
        assert_eq!(HUNDREDTHS.nearest(0.014_9), Some(1));
        assert_eq!(HUNDREDTHS.nearest(0.015_1), Some(2));
        assert_eq!(HUNDREDTHS.nearest(-0.05), Some(-5));
        assert_eq!(HUNDREDTHS.nearest(-0.004), Some(0));
        assert_eq!(CENTIDEGREES.nearest(core::f32::consts::PI), Some(18_000));
        assert_eq!(DEGREES.nearest(10.471_976), Some(600));
        assert_eq!(RPM.nearest(core::f32::consts::PI), Some(30));
        assert_eq!(DECIDEGREES.nearest(-core::f32::consts::FRAC_PI_2), Some(-900));
    }

    #[test]
    fn what_the_wire_cannot_carry_is_refused_not_clamped() {
        assert_eq!(HUNDREDTHS.nearest(f32::NAN), None);
        assert_eq!(HUNDREDTHS.nearest(f32::INFINITY), None);
        assert_eq!(HUNDREDTHS.nearest(f32::NEG_INFINITY), None);
        assert_eq!(CENTIDEGREES.nearest(4.0e5), None); // 2.29e9 hundredths of a degree: beyond i32
        assert_eq!(CENTIDEGREES.nearest(-3.7e5), Some(-2_119_943_842));
    }

    #[test]
    fn the_ends_of_the_wire_and_of_f32_are_exact() {
        assert_eq!(HUNDREDTHS.nearest(f32::MIN_POSITIVE / 2.0), Some(0));
        assert_eq!(HUNDREDTHS.nearest(f32::MAX), None);
        assert_eq!(HUNDREDTHS.nearest(-0.0), Some(0));
        assert_eq!(HUNDREDTHS.nearest(0.005), Some(0)); // the f32 lies below the tie
        assert_eq!(HUNDREDTHS.nearest(21_474_836.0), Some(2_147_483_600));
        assert_eq!(HUNDREDTHS.nearest(21_474_838.0), None);
        assert_eq!(HUNDREDTHS.nearest(-21_474_836.0), Some(-2_147_483_600));
        assert_eq!(to_wire(0.5, &Scale::new(1.0)), Some(1)); // ties go away from zero
        assert_eq!(to_wire(-0.5, &Scale::new(1.0)), Some(-1));
        assert_eq!(to_wire(-2_147_483_648.0, &Scale::new(1.0)), Some(i32::MIN));
        assert_eq!(to_wire(2_147_483_648.0, &Scale::new(1.0)), None);
    }

    #[test]
    fn agrees_with_f64_over_the_whole_range() {
        let mut bits = 0x9E37_79B9u32;
        for _ in 0..200_000 {
            bits ^= bits << 13;
            bits ^= bits >> 17;
            bits ^= bits << 5;
            let count = bits.cast_signed();
            #[allow(clippy::cast_possible_truncation)]
            let expected = (f64::from(count) / (DEGREES_PER_RAD * 100.0)) as f32;
            let rad = centidegrees_to_rad(count);
            assert!(
                (rad - expected).abs() <= expected.abs() * f32::EPSILON,
                "{count}: {rad} {expected}"
            );
            let exact = f64::from(rad) * (DEGREES_PER_RAD * 100.0);
            match CENTIDEGREES.nearest(rad) {
                Some(back) => {
                    assert!((f64::from(back) - exact).abs() <= 0.505, "{rad}: {back} {exact}")
                }
                None => assert!(exact.abs() >= f64::from(i32::MAX), "{rad}: {exact}"),
            }
        }
    }

    #[test]
    fn what_rounding_pushes_beyond_a_limit_stays_on_its_inner_side() {
        assert_eq!(DEGREES.within(0.009, (-0.009, 0.009)), Some(0));
        assert_eq!(DEGREES.within(-0.009, (-0.009, 0.009)), Some(0));
        assert_eq!(DEGREES.within(0.009, (-1.0, 1.0)), Some(1));
        assert_eq!(HUNDREDTHS.within(0.7, (-0.7, 0.7)), Some(70)); // the f32 lies below 0.7
        assert_eq!(HUNDREDTHS.within(0.128, (0.128, 1.0)), Some(13));
        assert_eq!(HUNDREDTHS.within(0.124, (0.124, 1.0)), Some(13));
        assert_eq!(HUNDREDTHS.within(-0.124, (-1.0, -0.124)), Some(-13));
        assert_eq!(HUNDREDTHS.within(0.124, (0.123, 0.126)), None); // no unit lies between
        assert_eq!(HUNDREDTHS.within(3.0, (-1.0, 1.0)), Some(300)); // not for this to refuse
        assert_eq!(to_span(10.0, (-24.0, 24.0), 12, (-10.0, 10.0)), Some(0xB55));
        assert_eq!(to_span(10.007, (-24.0, 24.0), 12, (-10.007, 10.007)), Some(0xB55));
        assert_eq!(to_span(10.007, (-24.0, 24.0), 12, UNLIMITED), Some(0xB56));
        assert_eq!(to_span(-10.007, (-24.0, 24.0), 12, (-10.007, 10.007)), Some(0x4AB));
        assert_eq!(to_span(-10.007, (-24.0, 24.0), 12, UNLIMITED), Some(0x4AA));
    }

    #[test]
    fn a_span_reaches_from_the_first_word_to_the_last() {
        assert_eq!(to_span(-24.0, (-24.0, 24.0), 12, UNLIMITED), Some(0));
        assert_eq!(to_span(0.0, (-24.0, 24.0), 12, UNLIMITED), Some(0x800));
        assert_eq!(to_span(24.0, (-24.0, 24.0), 12, UNLIMITED), Some(0xFFF));
        assert_eq!(to_span(12.5, (-12.5, 12.5), 16, UNLIMITED), Some(0xFFFF));
        assert_eq!(to_span(24.01, (-24.0, 24.0), 12, UNLIMITED), None);
        assert_eq!(to_span(f32::NAN, (-24.0, 24.0), 12, UNLIMITED), None);
        assert_eq!(from_span(0, (-24.0, 24.0), 4095.0), -24.0);
        assert_eq!(from_span(0xFFF, (-24.0, 24.0), 4095.0), 24.0);
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
