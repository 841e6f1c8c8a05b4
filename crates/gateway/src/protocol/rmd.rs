//! MyActuator RMD (V3.6) in the core's words.

use super::convert::{self, CENTIDEGREES, DEGREES, HUNDREDTHS};
use super::native::{Demand, Effect, Native};
use super::{Command, Exchange, Sequences, Verdict, fit, impedance, position, turned};
use crate::axis::{AxisConfig, Observation};
use host_protocol::{AxisParameter, Error, Quantity, Setpoint, StopAction};
use rmd::{
    Answer, Centiamps, Centidegrees, CentidegreesPerSecond, Milliseconds, Motion, Reply, Request,
    SpeedLimit,
};

pub(super) const SEQUENCES: Sequences = Sequences {
    // 0x81 twice: after a communication timeout the first command is echoed and ignored
    // (PROTOCOL-NOTES R20).
    arming: &[
        Exchange::Stop,
        Exchange::Stop,
        Exchange::RunTime,
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
        Exchange::ReleaseBrake if config.flag(AxisParameter::ReleaseBrakeWhenArming) => {
            Request::ReleaseBrake
        }
        Exchange::OutputOff => Request::Shutdown,
        Exchange::Velocity => Request::ReadStatus2,
        Exchange::Position => Request::ReadMultiTurnAngle,
        Exchange::RunTime => Request::ReadRunTime,
        Exchange::Restart => Request::Reset,
        Exchange::Faults => Request::ReadStatus1,
        Exchange::SetTimeout { timeout_ms } => {
            Request::SetCommunicationTimeout { timeout: Milliseconds(timeout_ms) }
        }
        _ => return None,
    })
}

pub(super) fn motion(
    axis: u8,
    setpoint: Setpoint,
    config: &AxisConfig,
) -> Result<Option<Request>, Error> {
    Ok(Some(match setpoint {
        Setpoint::Impedance { .. } => {
            Request::MotionMode { command: impedance::command(setpoint, config)? }
        }
        Setpoint::Current { current_a } => {
            let most = HUNDREDTHS.to_si(i32::from(i16::MAX));
            let count = HUNDREDTHS.within(current_a, config.range(AxisParameter::CurrentLimitA));
            let current = fit(turned(count, config), Quantity::Current, current_a, (-most, most))?;
            Request::TorqueCurrent { current: Centiamps(current) }
        }
        Setpoint::Velocity { velocity_rad_s } => {
            let most = CENTIDEGREES.to_si(i32::MAX);
            let count =
                CENTIDEGREES.within(velocity_rad_s, config.range(AxisParameter::VelocityLimitRadS));
            let speed =
                fit(turned(count, config), Quantity::Velocity, velocity_rad_s, (-most, most))?;
            Request::Velocity { speed: CentidegreesPerSecond(speed) }
        }
        Setpoint::Position { position_rad, speed_limit_rad_s } => {
            // What a speed of 0 means the manual does not say, newer ones say unlimited
            // (PROTOCOL-NOTES R33).
            let (max_speed, angle) =
                position(axis, speed_limit_rad_s, &DEGREES, position_rad, &CENTIDEGREES, config)?;
            Request::AbsolutePosition {
                max_speed: SpeedLimit(max_speed),
                angle: Centidegrees(angle),
            }
        }
        Setpoint::Signal { .. } => return Ok(None),
    }))
}

/// A position command with its target at a count of the motor's, in the motor's sense of rotation.
pub(super) fn at(request: Request, start: i32, distance_rad: f32) -> Option<(Request, i32)> {
    let Request::AbsolutePosition { max_speed, .. } = request else { return None };
    let target = start.checked_add(CENTIDEGREES.nearest(distance_rad)?)?;
    Some((Request::AbsolutePosition { max_speed, angle: Centidegrees(target) }, target))
}

/// What the eight data bytes of a request do; `None` where the manual lists no such command.
pub(super) fn native(data: &[u8], sign: f32) -> Option<Native> {
    let request = Request::decode(data.try_into().ok()?);
    Some(Native { command: Command::Rmd(request), effect: effect(request, sign)? })
}

/// What a request does; `None` where the manual lists no such command.
pub(super) fn effect(request: Request, sign: f32) -> Option<Effect> {
    let position = |angle: Centidegrees| sign * convert::centidegrees_to_rad(angle.0);
    let degrees = |speed: SpeedLimit| convert::degrees_to_rad(i32::from(speed.0));
    Some(match request {
        Request::Unknown { .. } => return None,
        request if request.only_reads() => Effect::Asks,
        Request::Shutdown | Request::Stop => Effect::Stops,
        Request::TorqueCurrent { current } => {
            let current_a = sign * convert::from_hundredths(i32::from(current.0));
            Effect::Moves(Demand::Setpoint(Setpoint::Current { current_a }))
        }
        Request::Velocity { speed } => {
            let velocity_rad_s = sign * convert::centidegrees_to_rad(speed.0);
            Effect::Moves(Demand::Setpoint(Setpoint::Velocity { velocity_rad_s }))
        }
        Request::PositionTracking { angle } => {
            Effect::Moves(Demand::Unlimited { position_rad: position(angle) })
        }
        Request::AbsolutePosition { max_speed, angle } => {
            Effect::Moves(Demand::Setpoint(Setpoint::Position {
                position_rad: position(angle),
                speed_limit_rad_s: degrees(max_speed),
            }))
        }
        Request::LimitedPositionTracking { max_speed, angle } => {
            let speed_limit_rad_s = convert::centidegrees_to_rad(i32::from(max_speed.0));
            Effect::Moves(Demand::Tracking { position_rad: position(angle), speed_limit_rad_s })
        }
        Request::IncrementalPosition { max_speed, .. } => {
            Effect::MovesOnce(Demand::Distance { speed_limit_rad_s: degrees(max_speed) })
        }
        // A restart does not lose what 0xB3 has written to ROM (§2.25, §2.30).
        Request::SetCommunicationTimeout { .. }
        | Request::SetBaudRate { .. }
        | Request::SetCanId { .. }
        | Request::SetRs485Id { .. } => Effect::Changes { timeout: true },
        // As data it cannot come: it has ids of its own.
        Request::MotionMode { .. } => Effect::Moves(Demand::Prepared),
        _ => Effect::Changes { timeout: false },
    })
}

pub(super) fn judge(request: &Request, reply: &Reply, config: &AxisConfig) -> Verdict {
    match rmd::answer(request, reply) {
        // All zero is an answer that may as well be the request thrown back: it tells nothing
        // (PROTOCOL-NOTES R30).
        Answer::Reply(
            Reply::TorqueCurrent { motion }
            | Reply::Velocity { motion }
            | Reply::PositionTracking { motion }
            | Reply::AbsolutePosition { motion }
            | Reply::LimitedPositionTracking { motion },
        ) if motion == Motion::default() => {
            Verdict::Answer(Observation { may_be_thrown_back: true, ..Observation::default() })
        }
        Answer::Reply(reply) => Verdict::Answer(observe(&reply, config)),
        Answer::NotExecuted => Verdict::NotExecuted,
        _ => Verdict::Unrelated,
    }
}

pub(super) fn observe(reply: &Reply, config: &AxisConfig) -> Observation {
    let sign = config.sign();
    match reply {
        Reply::MotionMode { feedback } => impedance::observe(feedback, config),
        Reply::MultiTurnAngle { angle } => Observation {
            position_rad: Some(sign * convert::centidegrees_to_rad(angle.0)),
            position_count: Some(angle.0),
            ..Observation::default()
        },
        Reply::Status1 { temperature, brake_released, voltage, faults } => Observation {
            motor_temperature_c: Some(f32::from(temperature.0)),
            brake_locked: Some(!brake_released),
            voltage_v: Some(convert::from_tenths(i32::from(voltage.0))),
            faults: Some(faults.bits()),
            ..Observation::default()
        },
        Reply::RunTime { time } => {
            Observation { run_time_ms: Some(time.0), ..Observation::default() }
        }
        Reply::Status2 { motion }
        | Reply::TorqueCurrent { motion }
        | Reply::Velocity { motion }
        | Reply::PositionTracking { motion }
        | Reply::AbsolutePosition { motion }
        | Reply::LimitedPositionTracking { motion }
        | Reply::IncrementalPosition { motion } => observe_motion(motion, sign),
        _ => Observation::default(),
    }
}

/// The angle of motion replies ends at ±32767° and is left out: positions come from 0x92
/// (PROTOCOL-NOTES R35).
fn observe_motion(motion: &Motion, sign: f32) -> Observation {
    Observation {
        motor_temperature_c: Some(f32::from(motion.temperature.0)),
        current_a: Some(sign * convert::from_hundredths(i32::from(motion.current.0))),
        velocity_rad_s: Some(sign * convert::degrees_to_rad(i32::from(motion.speed.0))),
        ..Observation::default()
    }
}
