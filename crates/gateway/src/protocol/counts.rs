//! Values of SI units as the counts of a manual, or the refusal that names the range in SI units.

use super::convert::Scale;
use crate::axis::AxisConfig;
use host_protocol::{AxisParameter, Error, Quantity};

/// Speed limit and target of a position command, in the motor's units and sense of rotation. 0 is
/// no speed limit.
pub(super) fn position(
    axis: u8,
    speed_limit_rad_s: f32,
    speed: &Scale,
    position_rad: f32,
    angle: &Scale,
    config: &AxisConfig,
) -> Result<(u16, i32), Error> {
    let fastest = speed.to_si(i32::from(u16::MAX));
    let count =
        speed.within(speed_limit_rad_s, (0.0, config.limit(AxisParameter::VelocityLimitRadS)));
    let limit: u16 = fit(count, Quantity::SpeedLimit, speed_limit_rad_s, (0.0, fastest))?;
    if limit == 0 {
        return Err(Error::SpeedLimitZero { axis });
    }
    let furthest = angle.to_si(i32::MAX);
    let count = turned(angle.within(position_rad, config.position_range()), config);
    Ok((limit, fit(count, Quantity::Position, position_rad, (-furthest, furthest))?))
}

/// A count in the motor's sense of rotation.
pub(super) fn turned(count: Option<i32>, config: &AxisConfig) -> Option<i32> {
    if config.sign() < 0.0 { count?.checked_neg() } else { count }
}

/// A wire count as the type the wire has, or the refusal that names the SI range that type can
/// carry.
pub(super) fn fit<T: TryFrom<i32>>(
    count: Option<i32>,
    quantity: Quantity,
    value: f32,
    range: (f32, f32),
) -> Result<T, Error> {
    let out_of_range = Error::OutOfRange { quantity, value, min: range.0, max: range.1 };
    count.and_then(|count| T::try_from(count).ok()).ok_or(out_of_range)
}
