//! The thruster/rudder CAN protocol in the core's words.

use super::convert::{DECIDEGREES, HUNDREDTHS, RPM, TENTHS, position};
use super::{
    Command, Demand, Effect, Exchange, Found, Ids, Info, Native, Outcome, Received, Sets, Unasked,
};
use crate::config::AxisConfig;
use crate::measured::Observation;
use embedded_can::StandardId;
use host_protocol::{
    AxisParameter, BusKind, CanId, Error, Protocol, Quantity, Setpoint, StopAction,
};
use thruster::{
    Answer, Deciamps, Decidegrees, Decivolts, EncodeError, Faults, Milliseconds, Node, Percent,
    Reply, Request, ReturnFlags, ReturnFrames, ReturnedFrame, Rpm, RpmLimit, can,
};

pub(super) static INFO: Info = Info {
    last_node: Node::MAX,
    can_bitrates: None,
    serial: None,
    free_ids: false,
    // Requests have 0x300 + node, replies and streams 0x280 + node.
    replies_outrank_stops: true,
    // The manual does not say that it does not (T21).
    resumes_when_asked: true,
    polled_to_hold: false,
    // The manual does not say that it keeps ST (§2.3).
    stores_timeout: false,
    timeouts_ms: (thruster::TIMEOUT_MIN as u32, thruster::TIMEOUT_MAX as u32),
    // What only reports (§3, protections; PROTOCOL-NOTES T20).
    reported_faults: Faults::REPORTED.bits(),
    sensor_faults: Faults::TEMPERATURE_SENSORS.bits(),
    speed: &RPM,
    position: &DECIDEGREES,
    // That of LA (§4.1); no range of QA is printed.
    farthest: thruster::POSITION_MAX,
    angle: None,
    own_parameters: &[
        AxisParameter::PositionDevice,
        AxisParameter::WarningsAreFaults,
        AxisParameter::ReturnMode,
        AxisParameter::Stream,
    ],
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
    recognising: &[],
    state: &[
        Exchange::Velocity,
        Exchange::Current,
        Exchange::Voltage,
        Exchange::MotorTemperature,
        Exchange::DriverTemperature,
        Exchange::Faults,
        Exchange::Position,
    ],
    // Only frames that VM asks for do (§2.4).
    polls: &[Exchange::Velocity, Exchange::Current],
    clearing: &[
        Exchange::ClearFaults,
        Exchange::Faults,
        Exchange::Velocity,
        Exchange::Current,
        Exchange::MotorTemperature,
        Exchange::DriverTemperature,
    ],
    restarting: &[],
    stops: &[(StopAction::Coast, &[Exchange::Stop, Exchange::PositionStop])],
    limits,
    can_confirm: |config| ReturnMode::of(config) != ReturnMode::Nothing,
    request_id: |node, _| id(node, can::request_id),
    // Streams come on the id of replies.
    ids: |node, _| Ids {
        sent: [id(node, can::request_id), None],
        replies: [id(node, can::reply_id), None],
        groups: [None; 2],
    },
    command,
    motion,
    at,
    native,
    is_answered: |_, _| true,
    to_can: |command, node, _| match command {
        Command::Thruster(request) => can::request(Node::new(node).ok()?, request).ok(),
        _ => None,
    },
    from_can: |frame| {
        let (node, reply) = can::decode_reply(frame).ok()?;
        Some(Received::Thruster { node: node.get(), reply })
    },
    reads: |frame| {
        let decoded = can::decode_request(frame);
        decoded.is_ok_and(|(_, request)| effect(request, 1.0) == Some(Effect::Asks))
    },
};

fn id(node: u8, of: fn(Node) -> StandardId) -> Option<CanId> {
    Node::new(node).ok().map(|node| CanId(of(node).into()))
}

/// Only a device with a position controller tells its position.
fn limits(_: BusKind, config: &AxisConfig) -> &'static [AxisParameter] {
    const LIMITS: &[AxisParameter] = &[
        AxisParameter::VelocityLimitRadS,
        AxisParameter::CurrentLimitA,
        AxisParameter::SignalLimit,
        AxisParameter::TemperatureLimitC,
        AxisParameter::PositionMinRad,
        AxisParameter::PositionMaxRad,
    ];
    match LIMITS {
        [others @ .., _min, _max] if !config.flag(AxisParameter::PositionDevice) => others,
        _ => LIMITS,
    }
}

fn command(exchange: Exchange, config: &AxisConfig) -> Option<Command> {
    let has_position = config.flag(AxisParameter::PositionDevice);
    let request = match exchange {
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
    };
    Some(Command::Thruster(request))
}

fn motion(axis: u8, setpoint: Setpoint, config: &AxisConfig) -> Found<Command> {
    let request = match setpoint {
        Setpoint::Signal { fraction } => {
            let limits = config.range(AxisParameter::SignalLimit);
            let signal = HUNDREDTHS.turned(Quantity::Signal, fraction, limits, 100, config)?;
            Request::Signal { signal: Percent(signal) }
        }
        Setpoint::Velocity { velocity_rad_s } => {
            let limits = config.range(AxisParameter::VelocityLimitRadS);
            let speed = RPM.turned(Quantity::Velocity, velocity_rad_s, limits, i16::MAX, config)?;
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
        Ok(_) => Ok(Some(Command::Thruster(request))),
        Err(refusal) => Err(in_si(setpoint, refusal, config)),
    }
}

fn at(command: Command, target: i32) -> Result<Command, (i32, i32)> {
    let Command::Thruster(Request::AbsolutePosition { speed, .. }) = command else {
        return Err((0, 0));
    };
    let request = Request::AbsolutePosition { speed, position: Decidegrees(target) };
    let taken = request.encode().map(|_| Command::Thruster(request));
    taken.map_err(|_| (thruster::POSITION_MIN, thruster::POSITION_MAX))
}

fn native(axis: u8, data: &[u8], config: &AxisConfig) -> Found<Native> {
    let Ok(request) = Request::decode(data) else { return Ok(None) };
    let positions =
        matches!(request, Request::AbsolutePosition { .. } | Request::RelativePosition { .. });
    if positions && !config.flag(AxisParameter::PositionDevice) {
        // A stop would not reach the position controller (GUARANTEES G4, stop table).
        return Err(Error::Unsupported { axis, protocol: Protocol::Thruster });
    }
    let effect = effect(request, config.sign());
    Ok(effect.map(|effect| Native { command: Command::Thruster(request), effect }))
}

/// What a request does; `None` where the manual lists no such command.
fn effect(request: Request, sign: f32) -> Option<Effect> {
    Some(match request {
        Request::Unknown { .. } => return None,
        request if request.only_reads() => Effect::Asks,
        Request::EmergencyStop => Effect::Stops,
        Request::Signal { signal } => {
            let fraction = sign * HUNDREDTHS.to_si(signal.0);
            Effect::of_setpoint(Setpoint::Signal { fraction }, signal.0 == 0)
        }
        Request::Speed { speed } => {
            let velocity_rad_s = sign * RPM.to_si(speed.0);
            Effect::of_setpoint(Setpoint::Velocity { velocity_rad_s }, speed.0 == 0)
        }
        Request::AbsolutePosition { speed, position } => {
            Effect::Moves(Demand::Setpoint(Setpoint::Position {
                position_rad: sign * DECIDEGREES.to_si(position.0),
                speed_limit_rad_s: RPM.to_si(speed.0),
            }))
        }
        Request::RelativePosition { speed, .. } => {
            Effect::MovesOnce(Demand::Distance { speed_limit_rad_s: RPM.to_si(speed.0) })
        }
        Request::SetTimeout { .. }
        | Request::SetId { .. }
        | Request::SetBitrate { .. }
        | Request::SetParameter { .. } => Effect::Changes { timeout: true },
        _ => Effect::Changes { timeout: false },
    })
}

/// What the device keeps of a request. A new id or bitrate acts when it is switched on again (T23).
pub(super) fn sets(request: &Request) -> Sets {
    match request {
        Request::SetTimeout { timeout } => Sets::Timeout(timeout.0.into()),
        Request::SetId { id } => u8::try_from(*id).map_or(Sets::Nothing, Sets::NextNode),
        Request::SetBitrate { bitrate } => {
            bitrate.info().map_or(Sets::Nothing, |info| Sets::Bitrate(info.bits_per_second))
        }
        // Bytes 5 to 7 of SR.
        Request::ConfigureStream { frames, interval } => {
            let word = u32::from(frames.bits()) << u16::BITS | u32::from(interval.0);
            Sets::Row(AxisParameter::Stream, word)
        }
        // Bytes 6 and 7 of VM.
        Request::ConfigureReturn { flags, frames } => {
            let word = u16::from_be_bytes([flags.bits(), frames.bits()]);
            Sets::Row(AxisParameter::ReturnMode, word.into())
        }
        _ => Sets::Nothing,
    }
}

/// The bitrates that CB can set, bit/s.
pub(super) fn bitrates() -> impl Iterator<Item = u32> {
    thruster::BITRATES.iter().map(|info| info.bits_per_second)
}

/// The codec's refusal of a setpoint, with the bounds in SI units.
fn in_si(setpoint: Setpoint, refusal: EncodeError, config: &AxisConfig) -> Error {
    let (quantity, value, (min, max)) = match setpoint {
        Setpoint::Position { position_rad, .. } => {
            let (min, max) = match refusal {
                EncodeError::OutOfRange { min, max, .. } => (min, max),
                _ => (i32::MIN.into(), i32::MAX.into()),
            };
            let bound = |count, end| DECIDEGREES.to_si(i32::try_from(count).unwrap_or(end));
            (Quantity::Position, position_rad, (bound(min, i32::MIN), bound(max, i32::MAX)))
        }
        // A speed the wire can carry is refused below the slowest, 0 or at least 30 rpm either way
        // (T14), and the one whose bytes mean a refusal: those between are taken.
        Setpoint::Velocity { velocity_rad_s } => {
            let slowest = thruster::SPEED_MIN_MAGNITUDE;
            let fastest = match refusal {
                EncodeError::Forbidden { value, .. } if value.unsigned_abs() > slowest.into() => {
                    value.unsigned_abs() - 1
                }
                _ => i16::MAX.unsigned_abs().into(),
            };
            let slowest = RPM.to_si(slowest);
            let fastest = RPM.to_si(i32::try_from(fastest).unwrap_or(i32::MAX));
            let fastest = fastest.min(config.limit(AxisParameter::VelocityLimitRadS));
            let bounds = if slowest > fastest {
                // The axis may not be as fast as the slowest speed.
                (0.0, 0.0)
            } else if velocity_rad_s < 0.0 {
                (-fastest, -slowest)
            } else {
                (slowest, fastest)
            };
            (Quantity::Velocity, velocity_rad_s, bounds)
        }
        Setpoint::Signal { fraction } => (Quantity::Signal, fraction, (-1.0, 1.0)),
        Setpoint::Current { current_a } => (Quantity::Current, current_a, (0.0, 0.0)),
        Setpoint::Impedance { torque_nm, .. } => (Quantity::Torque, torque_nm, (0.0, 0.0)),
    };
    Error::OutOfRange { quantity, value, min, max }
}

/// What answers TC and VC: VM can replace their echo (§2.4; PROTOCOL-NOTES T8, T9, T22).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReturnMode {
    /// The echo, which says the value that was taken.
    Echo,
    /// These frames with a header. Exactly one of them acknowledges: the lowest that is asked for.
    Frames(ReturnFrames),
    /// One frame without a header.
    Headerless,
    /// Nothing.
    Nothing,
}

impl ReturnMode {
    /// Bits of VM that the manual gives no meaning (§2.4): a device set so may return anything.
    pub const RESERVED: u32 = !0x0307;

    /// The mode that the axis says its device is set to: bytes 6 and 7 of VM.
    pub fn of(config: &AxisConfig) -> Self {
        let word = config.unsigned(AxisParameter::ReturnMode).unwrap_or_default();
        let [.., flags, frames] = word.to_be_bytes();
        let (flags, frames) =
            (ReturnFlags::from_bits_truncate(flags), ReturnFrames::from_bits_truncate(frames));
        if flags.contains(ReturnFlags::NO_RETURN) {
            Self::Nothing
        } else if flags.contains(ReturnFlags::NO_HEADER) {
            Self::Headerless
        } else if frames.is_empty() {
            Self::Echo
        } else {
            Self::Frames(frames)
        }
    }

    /// Whether a frame with a header acknowledges TC or VC. With several for one command the others
    /// could be taken for the acknowledgement of the next.
    fn acknowledges(self, frame: &ReturnedFrame) -> bool {
        let Self::Frames(frames) = self else { return false };
        u32::from(frame.number()) == frames.bits().trailing_zeros() + 1
    }

    /// How many frames answer one TC or VC.
    pub fn count(self) -> u8 {
        match self {
            Self::Frames(frames) => u8::try_from(frames.bits().count_ones()).unwrap_or(u8::MAX),
            Self::Echo | Self::Headerless | Self::Nothing => 1,
        }
    }
}

/// Whether VM changes what answers this request: signal and speed.
fn is_motion(request: &Request) -> bool {
    matches!(request, Request::Signal { .. } | Request::Speed { .. })
}

/// Whether the same reply may answer two different commands: a returned frame does not say the
/// value that was taken, and one without a header not even the command.
pub(super) fn are_answered_alike(one: &Command, other: &Command, config: &AxisConfig) -> bool {
    let (Command::Thruster(one), Command::Thruster(other)) = (one, other) else { return false };
    match ReturnMode::of(config) {
        ReturnMode::Echo | ReturnMode::Nothing => false,
        ReturnMode::Frames(_) => is_motion(one) && one.command() == other.command(),
        ReturnMode::Headerless => is_motion(one) && is_motion(other),
    }
}

pub(super) fn judge(
    command: &Command,
    reply: &Reply,
    config: &AxisConfig,
    seen: &mut Observation,
) -> Option<Outcome> {
    let Command::Thruster(request) = command else { return None };
    let mode = ReturnMode::of(config);
    match thruster::answer(request, reply) {
        // Which value it acknowledges it does not say (T22).
        Answer::Reply(Reply::Returned(returned)) if !mode.acknowledges(&returned.frame) => None,
        // The device repeats the value it has taken: another one belongs to an older request.
        Answer::Reply(Reply::Signal { signal }) if *request != (Request::Signal { signal }) => None,
        Answer::Reply(Reply::Speed { speed }) if *request != (Request::Speed { speed }) => None,
        Answer::Reply(Reply::Timeout { timeout })
            if *request != (Request::SetTimeout { timeout }) =>
        {
            None
        }
        Answer::Reply(reply) => {
            *seen = observe(&reply, config.sign());
            Some(Outcome::Answered)
        }
        Answer::Refused => Some(Outcome::Refused),
        Answer::Unrelated if mode == ReturnMode::Headerless && is_motion(request) => {
            let told = reply.headerless()?;
            see_motion(told.speed, told.voltage, told.current, config.sign(), seen);
            seen.faults = Some(told.faults.bits());
            Some(Outcome::Answered)
        }
        Answer::Unrelated | Answer::Unsolicited => None,
    }
}

/// Whether it is a frame that only TC or VC, this command, has the device return (§2.4).
pub(super) fn is_returned_for(command: &Command, reply: &Reply) -> bool {
    let Command::Thruster(request) = command else { return false };
    matches!(thruster::answer(request, reply), Answer::Reply(Reply::Returned(_)))
}

/// The kinds of frames that come unasked: three of SR and VM, and speed and current of ML and MM
/// (§2.1, §2.4, §2.5).
pub(super) fn unasked(reply: &Reply) -> Unasked {
    match reply {
        Reply::Returned(returned) => match returned.frame.number().checked_sub(1) {
            Some(kind) => Unasked::Telemetry(kind),
            None => Unasked::Late,
        },
        Reply::MeasuredSpeed { .. } => Unasked::Telemetry(3),
        Reply::Current { .. } => Unasked::Telemetry(4),
        _ => Unasked::Late,
    }
}

pub(super) fn observe(reply: &Reply, sign: f32) -> Observation {
    let mut seen = Observation::default();
    match reply {
        Reply::MeasuredSpeed { speed } => seen.velocity_rad_s = Some(sign * RPM.to_si(speed.0)),
        Reply::Current { current } => seen.current_a = Some(sign * TENTHS.to_si(current.0)),
        Reply::Voltage { voltage } => seen.voltage_v = Some(TENTHS.to_si(voltage.0)),
        Reply::MotorTemperature { temperature } => {
            seen.motor_temperature_c = Some(f32::from(temperature.0));
        }
        Reply::DriverTemperature { temperature } => {
            seen.driver_temperature_c = Some(f32::from(temperature.0));
        }
        Reply::Faults { faults } => seen.faults = Some(faults.bits()),
        Reply::FaultRecord { faults } => seen.fault_record = Some(faults.bits()),
        Reply::MeasuredPosition { position } => {
            seen.position_rad = Some(sign * DECIDEGREES.to_si(position.0));
            seen.position_count = Some(position.0);
        }
        Reply::Returned(returned) => match returned.frame {
            ReturnedFrame::Motion { speed, voltage, current } => {
                see_motion(speed, voltage, current, sign, &mut seen);
            }
            ReturnedFrame::Condition { faults, motor_temperature, driver_temperature } => {
                seen.faults = Some(faults.bits());
                seen.motor_temperature_c = Some(f32::from(motor_temperature.0));
                seen.driver_temperature_c = Some(f32::from(driver_temperature.0));
            }
            // How six bytes hold the two positions is not given (T9).
            ReturnedFrame::Position { .. } => {}
        },
        _ => {}
    }
    seen
}

/// Speed, voltage and current as one frame tells them.
fn see_motion(
    speed: Rpm,
    voltage: Decivolts,
    current: Deciamps,
    sign: f32,
    seen: &mut Observation,
) {
    seen.velocity_rad_s = Some(sign * RPM.to_si(speed.0));
    seen.voltage_v = Some(TENTHS.to_si(voltage.0));
    seen.current_a = Some(sign * TENTHS.to_si(current.0));
}
