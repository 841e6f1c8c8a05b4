//! SI units against the manuals' units: the only place that knows both.
//!
//! Rounding is to the nearest wire unit, ties away from zero, once; where that lies beyond a limit
//! of the axis which the value keeps, it is the unit before. A value that the wire cannot carry
//! gives `None`, never a clamped value; NaN and infinities give `None`. The axis's direction is
//! applied in [`Scale::turned`].
//!
//! Multi-turn counts exceed the 24 bits that f32 keeps, and the boards' processors compute f64 in
//! software or not at all; so the products are integers of 64 bits, and f64 is left to the
//! compiler.

use crate::config::AxisConfig;
use core::f64::consts::PI;
use host_protocol::{AxisParameter, Error, Quantity};

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
pub(super) struct Scale {
    /// 40 bits: with the 24 of an f32 the product fills a u64.
    per_si: Factor,
    /// 32 bits: with the 31 of a wire count the product stays below a u64.
    in_si: Factor,
}

impl Scale {
    const fn new(per_si: f64) -> Self {
        Self { per_si: Factor::new(per_si, 40), in_si: Factor::new(1.0 / per_si, 32) }
    }

    /// The wire units nearest to `value`; `None` where an `i32` cannot hold them.
    pub fn nearest(&self, value: f32) -> Option<i32> {
        let bits = value.to_bits();
        let exponent = (bits >> FRACTION_BITS) & EXPONENT_MASK;
        let fraction = bits & ((1 << FRACTION_BITS) - 1);
        if exponent == EXPONENT_MASK {
            return None;
        }
        // Subnormal numbers have the exponent of the smallest normal ones, without the leading 1.
        let mantissa = if exponent == 0 { fraction } else { fraction | 1 << FRACTION_BITS };
        let exponent = exponent.max(1).cast_signed() - EXPONENT_BIAS - FRACTION_BITS.cast_signed();
        let product = u64::from(mantissa) * self.per_si.mantissa;
        let magnitude = round_shift(product, exponent + self.per_si.exponent)?;
        let count = i64::try_from(magnitude).ok()?;
        i32::try_from(if value.is_sign_negative() { -count } else { count }).ok()
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
    pub fn to_si(&self, count: impl Into<i32>) -> f32 {
        self.count_to_si(count.into())
    }

    #[inline(never)]
    fn count_to_si(&self, count: i32) -> f32 {
        let product = u64::from(count.unsigned_abs()) * self.in_si.mantissa;
        let (highest, places) = highest_bits(product);
        let exponent = self.in_si.exponent + EXPONENT_BIAS + places;
        #[allow(clippy::cast_precision_loss)]
        let magnitude = highest as f32 * f32::from_bits(exponent.cast_unsigned() << FRACTION_BITS);
        if count < 0 { -magnitude } else { magnitude }
    }

    /// `value` as the type that the wire has, in the motor's sense of rotation; refused beyond
    /// `most` to either side.
    pub fn turned<T: TryFrom<i32>>(
        &self,
        quantity: Quantity,
        value: f32,
        limits: (f32, f32),
        most: impl Into<i32>,
        config: &AxisConfig,
    ) -> Result<T, Error> {
        let count = self.within(value, limits);
        let turned = if config.sign() < 0.0 { count.and_then(i32::checked_neg) } else { count };
        let range = || {
            let most = self.to_si(most);
            (-most, most)
        };
        fit(turned, quantity, value, range)
    }
}

/// The 32 highest bits of a product, the lowest of which stands for all behind it, and how many
/// those are: the processor makes an f32 of 32 bits, and of 64 a library does.
#[allow(clippy::cast_possible_truncation)]
fn highest_bits(product: u64) -> (u32, i32) {
    let places = u32::BITS - ((product >> u32::BITS) as u32).leading_zeros();
    let highest = (product >> places) as u32;
    let has_more = u64::from(highest) << places != product;
    (highest | u32::from(has_more), places.cast_signed())
}

/// Degrees in one radian.
const DEGREES_PER_RAD: f64 = 180.0 / PI;
/// ° in one rad, and °/s in one rad/s (RMD speed limits, D5 speeds).
pub(super) static DEGREES: Scale = Scale::new(DEGREES_PER_RAD);
/// 0.1° in one rad (thruster positions).
pub(super) static DECIDEGREES: Scale = Scale::new(DEGREES_PER_RAD * 10.0);
/// 0.01° in one rad (RMD positions), and 0.01 °/s in one rad/s (RMD 0xA2).
pub(super) static CENTIDEGREES: Scale = Scale::new(DEGREES_PER_RAD * 100.0);
/// Revolutions per minute in one rad/s.
pub(super) static RPM: Scale = Scale::new(60.0 / (2.0 * PI));
/// 0.1 A in one A, 0.1 V in one V.
pub(super) static TENTHS: Scale = Scale::new(10.0);
/// 0.01 A in one A, and percent in one full signal.
pub(super) static HUNDREDTHS: Scale = Scale::new(100.0);

/// The parts of an f32: bits of its fraction, what its exponent is counted from, and the exponent
/// of NaN and infinity.
const FRACTION_BITS: u32 = 23;
const EXPONENT_BIAS: i32 = 127;
const EXPONENT_MASK: u32 = 0xFF;

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

/// Speed limit and target of a position command, in the motor's units and sense of rotation. A speed
/// limit is never rounded up, and 0 is none.
pub(super) fn position(
    axis: u8,
    speed_limit_rad_s: f32,
    speed: &Scale,
    position_rad: f32,
    angle: &Scale,
    config: &AxisConfig,
) -> Result<(u16, i32), Error> {
    if speed_limit_rad_s == 0.0 {
        return Err(Error::SpeedLimitZero { axis });
    }
    // As exact as an f32 that was computed from the motor's unit.
    let own = speed_limit_rad_s * (1.0 + 4.0 * f32::EPSILON);
    let fastest = config.limit(AxisParameter::VelocityLimitRadS);
    let count = speed.within(speed_limit_rad_s, (0.0, own.min(fastest)));
    let count = count.filter(|count| *count > 0);
    let range = || {
        let least = speed.to_si(1);
        (least, speed.to_si(u16::MAX).min(fastest).max(least))
    };
    let limit: u16 = fit(count, Quantity::SpeedLimit, speed_limit_rad_s, range)?;
    let range = config.position_range();
    Ok((limit, angle.turned(Quantity::Position, position_rad, range, i32::MAX, config)?))
}

/// A wire count as the type the wire has, or the refusal that names the SI range that type can
/// carry, which is worked out only then.
fn fit<T: TryFrom<i32>>(
    count: Option<i32>,
    quantity: Quantity,
    value: f32,
    range: impl FnOnce() -> (f32, f32),
) -> Result<T, Error> {
    count.and_then(|count| T::try_from(count).ok()).ok_or_else(|| {
        let (min, max) = range();
        Error::OutOfRange { quantity, value, min, max }
    })
}

/// The word of `bits` bits, at most 16, for a value between the two ends of a range: the lower end
/// is 0, a whole range has 2^`bits` steps, and the upper end is the highest word. It is the nearest
/// that keeps the limits, if `value` does. `None` outside the range, for NaN, and where no word
/// lies within the limits.
pub(super) fn to_span(value: f32, range: (f32, f32), bits: u32, limits: (f32, f32)) -> Option<u16> {
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
pub(super) fn from_span(word: u16, range: (f32, f32), divisor: f32) -> f32 {
    let (min, max) = range;
    f32::from(word) / divisor * (max - min) + min
}

#[cfg(test)]
#[path = "../../tests/unit/convert.rs"]
mod tests;
