//! MyActuator RMD (V3.6) in the core's words.

use super::{Exchange, Sequences, Verdict, fit};
use crate::axis::{AxisConfig, Observation};
use crate::convert;
use host_protocol::{AxisParameter, Error, Quantity, Setpoint, StopAction};
use rmd::{
    Answer, Centiamps, Centidegrees, CentidegreesPerSecond, Milliseconds, Motion, Reply, Request, SpeedLimit,
};

pub(super) const SEQUENCES: Sequences = Sequences {
    // 0x81 twice: after a communication timeout the first command is echoed and ignored (PROTOCOL-NOTES R20).
    arming: &[
        Exchange::Stop,
        Exchange::Stop,
        Exchange::ReleaseBrake,
        Exchange::Velocity,
        Exchange::Position,
        Exchange::Faults,
    ],
    state: &[Exchange::Velocity, Exchange::Position, Exchange::Faults],
    polls: &[Exchange::Velocity, Exchange::Position],
    // There is no command that clears a fault (§8).
    clearing: &[Exchange::Faults, Exchange::Velocity, Exchange::Position],
};

pub(super) fn command(exchange: Exchange, config: &AxisConfig) -> Option<Request> {
    Some(match exchange {
        Exchange::Stop => match config.stop_action()? {
            StopAction::Coast => Request::Shutdown,
            StopAction::Hold | StopAction::Brake => Request::Stop,
        },
        Exchange::LockBrake => Request::LockBrake,
        Exchange::ReleaseBrake if config.flag(AxisParameter::ReleaseBrakeWhenArming) => Request::ReleaseBrake,
        Exchange::OutputOff => Request::Shutdown,
        Exchange::Velocity => Request::ReadStatus2,
        Exchange::Position => Request::ReadMultiTurnAngle,
        Exchange::Faults => Request::ReadStatus1,
        Exchange::SetTimeout { timeout_ms } => {
            Request::SetCommunicationTimeout { timeout: Milliseconds(timeout_ms) }
        }
        _ => return None,
    })
}

pub(super) fn motion(axis: u8, setpoint: Setpoint, sign: f32) -> Result<Option<Request>, Error> {
    Ok(Some(match setpoint {
        Setpoint::Current { current_a } => {
            let limit = convert::from_hundredths(i32::from(i16::MAX));
            let count = convert::to_hundredths(sign * current_a);
            let current = fit(count, Quantity::Current, current_a, (-limit, limit))?;
            Request::TorqueCurrent { current: Centiamps(current) }
        }
        Setpoint::Velocity { velocity_rad_s } => {
            let limit = convert::centidegrees_to_rad(i32::MAX);
            let count = convert::rad_to_centidegrees(sign * velocity_rad_s);
            let speed = fit(count, Quantity::Velocity, velocity_rad_s, (-limit, limit))?;
            Request::Velocity { speed: CentidegreesPerSecond(speed) }
        }
        Setpoint::Position { position_rad, speed_limit_rad_s } => {
            let limit = convert::degrees_to_rad(i32::from(u16::MAX));
            let count = convert::rad_to_degrees(speed_limit_rad_s);
            let max_speed: u16 = fit(count, Quantity::SpeedLimit, speed_limit_rad_s, (0.0, limit))?;
            if max_speed == 0 {
                // The manual does not say what 0 means, newer ones say unlimited (PROTOCOL-NOTES R33).
                return Err(Error::SpeedLimitZero { axis });
            }
            let limit = convert::centidegrees_to_rad(i32::MAX);
            let count = convert::rad_to_centidegrees(sign * position_rad);
            let angle = fit(count, Quantity::Position, position_rad, (-limit, limit))?;
            Request::AbsolutePosition { max_speed: SpeedLimit(max_speed), angle: Centidegrees(angle) }
        }
        Setpoint::Signal { .. } => return Ok(None),
    }))
}

pub(super) fn judge(request: &Request, reply: &Reply, sign: f32) -> Verdict {
    match rmd::answer(request, reply) {
        // All zero is an answer that may as well be the request thrown back: it tells nothing (PROTOCOL-NOTES R30).
        Answer::Reply(
            Reply::TorqueCurrent { motion } | Reply::Velocity { motion } | Reply::AbsolutePosition { motion },
        ) if motion == Motion::default() => Verdict::Answer(Observation::default()),
        Answer::Reply(reply) => Verdict::Answer(observe(&reply, sign)),
        Answer::NotExecuted => Verdict::NotExecuted,
        _ => Verdict::Unrelated,
    }
}

pub(super) fn observe(reply: &Reply, sign: f32) -> Observation {
    match reply {
        Reply::MultiTurnAngle { angle } => Observation {
            position_rad: Some(sign * convert::centidegrees_to_rad(angle.0)),
            ..Observation::default()
        },
        Reply::Status1 { temperature, brake_released, voltage, faults } => Observation {
            motor_temperature_c: Some(f32::from(temperature.0)),
            brake_locked: Some(!brake_released),
            voltage_v: Some(convert::from_tenths(i32::from(voltage.0))),
            faults: Some(faults.bits()),
            ..Observation::default()
        },
        Reply::Status2 { motion }
        | Reply::TorqueCurrent { motion }
        | Reply::Velocity { motion }
        | Reply::AbsolutePosition { motion } => observe_motion(motion, sign),
        _ => Observation::default(),
    }
}

/// The angle of motion replies ends at ±32767° and is left out: positions come from 0x92 (PROTOCOL-NOTES R35).
fn observe_motion(motion: &Motion, sign: f32) -> Observation {
    Observation {
        motor_temperature_c: Some(f32::from(motion.temperature.0)),
        current_a: Some(sign * convert::from_hundredths(i32::from(motion.current.0))),
        velocity_rad_s: Some(sign * convert::degrees_to_rad(i32::from(motion.speed.0))),
        ..Observation::default()
    }
}
