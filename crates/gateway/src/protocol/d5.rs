//! Motors with `D5`/`5D` frames in the core's words ("D5 manual").

use super::convert::DEGREES;
use super::{
    Command, Deframer, Demand, Effect, Exchange, Found, Ids, Info, Native, Outcome, Received,
    Serial, SerialFrame, Sets, Unasked,
};
use crate::config::AxisConfig;
use crate::measured::Observation;
use d5::{
    AckLevel, Address, Answer, DegreesPerSecond, FRAME_LEN, MotorError, Node, Register, Reply,
    Request, Value, Width, angle, can,
};
use heapless::Vec;
use host_protocol::{AxisParameter, CanFrame, CanId, Error, Quantity, Setpoint, StopAction};

pub(super) static INFO: Info = Info {
    last_node: Node::MAX,
    can_bitrates: Some(can::BITRATES),
    // The same eight bytes as on CAN. The manual gives no rate of the line.
    serial: Some(Serial {
        frame_len: FRAME_LEN,
        data_at: 0,
        deframer: Deframer::D5(d5::serial::Deframer::new()),
        encode: to_serial,
        decode: from_serial,
        reads: reads_frame,
    }),
    // Any bytes may be for its motors, and another protocol's motor may take theirs for its own.
    // On the safe side (PROTOCOL-NOTES D14).
    free_ids: true,
    replies_outrank_stops: false,
    resumes_when_asked: false,
    polled_to_hold: false,
    stores_timeout: false,
    timeouts_ms: (0, 1),
    reported_faults: 0,
    sensor_faults: 0,
    speed: &DEGREES,
    position: &DEGREES,
    // Common commands, row 5. What it tells of a motor beyond is not said (D4).
    farthest: angle::ANGLE_MAX as i32,
    angle: None,
    own_parameters: &[
        AxisParameter::D5AckLevel,
        AxisParameter::D5RequestId,
        AxisParameter::D5ReplyId,
    ],
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
    recognising: &[],
    state: &[
        Exchange::Velocity,
        Exchange::Position,
        Exchange::Faults,
        Exchange::DriverTemperature,
        Exchange::MotorTemperature,
    ],
    polls: &[Exchange::Velocity],
    clearing: &[
        Exchange::ClearFaults,
        Exchange::Faults,
        Exchange::Velocity,
        Exchange::DriverTemperature,
        Exchange::MotorTemperature,
    ],
    restarting: &[],
    // What waits is overwritten beside these, where something does (D19).
    stops: &[(StopAction::Hold, &[Exchange::Stop, Exchange::PendingWrite, Exchange::Velocity])],
    limits: |_, _| {
        &[
            AxisParameter::VelocityLimitRadS,
            AxisParameter::PositionMinRad,
            AxisParameter::PositionMaxRad,
            AxisParameter::TemperatureLimitC,
        ]
    },
    can_confirm: |config| config.unsigned(AxisParameter::D5AckLevel) != Some(0),
    request_id,
    ids: |node, config| {
        let all = u32::from(Address::BROADCAST_ID);
        Ids {
            sent: [request_id(node, config), None],
            replies: [reply_id(config), None],
            groups: [CanId::standard(all), CanId::extended(all)],
        }
    },
    command,
    motion,
    at: |_, _| Err((0, 0)),
    native,
    is_answered: |command, config| match command {
        Command::D5(request) => is_answered(request, config),
        // No reply to all is printed (quick start (4)).
        _ => false,
    },
    to_can,
    from_can: |frame| {
        let (node, reply) = can::decode_reply(frame).ok()?;
        Some(Received::D5 { node: node.get(), reply })
    },
    reads: |frame| reads_frame(frame.data()),
};

/// Speed 0 in register 0x20.
const STANDSTILL: Value = Value::Word(0);
/// "On" in register 0x11, "clear" in register 0x19.
const ONE: Value = Value::Byte(1);

/// The arbitration id of requests: the axis's, by default the motor's id as a standard one, which
/// is an assumption (D14).
fn request_id(node: u8, config: &AxisConfig) -> Option<CanId> {
    match config.unsigned(AxisParameter::D5RequestId) {
        Some(id) => CanId::from_wire(id),
        None => Node::new(node).ok().map(|node| CanId(can::default_request_id(node).into())),
    }
}

/// The arbitration id of replies, where the axis names one.
fn reply_id(config: &AxisConfig) -> Option<CanId> {
    config.unsigned(AxisParameter::D5ReplyId).and_then(CanId::from_wire)
}

/// Whether a frame may be this axis's reply: it may carry any id unless the axis names one (D14).
pub(crate) fn accepts_id(config: &AxisConfig, frame: &CanFrame) -> bool {
    reply_id(config).is_none_or(|CanId(wanted)| frame.id() == wanted)
}

/// Whom a command is for, and its request. The frame that has every motor carry out what waits is
/// quick start (4).
fn addressed(command: &Command, node: u8) -> Option<(Address, Request)> {
    match command {
        Command::D5(request) => Some((Address::Node(Node::new(node).ok()?), *request)),
        Command::D5Execute => Some((Address::Broadcast, Request::Execute)),
        _ => None,
    }
}

/// The manual gives no CAN id of frames to all: that of the frame's own id byte, 0x0FE, in a frame
/// of the type that the motor of the axis is asked with, is an assumption.
fn to_can(command: &Command, node: u8, config: &AxisConfig) -> Option<CanFrame> {
    let (address, request) = addressed(command, node)?;
    let own = request_id(node, config)?;
    let CanId(id) = match address {
        Address::Node(_) => own,
        Address::Broadcast if own.is_extended() => CanId::extended(address.id().into())?,
        Address::Broadcast => CanId::standard(address.id().into())?,
    };
    can::request(id, address, &request).ok()
}

fn to_serial(command: &Command, node: u8) -> Option<SerialFrame> {
    let (address, request) = addressed(command, node)?;
    Vec::from_slice(&d5::request_frame(address, &request).ok()?).ok()
}

fn from_serial(frame: &[u8]) -> Option<Received> {
    let (node, reply) = d5::decode_reply_frame(frame.try_into().ok()?).ok()?;
    Some(Received::D5 { node: node.get(), reply })
}

/// Whether bytes are one whole frame that reads; the codec refuses one whose empty bytes are not.
/// Every motor answers what all of them are asked: only a query is meant so (table row 1).
fn reads_frame(bytes: &[u8]) -> bool {
    let Ok(frame) = <&[u8; FRAME_LEN]>::try_from(bytes) else { return false };
    d5::decode_request_frame(frame).is_ok_and(|(address, request)| {
        let to_all = address == Address::Broadcast && request != Request::QueryId;
        !to_all && effect(request, 1.0) == Some(Effect::Asks)
    })
}

fn command(exchange: Exchange, _: &AxisConfig) -> Option<Command> {
    let read_byte = |register| Request::Read { register, width: Width::Byte };
    let read_word = |register| Request::Read { register, width: Width::Word };
    let request = match exchange {
        Exchange::Stop => Request::Write { register: Register::SPEED, value: STANDSTILL },
        Exchange::OverwritePending => {
            Request::AsyncWrite { register: Register::SPEED, value: STANDSTILL }
        }
        Exchange::ExecutePending => Request::Execute,
        // Quick start (3) and (4).
        Exchange::ExecuteAll => return Some(Command::D5Execute),
        Exchange::PendingWrite => read_byte(Register::ASYNC_FLAG),
        Exchange::BrakeSwitch => read_byte(Register::BRAKE),
        Exchange::CommandedSpeed => read_word(Register::SPEED),
        Exchange::Velocity => read_word(Register::CURRENT_SPEED),
        Exchange::Position => read_word(Register::TRAVELLED_ANGLE),
        Exchange::Faults => read_byte(Register::STATUS),
        Exchange::DriverTemperature => read_byte(Register::BOARD_TEMPERATURE),
        Exchange::MotorTemperature => read_byte(Register::MOTOR_TEMPERATURE),
        Exchange::AckLevel => read_byte(Register::ACK_LEVEL),
        // It only switches the timeout on and off; how long that is nothing tells (D15).
        Exchange::TimeoutSwitch => read_byte(Register::TIMEOUT_SWITCH),
        Exchange::ClearFaults => {
            Request::Write { register: Register::CLEAR_PROTECTION, value: ONE }
        }
        Exchange::SetTimeout { timeout_ms } => {
            let value = if timeout_ms == 0 { Value::Byte(0) } else { ONE };
            Request::Write { register: Register::TIMEOUT_SWITCH, value }
        }
        _ => return None,
    };
    Some(Command::D5(request))
}

fn motion(_: u8, setpoint: Setpoint, config: &AxisConfig) -> Found<Command> {
    let Setpoint::Velocity { velocity_rad_s: value } = setpoint else { return Ok(None) };
    let limits = config.range(AxisParameter::VelocityLimitRadS);
    let speed = DEGREES.turned(Quantity::Velocity, value, limits, i16::MAX, config)?;
    let most = DEGREES.to_si(i16::MAX);
    let quantity = Quantity::Velocity;
    let out_of_range = Error::OutOfRange { quantity, value, min: -most, max: most };
    let word = d5::encode_speed(DegreesPerSecond(speed)).map_err(|_| out_of_range)?;
    let (register, value) = (Register::SPEED, Value::Word(word));
    Ok(Some(Command::D5(Request::Write { register, value })))
}

/// A speed that is to wait in the motor instead.
pub(crate) fn to_wait(command: Command) -> Command {
    match command {
        Command::D5(Request::Write { register, value }) => {
            Command::D5(Request::AsyncWrite { register, value })
        }
        other => other,
    }
}

/// A speed that was to wait, to act at once.
pub(crate) fn at_once(command: Command) -> Command {
    match command {
        Command::D5(Request::AsyncWrite { register, value }) => {
            Command::D5(Request::Write { register, value })
        }
        other => other,
    }
}

fn native(axis: u8, data: &[u8], config: &AxisConfig) -> Found<Native> {
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
    let effect = effect(request, config.sign());
    Ok(effect.map(|effect| Native { command: Command::D5(request), effect }))
}

/// Whether a motion writes the whole speed, or starts one that was checked when it was written.
/// Half a speed (table row 12) makes another one of what the motor holds, which no limit can be
/// checked against.
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
fn effect(request: Request, sign: f32) -> Option<Effect> {
    let velocity = |word| {
        let velocity_rad_s = sign * DEGREES.to_si(d5::decode_speed(word).0);
        Setpoint::Velocity { velocity_rad_s }
    };
    Some(match request {
        Request::Unknown { .. } => return None,
        Request::QueryId | Request::Read { .. } | Request::ReadMagneticAngle => Effect::Asks,
        Request::Write { register: Register::SPEED, value: Value::Word(word) } => {
            // That the other zero, 0x8000, stops a motor no manual says.
            Effect::of_setpoint(velocity(word), Value::Word(word) == STANDSTILL)
        }
        Request::AsyncWrite { register: Register::SPEED, value: Value::Word(word) } => {
            Effect::MovesOnce(Demand::Setpoint(velocity(word)))
        }
        // Printed of speeds only (quick start (3), rows 11 and 12). Any 05 carries out what waits,
        // whoever sends it, and nobody could check then what another id or level meets.
        Request::AsyncWrite { .. } => return None,
        Request::Execute => Effect::MovesOnce(Demand::Prepared),
        request if request.moves() => return None,
        Request::Reset => Effect::Changes { timeout: true },
        request => {
            let timeout = request.writes(Register::TIMEOUT_SWITCH) || request.writes(Register::ID);
            Effect::Changes { timeout }
        }
    })
}

/// What the motor keeps of a request. At speed 0 it locks itself (first list).
pub(super) fn sets(request: &Request) -> Sets {
    match *request {
        Request::Write { register: Register::SPEED, .. } => Sets::Output(true),
        Request::Write { register: Register::ACK_LEVEL, value: Value::Byte(level) } => {
            Sets::AckLevel(level)
        }
        Request::Write { register: Register::ID, value: Value::Word(id) } => {
            u8::try_from(id).map_or(Sets::Nothing, Sets::Node)
        }
        Request::Reset => Sets::Node(Node::FACTORY.get()),
        _ => Sets::Nothing,
    }
}

/// Whether a motor that holds this level answers a read of it (D12).
pub(super) fn answers_reads(level: u8) -> bool {
    !matches!(AckLevel::of(level), AckLevel::Nothing { .. })
}

/// Whether the motor answers a request at its level, which is the configured one. Whether it
/// answers the change of that level, by the old one or the new, the manual does not say: it is
/// waited for, and then read back (D12).
fn is_answered(request: &Request, config: &AxisConfig) -> bool {
    let level =
        config.unsigned(AxisParameter::D5AckLevel).and_then(|level| u8::try_from(level).ok());
    let level = level.map_or(AckLevel::ReadsAndWrites, AckLevel::of);
    level.answers(Address::Node(Node::FACTORY), request)
        || matches!(sets(request), Sets::AckLevel(_))
}

pub(super) fn judge(
    command: &Command,
    from: u8,
    reply: &Reply,
    config: &AxisConfig,
    seen: &mut Observation,
) -> Option<Outcome> {
    let Command::D5(request) = command else { return None };
    let (node, from) = (Node::new(config.node()?).ok()?, Node::new(from).ok()?);
    match d5::answer(request, node, from, reply) {
        Answer::Reply(reply) => {
            *seen = observe(&reply, config.sign());
            Some(Outcome::Answered)
        }
        // The motor has heard something else: so has it not heard the request.
        Answer::Refused(MotorError::Checksum) => None,
        Answer::Refused(_) => Some(Outcome::Refused),
        _ => None,
    }
}

/// What a reply is that answers nothing (table row 5).
pub(super) fn unasked(reply: &Reply) -> Unasked {
    match reply {
        Reply::Error { error: MotorError::Id, .. } => Unasked::Objection,
        _ => Unasked::Late,
    }
}

pub(super) fn observe(reply: &Reply, sign: f32) -> Observation {
    let mut seen = Observation::default();
    let Reply::Read { register, value } = *reply else { return seen };
    match (register, value) {
        (Register::CURRENT_SPEED, Value::Word(word)) => {
            seen.velocity_rad_s = Some(sign * DEGREES.to_si(d5::decode_speed(word).0));
        }
        (Register::TRAVELLED_ANGLE, Value::Word(word)) => {
            seen.position_rad = Some(sign * DEGREES.to_si(d5::decode_angle(word).0));
        }
        (Register::SPEED, Value::Word(word)) => {
            seen.commanded_zero = Some(d5::decode_speed(word).0 == 0);
        }
        (Register::STATUS, Value::Byte(bits)) => seen.faults = Some(u16::from(bits)),
        (Register::ASYNC_FLAG, Value::Byte(flag)) => seen.write_pending = Some(flag != 0),
        (Register::BRAKE, Value::Byte(on)) => seen.brake_locked = Some(on != 0),
        (Register::ACK_LEVEL, Value::Byte(level)) => seen.ack_level = Some(level),
        (Register::TIMEOUT_SWITCH, Value::Byte(on)) => seen.timeout_on = Some(on != 0),
        (Register::BOARD_TEMPERATURE, Value::Byte(byte)) => {
            seen.driver_temperature_c = Some(f32::from(d5::decode_temperature(byte).0));
        }
        (Register::MOTOR_TEMPERATURE, Value::Byte(byte)) => {
            seen.motor_temperature_c = Some(f32::from(d5::decode_temperature(byte).0));
        }
        _ => {}
    }
    seen
}
