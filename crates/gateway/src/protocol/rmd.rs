//! MyActuator RMD in the core's words, in the dialect of each axis (docs/rmd-dialects.md).

use super::convert::{CENTIDEGREES, DEGREES, HUNDREDTHS, TENTHS, from_span, position, to_span};
use super::{
    AngleForm, Command, Deframer, Demand, Effect, Exchange, Found, Ids, Info, Native, Outcome,
    Received, Serial, SerialFrame, Sets, Unasked,
};
use crate::config::AxisConfig;
use crate::measured::{Observation, Versions};
use crate::time::Duration;
use embedded_can::StandardId;
use heapless::Vec;
use host_protocol::StopAction::{Brake, Coast, Hold};
use host_protocol::{AxisParameter, BusKind, CanId, Error, Quantity, Setpoint};
use rmd::rs485::{self, FRAME_LEN};
use rmd::{
    Answer, Centiamps, Centidegrees, CentidegreesPerSecond, Dialect, Dialects, Function,
    Milliseconds, Motion, MotionCommand, MotionFeedback, Node, PROBES, Reply, Request, SpeedLimit,
    TorqueCap, can,
};

/// The place of the model among the reads that tell the dialect.
const MODEL_PROBE: u8 = 1;

/// Hundredths of a degree in the degree of the replies' angle.
const CENTI: i32 = 100;

pub(super) static INFO: Info = Info {
    last_node: Node::MAX,
    can_bitrates: None,
    serial: Some(Serial {
        frame_len: FRAME_LEN,
        data_at: 3,
        deframer: Deframer::Rmd(rs485::Deframer::new()),
        encode: to_serial,
        decode: from_serial,
        reads: reads_serial,
    }),
    free_ids: false,
    replies_outrank_stops: false,
    // What comes first after its timeout it ignores, and it stays without output (R20).
    resumes_when_asked: false,
    polled_to_hold: true,
    // It writes its timeout to ROM (§2.30).
    stores_timeout: true,
    // Any (§2.30), but while it is being stopped it hears something every 5 ms.
    timeouts_ms: (20, u32::MAX),
    reported_faults: 0,
    sensor_faults: 0,
    speed: &DEGREES,
    position: &CENTIDEGREES,
    // All turns of 0x92 (§2.11).
    farthest: i32::MAX,
    // Whole degrees in 16 bits (RMD V3.6 §2.13.3); 60 000 °/s² (§2.4).
    angle: Some(AngleForm { step: CENTI, span: 65_536 * CENTI, acceleration_rad_s2: 1_047.2 }),
    own_parameters: &[
        AxisParameter::ReleaseBrakeWhenArming,
        AxisParameter::AllowUnverifiedBrake,
        AxisParameter::MotionPositionRad,
        AxisParameter::MotionVelocityRadS,
        AxisParameter::MotionTorqueNm,
        AxisParameter::MotionStiffness,
        AxisParameter::MotionDamping,
        AxisParameter::RmdDialect,
        AxisParameter::TorqueCap,
    ],
    // 0x81 twice: after a communication timeout the first command is echoed and ignored
    // (PROTOCOL-NOTES R20).
    arming: &[
        Exchange::Stop,
        Exchange::Stop,
        Exchange::RunTime,
        Exchange::Version(0),
        Exchange::Version(1),
        Exchange::Version(2),
        Exchange::Version(0),
        Exchange::Version(1),
        Exchange::Version(2),
        Exchange::Identity(0),
        Exchange::Identity(1),
        Exchange::Identity(2),
        Exchange::Identity(3),
        Exchange::ReleaseBrake,
        Exchange::Velocity,
        Exchange::Position,
        Exchange::Faults,
    ],
    // Twice each, and never one after itself: what a motor does not know it may answer with a copy
    // of its last reply.
    recognising: &[
        Exchange::RunTime,
        Exchange::Version(0),
        Exchange::Version(1),
        Exchange::Version(2),
        Exchange::Version(0),
        Exchange::Version(1),
        Exchange::Version(2),
    ],
    state: &[Exchange::Velocity, Exchange::Position, Exchange::Faults],
    polls: &[Exchange::Velocity],
    // There is no command that clears a fault (§8).
    clearing: &[Exchange::Faults, Exchange::Velocity, Exchange::Position],
    restarting: &[
        Exchange::RunTime,
        Exchange::OutputOff,
        Exchange::Restart,
        Exchange::RunTime,
        Exchange::Faults,
        Exchange::Velocity,
        Exchange::Position,
    ],
    stops: &[
        (Coast, &[Exchange::Stop]),
        (Hold, &[Exchange::Stop, Exchange::Velocity]),
        (
            Brake,
            &[
                Exchange::Stop,
                Exchange::Velocity,
                Exchange::LockBrake,
                Exchange::Faults,
                Exchange::OutputOff,
                Exchange::Velocity,
            ],
        ),
    ],
    limits,
    can_confirm: |_| true,
    request_id: |node, _| id(node, can::request_id),
    ids: |node, _| Ids {
        sent: [id(node, can::request_id), id(node, can::motion_request_id)],
        replies: [id(node, can::reply_id), id(node, can::motion_reply_id)],
        groups: [CanId::standard(can::BROADCAST_ID.into()), CanId::standard(can::CAN_ID_ID.into())],
    },
    command,
    motion,
    at,
    native,
    is_answered: |command, _| request_of(command).is_some_and(|request| request.is_answered()),
    to_can: |command, node, _| can::request(Node::new(node).ok()?, &request_of(command)?).ok(),
    from_can: |frame| {
        let (node, reply) = can::decode_reply_in(TOLD_BY_FORM, frame).ok()?;
        Some(Received::Rmd { node: node.get(), reply })
    },
    reads: |frame| {
        can::decode_any_request(frame).is_ok_and(|(_, request)| reads_by(request, frame.data()))
    },
};

/// Replies are read before it is known whose they are: their form tells which dialect's they are.
const TOLD_BY_FORM: Dialect = Dialect::Unknown;

/// The request that a command is.
fn request_of(command: &Command) -> Option<Request> {
    match command {
        Command::Rmd(request) => Some(*request),
        Command::RmdProbe(place) => PROBES.get(usize::from(*place)).copied(),
        _ => None,
    }
}

/// One bit for each dialect that can be recognised.
pub(super) const KNOWN: u8 = Dialects::KNOWN.bits();

/// Whether an answer that these dialects have to the read of the model is the first of its parts.
pub(super) fn is_part_of_model(dialects: Versions) -> bool {
    dialects.only() == Some(Dialect::V4_4 as u8)
}

/// The data bytes of the reads whose answers tell the dialect.
pub(super) fn probes() -> impl Iterator<Item = [u8; rmd::DATA_LEN]> {
    PROBES.iter().map(|probe| probe.encode().unwrap_or_default())
}

/// The number of the dialect that the axis states, 0 where it states none.
pub(crate) fn stated_version(config: &AxisConfig) -> u8 {
    dialect(config) as u8
}

/// The dialect of the axis's motor.
fn dialect(config: &AxisConfig) -> Dialect {
    let number = config.unsigned(AxisParameter::RmdDialect);
    number.and_then(Dialect::from_number).unwrap_or(Dialect::Unknown)
}

/// The torque cap of the axis.
fn torque_cap(config: &AxisConfig) -> Option<TorqueCap> {
    let cap = config.unsigned(AxisParameter::TorqueCap)?;
    u8::try_from(cap).ok().map(TorqueCap)
}

/// Refuses a torque cap that the motor would ignore.
pub(crate) fn check_dialect(axis: u8, config: &AxisConfig) -> Result<(), Error> {
    match torque_cap(config) {
        Some(_) if !dialect(config).has_torque_cap() => {
            Err(Error::NotInDialect { axis, command: rmd::command::CAPPED_POSITION })
        }
        _ => Ok(()),
    }
}

/// The request that eight bytes are to the axis's motor.
fn native(axis: u8, data: &[u8], config: &AxisConfig) -> Found<Native> {
    let Ok(data) = data.try_into() else { return Ok(None) };
    let dialect = dialect(config);
    let request = Request::decode_in(dialect, data);
    if let Request::Unknown { .. } = request
        && Request::dialects_of(data) != Dialects::NONE
    {
        return Err(Error::NotInDialect { axis, command: request.command() });
    }
    let Some(effect) = effect(request, config.sign()) else { return Ok(None) };
    if request.is_stored_only_off(dialect) && config.stop_action() == Some(Hold) {
        return Err(Error::OutputStaysOn { axis });
    }
    let is_capped = match (torque_cap(config), request) {
        (None, _) => true,
        (Some(most), Request::CappedVelocity { cap, .. } | Request::CappedPosition { cap, .. }) => {
            cap <= most
        }
        // A current has its own limit.
        (Some(_), Request::TorqueCurrent { .. }) => true,
        _ => !matches!(effect, Effect::Moves(_) | Effect::MovesOnce(_)),
    };
    if !is_capped {
        return Err(Error::CannotCheckLimit { axis, quantity: Quantity::Torque });
    }
    Ok(Some(Native { command: Command::Rmd(request), effect }))
}

fn id(node: u8, of: fn(Node) -> StandardId) -> Option<CanId> {
    Node::new(node).ok().map(|node| CanId(of(node).into()))
}

/// Torque is told in motion mode alone, which has no serial form (§5).
fn limits(bus: BusKind, _: &AxisConfig) -> &'static [AxisParameter] {
    const LIMITS: &[AxisParameter] = &[
        AxisParameter::VelocityLimitRadS,
        AxisParameter::CurrentLimitA,
        AxisParameter::PositionMinRad,
        AxisParameter::PositionMaxRad,
        AxisParameter::TemperatureLimitC,
        AxisParameter::TorqueLimitNm,
    ];
    match (bus, LIMITS) {
        (BusKind::Rs485, [others @ .., _torque]) => others,
        _ => LIMITS,
    }
}

fn to_serial(command: &Command, node: u8) -> Option<SerialFrame> {
    let request = request_of(command)?;
    Vec::from_slice(&rs485::request(Node::new(node).ok()?, &request).ok()?).ok()
}

fn from_serial(frame: &[u8]) -> Option<Received> {
    let (node, reply) = rs485::decode_reply_in(TOLD_BY_FORM, frame.try_into().ok()?).ok()?;
    Some(Received::Rmd { node: node.get(), reply })
}

fn reads_serial(bytes: &[u8]) -> bool {
    let Ok(frame) = bytes.try_into() else { return false };
    let Ok((_, request)) = rs485::decode_any_request(frame) else { return false };
    let [_, _, _, data @ .., _, _] = frame;
    reads_by(request, data)
}

/// Whether a request reads, and its bytes are those that the manual prints: the codec overlooks
/// bytes without a meaning. What motors of an unknown dialect may be asked reads in every one.
fn reads_by(request: Request, data: &[u8]) -> bool {
    let reads = |request: Request| {
        effect(request, 1.0) == Some(Effect::Asks)
            && request.encode().is_ok_and(|bytes| bytes == data)
    };
    let in_any_dialect = || {
        // Under an id of their own the bytes mean something else, as in motion mode.
        let data = data.first_chunk().filter(|data| Request::decode(data) == request)?;
        Some(Request::decode_in(Dialect::Unknown, data))
    };
    reads(request) || in_any_dialect().is_some_and(reads)
}

fn command(exchange: Exchange, config: &AxisConfig) -> Option<Command> {
    let request = match exchange {
        Exchange::Stop => match config.stop_action()? {
            Coast => Request::Shutdown,
            Hold | Brake => Request::Stop,
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
        Exchange::Version(place) => return Some(Command::RmdProbe(place)),
        Exchange::Identity(0) => Request::ReadVersionDate,
        // In whatever form it answers.
        Exchange::Identity(1) => return Some(Command::RmdProbe(MODEL_PROBE)),
        Exchange::Identity(part) => Request::ReadModelPart { part },
        _ => return None,
    };
    Some(Command::Rmd(request))
}

fn motion(axis: u8, setpoint: Setpoint, config: &AxisConfig) -> Found<Command> {
    let request = match setpoint {
        Setpoint::Impedance { .. } => {
            check_ranges(axis, config)?;
            Request::MotionMode { command: impedance(setpoint, config)? }
        }
        Setpoint::Current { current_a } => {
            let limits = config.range(AxisParameter::CurrentLimitA);
            let current =
                HUNDREDTHS.turned(Quantity::Current, current_a, limits, i16::MAX, config)?;
            Request::TorqueCurrent { current: Centiamps(current) }
        }
        Setpoint::Velocity { velocity_rad_s } => {
            let limits = config.range(AxisParameter::VelocityLimitRadS);
            let speed = CENTIDEGREES.turned(
                Quantity::Velocity,
                velocity_rad_s,
                limits,
                i32::MAX,
                config,
            )?;
            let speed = CentidegreesPerSecond(speed);
            match torque_cap(config) {
                Some(cap) => Request::CappedVelocity { cap, speed },
                None => Request::Velocity { speed },
            }
        }
        Setpoint::Position { position_rad, speed_limit_rad_s } => {
            // What a speed of 0 means the manual does not say, newer ones say unlimited
            // (PROTOCOL-NOTES R33).
            let (max_speed, angle) =
                position(axis, speed_limit_rad_s, &DEGREES, position_rad, &CENTIDEGREES, config)?;
            let (max_speed, angle) = (SpeedLimit(max_speed), Centidegrees(angle));
            match torque_cap(config) {
                Some(cap) => Request::CappedPosition { cap, max_speed, angle },
                None => Request::AbsolutePosition { max_speed, angle },
            }
        }
        Setpoint::Signal { .. } => return Ok(None),
    };
    Ok(Some(Command::Rmd(request)))
}

fn at(command: Command, target: i32) -> Result<Command, (i32, i32)> {
    let angle = Centidegrees(target);
    Ok(Command::Rmd(match command {
        Command::Rmd(Request::AbsolutePosition { max_speed, .. }) => {
            Request::AbsolutePosition { max_speed, angle }
        }
        Command::Rmd(Request::CappedPosition { cap, max_speed, .. }) => {
            Request::CappedPosition { cap, max_speed, angle }
        }
        _ => return Err((0, 0)),
    }))
}

/// Bits of the position word, and of the others (§5).
const POSITION_BITS: u32 = 16;
const WORD_BITS: u32 = 12;
/// The divisors with which the manual reads the words back (§5.4).
const WORD_DIVISOR: f32 = 4095.0;

/// Where the ends of the position range are in V4.4, rad.
const V4_4_POSITION_RAD: f32 = 12.566;

/// Refuses motion mode whose ranges are not known. Those of torque and damping differ between
/// motors of V4.4: with the ones of older motors they would be many times what was asked for.
fn check_ranges(axis: u8, config: &AxisConfig) -> Result<(), Error> {
    let needed = match dialect(config) {
        Dialect::Unknown => return Err(Error::NotInDialect { axis, command: 0 }),
        Dialect::V4_4 => &[AxisParameter::MotionTorqueNm, AxisParameter::MotionDamping][..],
        _ => &[],
    };
    match needed.iter().find(|parameter| !config.is_set(**parameter)) {
        Some(parameter) => Err(Error::NotConfigured { axis, parameter: parameter.number() }),
        None => Ok(()),
    }
}

/// The end of a range of motion mode.
fn range_end(parameter: AxisParameter, config: &AxisConfig) -> Option<f32> {
    let is_default = !config.is_set(parameter);
    if (parameter, dialect(config)) == (AxisParameter::MotionPositionRad, Dialect::V4_4)
        && is_default
    {
        return Some(V4_4_POSITION_RAD);
    }
    config.float(parameter)
}

/// The words of an impedance setpoint in the ranges that the axis states; any other setpoint asks
/// for nothing.
fn impedance(setpoint: Setpoint, config: &AxisConfig) -> Result<MotionCommand, Error> {
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
    let end = |parameter| range_end(parameter, config).unwrap_or(0.0);
    // The range is the same in both senses of rotation, the limits are turned.
    let word = |quantity, value: f32, range: (f32, f32), bits, limits: (f32, f32), sign: f32| {
        let limits = if sign < 0.0 { (-limits.1, -limits.0) } else { limits };
        let refused = Error::OutOfRange { quantity, value, min: range.0, max: range.1 };
        to_span(sign * value, range, bits, limits).ok_or(refused)
    };
    let two_sided = |quantity, value, parameter, bits, limits| {
        word(quantity, value, (-end(parameter), end(parameter)), bits, limits, config.sign())
    };
    let gain = |quantity, value, parameter| {
        word(quantity, value, (0.0, end(parameter)), WORD_BITS, (0.0, end(parameter)), 1.0)
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

/// What a request does; `None` where no manual lists it, or no native command may do it: what is
/// fed forward and single-turn positions obey no limit, a reply that the motor sends by itself
/// takes its polls away, and of a new id the gateway would learn nothing.
fn effect(request: Request, sign: f32) -> Option<Effect> {
    let position = |angle: Centidegrees| sign * CENTIDEGREES.to_si(angle.0);
    Some(match request {
        Request::Unknown { .. }
        | Request::SpeedFedPosition { .. }
        | Request::TorqueFedPosition { .. }
        | Request::SingleTurnPosition { .. }
        | Request::SetActiveReply { .. }
        | Request::Function { function: Function::NextCanId { .. } } => return None,
        request if request.only_reads() => Effect::Asks,
        Request::Shutdown | Request::Stop => Effect::Stops,
        Request::TorqueCurrent { current } => {
            let current_a = sign * HUNDREDTHS.to_si(current.0);
            Effect::Moves(Demand::Setpoint(Setpoint::Current { current_a }))
        }
        Request::Velocity { speed } | Request::CappedVelocity { speed, .. } => {
            let velocity_rad_s = sign * CENTIDEGREES.to_si(speed.0);
            Effect::Moves(Demand::Setpoint(Setpoint::Velocity { velocity_rad_s }))
        }
        Request::PositionTracking { angle } => {
            Effect::Moves(Demand::Unlimited { position_rad: position(angle) })
        }
        Request::AbsolutePosition { max_speed, angle }
        | Request::CappedPosition { max_speed, angle, .. } => {
            Effect::Moves(Demand::Setpoint(Setpoint::Position {
                position_rad: position(angle),
                speed_limit_rad_s: DEGREES.to_si(max_speed.0),
            }))
        }
        Request::LimitedPositionTracking { max_speed, angle } => {
            let speed_limit_rad_s = CENTIDEGREES.to_si(max_speed.0);
            Effect::Moves(Demand::Tracking { position_rad: position(angle), speed_limit_rad_s })
        }
        Request::IncrementalPosition { max_speed, .. } => {
            let speed_limit_rad_s = DEGREES.to_si(max_speed.0);
            Effect::MovesOnce(Demand::Distance { speed_limit_rad_s })
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

/// What the motor keeps of a request.
pub(super) fn sets(request: &Request) -> Sets {
    match request {
        Request::Stop => Sets::Output(true),
        Request::Shutdown => Sets::Output(false),
        Request::SetCommunicationTimeout { timeout } => Sets::Timeout(timeout.0),
        request if request.acts_after_restart() => Sets::AfterRestart,
        _ => Sets::Nothing,
    }
}

/// Whether the motor follows such targets from one command to the next: 0xA5.
pub(crate) fn tracks(command: &Command) -> bool {
    matches!(command, Command::Rmd(Request::LimitedPositionTracking { .. }))
}

/// Whether the reply to a motion tells all that replies to motions of its protocol do, so that this
/// need not be read as well. In motion mode it leaves out position and current (§5.4).
pub(crate) fn tells_state(command: &Command) -> bool {
    !matches!(command, Command::Rmd(Request::MotionMode { .. }))
}

/// How long a motor may take for its brake: 50 to 150 ms were seen (PROTOCOL-NOTES R20).
pub(super) const BRAKE_TAKES: Duration = Duration::from_millis(160);

/// The reply window of a command where the motor needs longer than its bus's window. While its
/// brake locks, nobody else tells the motor to hold.
pub(crate) fn slow_reply(command: &Command) -> Option<Duration> {
    match command {
        Command::Rmd(Request::ReleaseBrake) => Some(Duration::from_millis(300)),
        Command::Rmd(Request::LockBrake) => Some(BRAKE_TAKES),
        _ => None,
    }
}

/// What a frame is to a read whose answer tells the dialect: an older motor passes its index over,
/// so the form counts, not the index alone.
fn judge_probe(place: u8, reply: &Reply, seen: &mut Observation) -> Option<Outcome> {
    let dialects = rmd::tells(PROBES.get(usize::from(place))?, &reply.encode().ok()?)?;
    seen.versions = Versions::of_bits(dialects.bits());
    Some(Outcome::Answered)
}

pub(super) fn judge(
    command: &Command,
    reply: &Reply,
    config: &AxisConfig,
    seen: &mut Observation,
) -> Option<Outcome> {
    if let Command::RmdProbe(place) = command {
        return judge_probe(*place, reply, seen);
    }
    let Command::Rmd(request) = command else { return None };
    match rmd::answer(request, reply) {
        Answer::Reply(
            Reply::TorqueCurrent { motion }
            | Reply::Velocity { motion }
            | Reply::PositionTracking { motion }
            | Reply::AbsolutePosition { motion }
            | Reply::CappedPosition { motion }
            | Reply::LimitedPositionTracking { motion },
        ) if may_be_thrown_back(request, reply, motion) => {
            seen.may_be_thrown_back = true;
            Some(Outcome::Answered)
        }
        Answer::Reply(reply) => {
            *seen = observe(&reply, config);
            Some(Outcome::Answered)
        }
        Answer::NotExecuted => Some(Outcome::Echoed),
        _ => None,
    }
}

/// Whether an answer may as well be the request thrown back, and so tells nothing: all zero, or all
/// but a temperature that is the request's torque cap (PROTOCOL-NOTES R30).
fn may_be_thrown_back(request: &Request, reply: &Reply, motion: Motion) -> bool {
    let cold = Motion { temperature: Motion::default().temperature, ..motion };
    let is_like_request = || motion == cold || reply.repeats(request);
    cold == Motion::default() && is_like_request()
}

/// What a reply is that answers nothing. 0x9A comes every 100 ms while a fault lasts, where the
/// motor is set so (PROTOCOL-NOTES R16).
pub(super) fn unasked(reply: &Reply) -> Unasked {
    match reply {
        Reply::TimeoutNotice { .. } | Reply::Status1 { .. } => Unasked::Notice,
        _ => Unasked::Late,
    }
}

pub(super) fn observe(reply: &Reply, config: &AxisConfig) -> Observation {
    let mut seen = Observation::default();
    let sign = config.sign();
    match reply {
        Reply::MotionMode { feedback } => observe_impedance(feedback, config, &mut seen),
        Reply::MultiTurnAngle { angle } => {
            seen.position_rad = Some(sign * CENTIDEGREES.to_si(angle.0));
            seen.position_count = Some(angle.0);
        }
        Reply::Status1 { temperature, brake_released, voltage, faults } => {
            seen.motor_temperature_c = Some(f32::from(temperature.0));
            seen.brake_locked = Some(!brake_released);
            seen.voltage_v = Some(TENTHS.to_si(voltage.0));
            seen.faults = Some(faults.bits());
        }
        Reply::RunTime { time } => seen.run_time_ms = Some(time.0),
        Reply::Status2 { motion }
        | Reply::TorqueCurrent { motion }
        | Reply::Velocity { motion }
        | Reply::PositionTracking { motion }
        | Reply::AbsolutePosition { motion }
        | Reply::CappedPosition { motion }
        | Reply::LimitedPositionTracking { motion }
        | Reply::IncrementalPosition { motion } => {
            seen.motor_temperature_c = Some(f32::from(motion.temperature.0));
            seen.angle_count = Some(i32::from(motion.angle.0) * CENTI);
            seen.current_a = Some(sign * HUNDREDTHS.to_si(motion.current.0));
            seen.velocity_rad_s = Some(sign * DEGREES.to_si(motion.speed.0));
        }
        _ => {}
    }
    seen
}

/// What a reply in motion mode tells. Its position ends at the ends of its range and is left out:
/// positions come from 0x92.
fn observe_impedance(feedback: &MotionFeedback, config: &AxisConfig, seen: &mut Observation) {
    let read = |word, parameter| {
        let end = range_end(parameter, config)?;
        Some(config.sign() * from_span(word, (-end, end), WORD_DIVISOR))
    };
    seen.velocity_rad_s = read(feedback.velocity, AxisParameter::MotionVelocityRadS);
    seen.torque_nm = read(feedback.torque, AxisParameter::MotionTorqueNm);
}

#[cfg(test)]
#[path = "../../tests/unit/impedance.rs"]
mod tests;
