//! The thruster/rudder CAN protocol in the core's words.

use super::convert::{self, DECIDEGREES, HUNDREDTHS, RPM};
use super::native::{Demand, Effect, Native};
use super::returned::{self, ReturnMode, is_motion};
use super::{Command, Exchange, Sequences, Verdict, fit, position, turned};
use crate::axis::{AxisConfig, Observation};
use host_protocol::{AxisParameter, Error, Protocol, Quantity, Setpoint};
use thruster::{
    Answer, Decidegrees, EncodeError, Faults, Milliseconds, Percent, Reply, Request, Rpm, RpmLimit,
};

pub(super) const SEQUENCES: Sequences = Sequences {
    // Both fault words are read first, because the next command clears a timeout (T18); TC 0 clears
    // zero protection (T19). ST is written each time: the manual does not say that a thruster
    // keeps it (§2.3).
    arming: &[
        Exchange::Faults,
        Exchange::FaultRecord,
        Exchange::Stop,
        Exchange::RenewTimeout,
        Exchange::Faults,
        Exchange::Velocity,
    ],
    state: &[
        Exchange::Velocity,
        Exchange::Current,
        Exchange::Voltage,
        Exchange::MotorTemperature,
        Exchange::DriverTemperature,
        Exchange::Faults,
        Exchange::Position,
    ],
    polls: &[Exchange::Velocity, Exchange::Current],
    clearing: &[
        Exchange::ClearFaults,
        Exchange::Faults,
        Exchange::Velocity,
        Exchange::Current,
        Exchange::MotorTemperature,
        Exchange::DriverTemperature,
    ],
};

pub(super) fn command(exchange: Exchange, config: &AxisConfig) -> Option<Request> {
    let has_position = config.flag(AxisParameter::PositionDevice);
    Some(match exchange {
        Exchange::Stop => Request::Signal { signal: Percent(0) },
        Exchange::PositionStop if has_position => Request::EmergencyStop,
        Exchange::Velocity => Request::ReadSpeed,
        Exchange::Position if has_position => Request::ReadAbsolutePosition,
        Exchange::Current => Request::ReadCurrent,
        Exchange::Voltage => Request::ReadVoltage,
        Exchange::MotorTemperature => Request::ReadMotorTemperature,
        Exchange::DriverTemperature => Request::ReadDriverTemperature,
        Exchange::Faults => Request::ReadFaults,
        Exchange::FaultRecord => Request::ReadFaultRecord,
        Exchange::ClearFaults => Request::ClearFaults,
        Exchange::SetTimeout { timeout_ms } => {
            Request::SetTimeout { timeout: Milliseconds(u16::try_from(timeout_ms).ok()?) }
        }
        _ => return None,
    })
}

pub(super) fn motion(
    axis: u8,
    setpoint: Setpoint,
    config: &AxisConfig,
) -> Result<Option<Request>, Error> {
    let request = match setpoint {
        Setpoint::Signal { fraction } => {
            let count = HUNDREDTHS.within(fraction, config.range(AxisParameter::SignalLimit));
            let signal = fit(turned(count, config), Quantity::Signal, fraction, (-1.0, 1.0))?;
            Request::Signal { signal: Percent(signal) }
        }
        Setpoint::Velocity { velocity_rad_s } => {
            let most = RPM.to_si(i32::from(i16::MAX));
            let count = RPM.within(velocity_rad_s, config.range(AxisParameter::VelocityLimitRadS));
            let speed =
                fit(turned(count, config), Quantity::Velocity, velocity_rad_s, (-most, most))?;
            Request::Speed { speed: Rpm(speed) }
        }
        Setpoint::Position { position_rad, speed_limit_rad_s }
            if config.flag(AxisParameter::PositionDevice) =>
        {
            // Speed 0 means: do not start (T16).
            let (speed, position) =
                position(axis, speed_limit_rad_s, &RPM, position_rad, &DECIDEGREES, config)?;
            Request::AbsolutePosition { speed: RpmLimit(speed), position: Decidegrees(position) }
        }
        Setpoint::Position { .. } | Setpoint::Current { .. } | Setpoint::Impedance { .. } => {
            return Ok(None);
        }
    };
    match request.encode() {
        Ok(_) => Ok(Some(request)),
        Err(refusal) => Err(in_si(setpoint, refusal)),
    }
}

/// A position command with its target at a count of the device's, in the device's sense of
/// rotation.
pub(super) fn at(request: Request, start: i32, distance_rad: f32) -> Option<(Request, i32)> {
    let Request::AbsolutePosition { speed, .. } = request else { return None };
    let target = start.checked_add(DECIDEGREES.nearest(distance_rad)?)?;
    let request = Request::AbsolutePosition { speed, position: Decidegrees(target) };
    request.encode().ok().map(|_| (request, target))
}

/// What the data field of a request does; `None` where the manual lists no such command.
pub(super) fn native(axis: u8, data: &[u8], config: &AxisConfig) -> Result<Option<Native>, Error> {
    let Ok(request) = Request::decode(data) else { return Ok(None) };
    let positions =
        matches!(request, Request::AbsolutePosition { .. } | Request::RelativePosition { .. });
    if positions && !config.flag(AxisParameter::PositionDevice) {
        // A stop would not reach the position controller (GUARANTEES G4, stop table).
        return Err(Error::Unsupported { axis, protocol: Protocol::Thruster });
    }
    Ok(effect(request, config.sign())
        .map(|effect| Native { command: Command::Thruster(request), effect }))
}

/// What a request does; `None` where the manual lists no such command.
pub(super) fn effect(request: Request, sign: f32) -> Option<Effect> {
    let position = |position: Decidegrees| sign * convert::decidegrees_to_rad(position.0);
    let rpm = |speed: RpmLimit| convert::rpm_to_rad_s(i32::from(speed.0));
    Some(match request {
        Request::Unknown { .. } => return None,
        request if request.only_reads() => Effect::Asks,
        Request::EmergencyStop => Effect::Stops,
        Request::Signal { signal } => {
            let fraction = sign * convert::from_hundredths(i32::from(signal.0));
            Effect::of_setpoint(Setpoint::Signal { fraction }, signal.0 == 0)
        }
        Request::Speed { speed } => {
            let velocity_rad_s = sign * convert::rpm_to_rad_s(i32::from(speed.0));
            Effect::of_setpoint(Setpoint::Velocity { velocity_rad_s }, speed.0 == 0)
        }
        Request::AbsolutePosition { speed, position: target } => {
            Effect::Moves(Demand::Setpoint(Setpoint::Position {
                position_rad: position(target),
                speed_limit_rad_s: rpm(speed),
            }))
        }
        Request::RelativePosition { speed, .. } => {
            Effect::MovesOnce(Demand::Distance { speed_limit_rad_s: rpm(speed) })
        }
        Request::SetTimeout { .. }
        | Request::SetId { .. }
        | Request::SetBitrate { .. }
        | Request::SetParameter { .. } => Effect::Changes { timeout: true },
        _ => Effect::Changes { timeout: false },
    })
}

/// The bits of a fault word that the device only reports, unless the axis treats them as faults.
/// Without its sensor a temperature limit cannot be kept (Thruster manual §3, protections).
pub(super) fn warnings(faults: u16, config: &AxisConfig) -> u16 {
    let limits_temperature = config.float(AxisParameter::TemperatureLimitC).is_some();
    let only_reported = match config.flag(AxisParameter::WarningsAreFaults) {
        true => Faults::empty(),
        false if limits_temperature => Faults::REPORTED.difference(Faults::TEMPERATURE_SENSORS),
        false => Faults::REPORTED,
    };
    faults & only_reported.bits()
}

/// Refuses a timeout that the device cannot keep.
pub(super) fn check_timeout(timeout_ms: u32) -> Result<(), (u32, u32)> {
    let (min, max) = (u32::from(thruster::TIMEOUT_MIN), u32::from(thruster::TIMEOUT_MAX));
    let off = timeout_ms == u32::from(thruster::TIMEOUT_OFF);
    if off || (min..=max).contains(&timeout_ms) { Ok(()) } else { Err((min, max)) }
}

/// The codec's refusal of a setpoint, with the bounds in SI units.
fn in_si(setpoint: Setpoint, refusal: EncodeError) -> Error {
    let bounds = match refusal {
        EncodeError::OutOfRange { min, max, .. } => {
            (i32::try_from(min).ok(), i32::try_from(max).ok())
        }
        _ => (None, None),
    };
    let (quantity, value, bounds) = match setpoint {
        Setpoint::Signal { fraction } => (Quantity::Signal, fraction, (-1.0, 1.0)),
        Setpoint::Position { position_rad, .. } => {
            let (min, max) = (bounds.0.unwrap_or(i32::MIN), bounds.1.unwrap_or(i32::MAX));
            let bounds = (convert::decidegrees_to_rad(min), convert::decidegrees_to_rad(max));
            (Quantity::Position, position_rad, bounds)
        }
        // A speed the wire can carry is refused only below the slowest: 0 or at least 30 rpm either
        // way (T14).
        Setpoint::Velocity { velocity_rad_s } => {
            let slowest = convert::rpm_to_rad_s(i32::from(thruster::SPEED_MIN_MAGNITUDE));
            let fastest = convert::rpm_to_rad_s(i32::from(i16::MAX));
            let bounds =
                if velocity_rad_s < 0.0 { (-fastest, -slowest) } else { (slowest, fastest) };
            (Quantity::Velocity, velocity_rad_s, bounds)
        }
        Setpoint::Current { current_a } => (Quantity::Current, current_a, (0.0, 0.0)),
        Setpoint::Impedance { torque_nm, .. } => (Quantity::Torque, torque_nm, (0.0, 0.0)),
    };
    Error::OutOfRange { quantity, value, min: bounds.0, max: bounds.1 }
}

pub(super) fn judge(request: &Request, reply: &Reply, config: &AxisConfig) -> Verdict {
    let mode = ReturnMode::of(config);
    match thruster::answer(request, reply) {
        // Which value it acknowledges it does not say (T22).
        Answer::Reply(Reply::Returned(returned)) if !mode.acknowledges(&returned.frame) => {
            Verdict::Unrelated
        }
        // The device repeats the value it has taken: another one belongs to an older request.
        Answer::Reply(Reply::Signal { signal }) if *request != (Request::Signal { signal }) => {
            Verdict::Unrelated
        }
        Answer::Reply(Reply::Speed { speed }) if *request != (Request::Speed { speed }) => {
            Verdict::Unrelated
        }
        Answer::Reply(Reply::Timeout { timeout })
            if *request != (Request::SetTimeout { timeout }) =>
        {
            Verdict::Unrelated
        }
        Answer::Reply(reply) => Verdict::Answer(observe(&reply, config.sign())),
        Answer::Refused => Verdict::Refused,
        Answer::Unrelated if mode == ReturnMode::Headerless && is_motion(request) => {
            match reply.headerless() {
                Some(told) => Verdict::Answer(returned::of_headerless(&told, config.sign())),
                None => Verdict::Unrelated,
            }
        }
        Answer::Unrelated | Answer::Unsolicited => Verdict::Unrelated,
    }
}

/// The kinds of frames that come unasked: three of SR and VM, and speed and current of ML and MM
/// (Thruster manual §2.1, §2.4, §2.5).
pub(super) fn telemetry(reply: &Reply) -> Option<u8> {
    match reply {
        Reply::Returned(returned) => returned.frame.number().checked_sub(1),
        Reply::MeasuredSpeed { .. } => Some(3),
        Reply::Current { .. } => Some(4),
        _ => None,
    }
}

pub(super) fn observe(reply: &Reply, sign: f32) -> Observation {
    let none = Observation::default();
    match reply {
        Reply::MeasuredSpeed { speed } => Observation {
            velocity_rad_s: Some(sign * convert::rpm_to_rad_s(i32::from(speed.0))),
            ..none
        },
        Reply::Current { current } => Observation {
            current_a: Some(sign * convert::from_tenths(i32::from(current.0))),
            ..none
        },
        Reply::Voltage { voltage } => {
            Observation { voltage_v: Some(convert::from_tenths(i32::from(voltage.0))), ..none }
        }
        Reply::MotorTemperature { temperature } => {
            Observation { motor_temperature_c: Some(f32::from(temperature.0)), ..none }
        }
        Reply::DriverTemperature { temperature } => {
            Observation { driver_temperature_c: Some(f32::from(temperature.0)), ..none }
        }
        Reply::Faults { faults } => Observation { faults: Some(faults.bits()), ..none },
        Reply::FaultRecord { faults } => Observation { fault_record: Some(faults.bits()), ..none },
        Reply::MeasuredPosition { position } => {
            let position_rad = Some(sign * convert::decidegrees_to_rad(position.0));
            Observation { position_rad, position_count: Some(position.0), ..none }
        }
        Reply::Returned(returned) => returned::of_frame(&returned.frame, sign),
        _ => none,
    }
}
