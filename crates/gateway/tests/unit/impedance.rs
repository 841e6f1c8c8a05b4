//! RMD motion mode: the packed words of RMD V3.6 §5.

use super::*;
use host_protocol::Value;
use rmd::{MotionRanges, MotionTarget};

fn config(direction: i32) -> AxisConfig {
    let mut config = AxisConfig::new();
    config.set(AxisParameter::Direction, Value::Signed(direction)).unwrap();
    config
}

fn words(setpoint: Setpoint, config: &AxisConfig) -> Result<MotionCommand, Error> {
    impedance(setpoint, config)
}

fn observed(feedback: &MotionFeedback, direction: i32) -> Observation {
    observe(&Reply::MotionMode { feedback: *feedback }, &config(direction))
}

fn setpoint(position_rad: f32, velocity_rad_s: f32, torque_nm: f32) -> Setpoint {
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
    let expected =
        MotionCommand { position: 0xE666, velocity: 0x82E, kp: 0x052, kd: 0x333, torque: 0xB55 };
    assert_eq!(words(setpoint(10.0, 1.0, 10.0), &config(1)), Ok(expected));
    assert_eq!(words(setpoint(-10.0, -1.0, -10.0), &config(-1)), Ok(expected));
}

#[test]
fn agrees_with_the_codec_to_one_step() {
    let config = config(1);
    for step in 0..=1000i16 {
        let part = f32::from(step) / 500.0 - 1.0;
        let words = words(setpoint(12.5 * part, 45.0 * part, 24.0 * part), &config).unwrap();
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
        words(setpoint(12.6, 0.0, 0.0), &config(-1)),
        Err(out_of_range(Quantity::Position, 12.6, 12.5))
    );
    assert_eq!(
        words(setpoint(0.0, 0.0, -24.5), &config(1)),
        Err(out_of_range(Quantity::Torque, -24.5, 24.0))
    );
}

/// RMD V3.6 §5.4, reply: 1 rad/s and 10 N·m within one step of the words.
#[test]
fn the_printed_reply_is_read() {
    let feedback = MotionFeedback { id: 1, position: 0xE665, velocity: 0x82E, torque: 0xB55 };
    let seen = observed(&feedback, 1);
    assert!((seen.velocity_rad_s.unwrap() - 1.0).abs() < 0.03);
    assert!((seen.torque_nm.unwrap() - 10.0).abs() < 0.02);
    assert_eq!(seen.position_rad, None);
    assert!((observed(&feedback, -1).torque_nm.unwrap() + 10.0).abs() < 0.02);
}
