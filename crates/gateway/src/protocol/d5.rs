//! Motors with `D5`/`5D` frames in the core's words.

use super::convert::{self, DEGREES};
use super::native::{Demand, Effect, Native};
use super::{Command, Exchange, Sequences, Verdict, fit, turned};
use crate::axis::{AxisConfig, Observation};
use d5::{
    AckLevel, Address, Answer, DegreesPerSecond, Node, Register, Reply, Request, Value, Width,
};
use host_protocol::{AxisParameter, CanFrame, CanId, Error, Quantity, Setpoint};

pub(super) const SEQUENCES: Sequences = Sequences {
    arming: &[
        Exchange::AckLevel,
        Exchange::TimeoutSwitch,
        Exchange::Faults,
        Exchange::BrakeSwitch,
        Exchange::PendingWrite,
        Exchange::Stop,
        Exchange::OverwritePending,
        Exchange::CommandedSpeed,
        Exchange::Velocity,
    ],
    state: &[
        Exchange::Velocity,
        Exchange::Position,
        Exchange::Faults,
        Exchange::DriverTemperature,
        Exchange::MotorTemperature,
    ],
    polls: &[Exchange::Velocity, Exchange::Position],
    clearing: &[
        Exchange::ClearFaults,
        Exchange::Faults,
        Exchange::Velocity,
        Exchange::DriverTemperature,
        Exchange::MotorTemperature,
    ],
};

/// Speed 0 in register 0x20.
const STANDSTILL: Value = Value::Word(0);
/// "On" in register 0x11, "clear" in register 0x19.
const ONE: Value = Value::Byte(1);

pub(super) fn command(exchange: Exchange) -> Option<Request> {
    let read_byte = |register| Request::Read { register, width: Width::Byte };
    let read_word = |register| Request::Read { register, width: Width::Word };
    Some(match exchange {
        Exchange::Stop => Request::Write { register: Register::SPEED, value: STANDSTILL },
        Exchange::OverwritePending => {
            Request::AsyncWrite { register: Register::SPEED, value: STANDSTILL }
        }
        Exchange::ExecutePending => Request::Execute,
        Exchange::PendingWrite => read_byte(Register::ASYNC_FLAG),
        Exchange::BrakeSwitch => read_byte(Register::BRAKE),
        Exchange::CommandedSpeed => read_word(Register::SPEED),
        Exchange::Velocity => read_word(Register::CURRENT_SPEED),
        Exchange::Position => read_word(Register::TRAVELLED_ANGLE),
        Exchange::Faults => read_byte(Register::STATUS),
        Exchange::DriverTemperature => read_byte(Register::BOARD_TEMPERATURE),
        Exchange::MotorTemperature => read_byte(Register::MOTOR_TEMPERATURE),
        Exchange::AckLevel => read_byte(Register::ACK_LEVEL),
        Exchange::TimeoutSwitch => read_byte(Register::TIMEOUT_SWITCH),
        Exchange::ClearFaults => {
            Request::Write { register: Register::CLEAR_PROTECTION, value: ONE }
        }
        // The motor's time is its own; it can only be switched on and off (D15).
        Exchange::SetTimeout { timeout_ms: 0 } => {
            Request::Write { register: Register::TIMEOUT_SWITCH, value: Value::Byte(0) }
        }
        Exchange::SetTimeout { .. } => {
            Request::Write { register: Register::TIMEOUT_SWITCH, value: ONE }
        }
        _ => return None,
    })
}

pub(super) fn motion(setpoint: Setpoint, config: &AxisConfig) -> Result<Option<Request>, Error> {
    let Setpoint::Velocity { velocity_rad_s } = setpoint else {
        return Ok(None);
    };
    let most = DEGREES.to_si(i32::from(i16::MAX));
    let count = DEGREES.within(velocity_rad_s, config.range(AxisParameter::VelocityLimitRadS));
    let speed: i16 = fit(turned(count, config), Quantity::Velocity, velocity_rad_s, (-most, most))?;
    let word = d5::encode_speed(DegreesPerSecond(speed)).map_err(|_| Error::OutOfRange {
        quantity: Quantity::Velocity,
        value: velocity_rad_s,
        min: -most,
        max: most,
    })?;
    Ok(Some(Request::Write { register: Register::SPEED, value: Value::Word(word) }))
}

/// What the eight bytes of a request do; `None` where the manual lists no such command.
pub(super) fn native(axis: u8, data: &[u8], config: &AxisConfig) -> Result<Option<Native>, Error> {
    let Ok(frame) = data.try_into() else { return Ok(None) };
    let Ok((address, request)) = d5::decode_request_frame(frame) else { return Ok(None) };
    if let Some(node) = config.node()
        && Node::new(node).map(Address::Node) != Ok(address)
    {
        return Err(Error::NotThisNode { axis, node });
    }
    if request.moves() && !tells_its_speed(&request) {
        return Err(Error::CannotCheckLimit { axis, quantity: Quantity::Velocity });
    }
    Ok(effect(request, config.sign())
        .map(|effect| Native { command: Command::D5(request), effect }))
}

/// Whether a motion writes the whole speed, or starts one that was checked when it was written.
/// Half a speed (D5 manual, table row
/// 12) makes another one of what the motor holds, which no limit can be checked against.
fn tells_its_speed(request: &Request) -> bool {
    matches!(
        request,
        Request::Execute
            | Request::Write { register: Register::SPEED, value: Value::Word(_) }
            | Request::AsyncWrite { register: Register::SPEED, value: Value::Word(_) }
    )
}

/// What a request does; `None` where the manual lists no such command, and for a motion whose speed
/// it does not tell.
pub(super) fn effect(request: Request, sign: f32) -> Option<Effect> {
    let velocity = |word| {
        let velocity_rad_s = sign * convert::degrees_to_rad(i32::from(d5::decode_speed(word).0));
        Setpoint::Velocity { velocity_rad_s }
    };
    Some(match request {
        Request::Unknown { .. } => return None,
        Request::QueryId | Request::Read { .. } | Request::ReadMagneticAngle => Effect::Asks,
        Request::Write { register: Register::SPEED, value: Value::Word(word) } => {
            Effect::of_setpoint(velocity(word), d5::decode_speed(word).0 == 0)
        }
        Request::AsyncWrite { register: Register::SPEED, value: Value::Word(word) } => {
            Effect::MovesOnce(Demand::Setpoint(velocity(word)))
        }
        Request::Execute => Effect::MovesOnce(Demand::Prepared),
        request if request.moves() => return None,
        Request::Reset => Effect::Changes { timeout: true },
        request => {
            let timeout = request.writes(Register::TIMEOUT_SWITCH) || request.writes(Register::ID);
            Effect::Changes { timeout }
        }
    })
}

/// Whether the motor answers a request at its level, which is the configured one. Whether it
/// answers the change of that level, by the old one or the new, the manual does not say: it is
/// waited for, and then read back (D12).
pub(super) fn is_answered(request: &Request, config: &AxisConfig) -> bool {
    let level =
        config.unsigned(AxisParameter::D5AckLevel).and_then(|level| u8::try_from(level).ok());
    let level = level.map_or(AckLevel::ReadsAndWrites, AckLevel::of);
    let node =
        Address::Node(config.node().and_then(|node| Node::new(node).ok()).unwrap_or(Node::FACTORY));
    level.answers(node, request) || new_ack_level(request).is_some()
}

/// The acknowledge level that the motor has once it has carried out a request; `None` where that
/// stays as it was.
pub(super) fn new_ack_level(request: &Request) -> Option<AckLevel> {
    match *request {
        Request::Write { register: Register::ACK_LEVEL, value: Value::Byte(level) } => {
            Some(AckLevel::of(level))
        }
        _ => None,
    }
}

pub(super) fn judge(request: &Request, from: u8, reply: &Reply, config: &AxisConfig) -> Verdict {
    let (Some(Ok(node)), Ok(from)) = (config.node().map(Node::new), Node::new(from)) else {
        return Verdict::Unrelated;
    };
    match d5::answer(request, node, from, reply) {
        Answer::Reply(reply) => Verdict::Answer(observe(&reply, config.sign())),
        Answer::Refused(_) => Verdict::Refused,
        _ => Verdict::Unrelated,
    }
}

pub(super) fn observe(reply: &Reply, sign: f32) -> Observation {
    let none = Observation::default();
    let Reply::Read { register, value } = *reply else {
        return none;
    };
    match (register, value) {
        (Register::CURRENT_SPEED, Value::Word(word)) => {
            let speed = d5::decode_speed(word);
            Observation {
                velocity_rad_s: Some(sign * convert::degrees_to_rad(i32::from(speed.0))),
                ..none
            }
        }
        (Register::TRAVELLED_ANGLE, Value::Word(word)) => {
            let angle = d5::decode_angle(word);
            Observation {
                position_rad: Some(sign * convert::degrees_to_rad(i32::from(angle.0))),
                ..none
            }
        }
        (Register::SPEED, Value::Word(word)) => {
            Observation { commanded_zero: Some(d5::decode_speed(word).0 == 0), ..none }
        }
        (Register::STATUS, Value::Byte(bits)) => {
            Observation { faults: Some(u16::from(bits)), ..none }
        }
        (Register::ASYNC_FLAG, Value::Byte(flag)) => {
            Observation { write_pending: Some(flag != 0), ..none }
        }
        (Register::BRAKE, Value::Byte(on)) => Observation { brake_locked: Some(on != 0), ..none },
        (Register::ACK_LEVEL, Value::Byte(level)) => Observation { ack_level: Some(level), ..none },
        (Register::TIMEOUT_SWITCH, Value::Byte(on)) => {
            Observation { timeout_on: Some(on != 0), ..none }
        }
        (Register::BOARD_TEMPERATURE, Value::Byte(byte)) => {
            let celsius = d5::decode_temperature(byte);
            Observation { driver_temperature_c: Some(f32::from(celsius.0)), ..none }
        }
        (Register::MOTOR_TEMPERATURE, Value::Byte(byte)) => {
            let celsius = d5::decode_temperature(byte);
            Observation { motor_temperature_c: Some(f32::from(celsius.0)), ..none }
        }
        _ => none,
    }
}

/// The frame that has every motor carry out what waits (D5 manual, quick start (4)). The manual
/// gives no CAN id: that of the frame's own id byte, 0x0FE, in a frame of the type that the motor
/// of the axis is asked with, is an assumption.
pub(super) fn execute_all(config: &AxisConfig) -> Option<CanFrame> {
    let raw = u32::from(Address::BROADCAST_ID);
    let extended = request_id(config)?.is_extended();
    let CanId(id) = if extended { CanId::extended(raw) } else { CanId::standard(raw) }?;
    d5::can::request(id, Address::Broadcast, &Request::Execute).ok()
}

pub(super) fn to_can(node: u8, request: &Request, config: &AxisConfig) -> Option<CanFrame> {
    let node = Node::new(node).ok()?;
    let CanId(id) = request_id(config)?;
    d5::can::request(id, d5::Address::Node(node), request).ok()
}

/// The arbitration id of requests: the axis's, by default the motor's id as a standard one, which
/// is an assumption (D14).
pub(super) fn request_id(config: &AxisConfig) -> Option<CanId> {
    match config.unsigned(AxisParameter::D5RequestId) {
        Some(id) => CanId::from_wire(id),
        None => Node::new(config.node()?)
            .ok()
            .map(|node| CanId(d5::can::default_request_id(node).into())),
    }
}

/// The arbitration id of replies, where the axis names one.
pub(super) fn reply_id(config: &AxisConfig) -> Option<CanId> {
    config.unsigned(AxisParameter::D5ReplyId).and_then(CanId::from_wire)
}

/// Replies may carry any id unless the axis names one (D14).
pub(super) fn accepts_id(config: &AxisConfig, frame: &CanFrame) -> bool {
    reply_id(config).is_none_or(|CanId(wanted)| frame.id() == wanted)
}
