//! RMD motion mode: impedance setpoints as the packed words of RMD V3.6 §5, in the ranges that the
//! axis states.

use super::convert;
use crate::axis::{AxisConfig, Observation};
use host_protocol::{AxisParameter, Error, Quantity, Setpoint};
use rmd::{MotionCommand, MotionFeedback};

/// Bits of the position word, and of the others.
const POSITION_BITS: u32 = 16;
const WORD_BITS: u32 = 12;
/// The divisors with which the manual reads the words back (RMD V3.6 §5.4).
const WORD_DIVISOR: f32 = 4095.0;

/// The words of an impedance setpoint; any other setpoint asks for nothing.
pub(super) fn command(setpoint: Setpoint, config: &AxisConfig) -> Result<MotionCommand, Error> {
    let Setpoint::Impedance {
        position_rad,
        velocity_rad_s,
        stiffness_nm_per_rad,
        damping_nm_s_per_rad,
        torque_nm,
    } = setpoint
    else {
        return Ok(MotionCommand::NEUTRAL);
    };
    let two_sided = |quantity, value, parameter, bits, limits| {
        let end = config.float(parameter).unwrap_or(0.0);
        word(quantity, value, (-end, end), bits, limits, config.sign())
    };
    let gain = |quantity, value, parameter| {
        let end = config.float(parameter).unwrap_or(0.0);
        word(quantity, value, (0.0, end), WORD_BITS, (0.0, end), 1.0)
    };
    Ok(MotionCommand {
        position: two_sided(
            Quantity::Position,
            position_rad,
            AxisParameter::MotionPositionRad,
            POSITION_BITS,
            config.position_range(),
        )?,
        velocity: two_sided(
            Quantity::Velocity,
            velocity_rad_s,
            AxisParameter::MotionVelocityRadS,
            WORD_BITS,
            config.range(AxisParameter::VelocityLimitRadS),
        )?,
        kp: gain(Quantity::Stiffness, stiffness_nm_per_rad, AxisParameter::MotionStiffness)?,
        kd: gain(Quantity::Damping, damping_nm_s_per_rad, AxisParameter::MotionDamping)?,
        torque: two_sided(
            Quantity::Torque,
            torque_nm,
            AxisParameter::MotionTorqueNm,
            WORD_BITS,
            config.range(AxisParameter::TorqueLimitNm),
        )?,
    })
}

/// The word for a value in the axis's sense of rotation, or the refusal. The range is the same in
/// both senses, the limits are turned.
fn word(
    quantity: Quantity,
    value: f32,
    range: (f32, f32),
    bits: u32,
    limits: (f32, f32),
    sign: f32,
) -> Result<u16, Error> {
    let (min, max) = range;
    let limits = if sign < 0.0 { (-limits.1, -limits.0) } else { limits };
    let refused = Error::OutOfRange { quantity, value, min, max };
    convert::to_span(sign * value, range, bits, limits).ok_or(refused)
}

/// What a reply tells. Its position ends at the ends of its range and is left out: positions come
/// from 0x92.
pub(super) fn observe(feedback: &MotionFeedback, config: &AxisConfig) -> Observation {
    let read = |word, parameter| {
        let end = config.float(parameter)?;
        Some(config.sign() * convert::from_span(word, (-end, end), WORD_DIVISOR))
    };
    Observation {
        velocity_rad_s: read(feedback.velocity, AxisParameter::MotionVelocityRadS),
        torque_nm: read(feedback.torque, AxisParameter::MotionTorqueNm),
        ..Observation::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::Value;
    use rmd::{MotionRanges, MotionTarget};

    fn config(direction: i32) -> AxisConfig {
        let mut config = AxisConfig::new();
        config.set(AxisParameter::Direction, Value::Signed(direction)).unwrap();
        config
    }

    fn impedance(position_rad: f32, velocity_rad_s: f32, torque_nm: f32) -> Setpoint {
        Setpoint::Impedance {
            position_rad,
            velocity_rad_s,
            stiffness_nm_per_rad: 10.0,
            damping_nm_s_per_rad: 1.0,
            torque_nm,
        }
    }

    /// RMD V3.6 §5.4: 10 rad, 1 rad/s, kp 10, kd 1, 10 N·m in the manual's ranges.
    #[test]
    fn the_printed_request_comes_out() {
        let expected = MotionCommand {
            position: 0xE666,
            velocity: 0x82E,
            kp: 0x052,
            kd: 0x333,
            torque: 0xB55,
        };
        assert_eq!(command(impedance(10.0, 1.0, 10.0), &config(1)), Ok(expected));
        assert_eq!(command(impedance(-10.0, -1.0, -10.0), &config(-1)), Ok(expected));
    }

    #[test]
    fn agrees_with_the_codec_to_one_step() {
        let config = config(1);
        for step in 0..=1000i16 {
            let part = f32::from(step) / 500.0 - 1.0;
            let words = command(impedance(12.5 * part, 45.0 * part, 24.0 * part), &config).unwrap();
            let target = MotionTarget {
                position_rad: 12.5 * f64::from(part),
                velocity_rad_s: 45.0 * f64::from(part),
                kp: 10.0,
                kd: 1.0,
                torque_nm: 24.0 * f64::from(part),
            };
            let exact = MotionRanges::DEFAULT.command(&target).unwrap();
            assert!(words.position.abs_diff(exact.position) <= 1, "{part}");
            assert!(words.velocity.abs_diff(exact.velocity) <= 1, "{part}");
            assert!(words.torque.abs_diff(exact.torque) <= 1, "{part}");
            assert_eq!((words.kp, words.kd), (exact.kp, exact.kd));
        }
    }

    #[test]
    fn what_a_range_cannot_carry_is_refused_in_the_axis_s_sense() {
        let out_of_range =
            |quantity, value, end: f32| Error::OutOfRange { quantity, value, min: -end, max: end };
        assert_eq!(
            command(impedance(12.6, 0.0, 0.0), &config(-1)),
            Err(out_of_range(Quantity::Position, 12.6, 12.5))
        );
        assert_eq!(
            command(impedance(0.0, 0.0, -24.5), &config(1)),
            Err(out_of_range(Quantity::Torque, -24.5, 24.0))
        );
    }

    /// RMD V3.6 §5.4, reply: 1 rad/s and 10 N·m within one step of the words.
    #[test]
    fn the_printed_reply_is_read() {
        let feedback = MotionFeedback { id: 1, position: 0xE665, velocity: 0x82E, torque: 0xB55 };
        let seen = observe(&feedback, &config(1));
        assert!((seen.velocity_rad_s.unwrap() - 1.0).abs() < 0.03);
        assert!((seen.torque_nm.unwrap() - 10.0).abs() < 0.02);
        assert_eq!(seen.position_rad, None);
        assert!((observe(&feedback, &config(-1)).torque_nm.unwrap() + 10.0).abs() < 0.02);
    }
}
