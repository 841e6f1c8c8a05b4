//! Values of SI units as the counts of a manual, or the refusal that names the range in SI units.

use host_protocol::{Error, Quantity};

/// A unit of a manual: from SI units and back.
pub(super) struct Unit {
    pub from_si: fn(f32) -> Option<i32>,
    pub to_si: fn(i32) -> f32,
}

/// Speed limit and target of a position command, in the motor's units and sense of rotation. 0 is no speed limit.
pub(super) fn position(
    axis: u8,
    speed_limit_rad_s: f32,
    speed: &Unit,
    sign: f32,
    position_rad: f32,
    angle: &Unit,
) -> Result<(u16, i32), Error> {
    let fastest = (speed.to_si)(i32::from(u16::MAX));
    let count = (speed.from_si)(speed_limit_rad_s);
    let limit: u16 = fit(count, Quantity::SpeedLimit, speed_limit_rad_s, (0.0, fastest))?;
    if limit == 0 {
        return Err(Error::SpeedLimitZero { axis });
    }
    let furthest = (angle.to_si)(i32::MAX);
    let count = (angle.from_si)(sign * position_rad);
    Ok((limit, fit(count, Quantity::Position, position_rad, (-furthest, furthest))?))
}

/// A wire count as the type the wire has, or the refusal that names the SI range that type can carry.
pub(super) fn fit<T: TryFrom<i32>>(
    count: Option<i32>,
    quantity: Quantity,
    value: f32,
    range: (f32, f32),
) -> Result<T, Error> {
    let out_of_range = Error::OutOfRange { quantity, value, min: range.0, max: range.1 };
    count.and_then(|count| T::try_from(count).ok()).ok_or(out_of_range)
}
