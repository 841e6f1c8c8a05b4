//! The motor protocols in the core's words. Each is one file and its [`Info`]: what its motors can
//! and need, which exchanges arm, read, clear and stop them, and the functions that turn the core's
//! words into its commands and its replies into observations. Nothing else in the core names a
//! protocol (`.ci/protocol-names`).

mod convert;
mod d5;
mod exchange;
mod ids;
mod native;
mod raw;
mod rmd;
mod serial;
mod stream;
mod thruster;
mod versions;

pub(crate) use d5::{accepts_id, at_once, to_wait};
pub(crate) use exchange::Exchange;
pub(crate) use ids::{
    Ids, has_extended_ids, has_extended_request_id, reply_id, sent_on_an_id_of, stop_id,
};
pub(crate) use native::{Demand, Effect, Native, native};
pub(crate) use raw::{is_harmless_on_can, is_harmless_on_serial};
pub(crate) use rmd::{check_dialect, slow_reply, stated_version, tells_state, tracks};
pub(crate) use serial::{Deframer, Serial, SerialFrame};
pub(crate) use stream::Stream;
pub(crate) use versions::Evidence;

use crate::config::AxisConfig;
use crate::measured::{Observation, Versions};
use crate::time::Duration;
use convert::Scale;
use host_protocol::{
    AxisParameter, BusKind, CanFrame, CanId, Error, Protocol, ProtocolSet, Quantity, Setpoint,
    StopAction,
};
use rmd::BRAKE_TAKES;
use serde::{Deserialize, Serialize};
use thruster::ReturnMode;

/// A command for a motor in the words of its protocol's codec.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Command {
    Rmd(::rmd::Request),
    /// A read whose answer tells the dialect by its form, by its place among those.
    RmdProbe(u8),
    Thruster(::thruster::Request),
    D5(::d5::Request),
    /// Every D5 motor of the bus carries out what waits in it.
    D5Execute,
}

/// A decoded frame of a motor and the node that sent it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Received {
    Rmd { node: u8, reply: ::rmd::Reply },
    Thruster { node: u8, reply: ::thruster::Reply },
    D5 { node: u8, reply: ::d5::Reply },
}

/// How a request ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The motor has answered, or has got a request that it does not answer.
    Answered,
    /// The motor refuses it.
    Refused,
    /// The motor has thrown it back: received, not carried out.
    Echoed,
    /// No reply came within its window, or its frame did not leave.
    NoReply,
}

/// What a received frame is that answers nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unasked {
    /// A reply that nobody waits for any more.
    Late,
    /// Motors send it on their own account; the host should see it.
    Notice,
    /// A value that the motor is set to send by itself, or beyond its reply: its kind, from 0.
    Telemetry(u8),
    /// The motor says that a request was not for it.
    Objection,
}

/// What a motor keeps of a command, beyond what the command has it do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sets {
    /// Nothing that the core must know of.
    Nothing,
    /// Its output is on, or off.
    Output(bool),
    /// Its node, at once: it answers from the new one.
    Node(u8),
    /// Its node, once it is switched on again.
    NextNode(u8),
    /// Its bitrate, once it is switched on again, bit/s.
    Bitrate(u32),
    /// What this parameter of the axis says of it.
    Row(AxisParameter, u32),
    /// Which commands it answers, so that the reply to this one may stay away.
    AckLevel(u8),
    /// Its own timeout, ms; 0 switches it off.
    Timeout(u32),
    /// Something that acts after it has restarted.
    AfterRestart,
}

/// What a motor has for something, if it has it, or why it is refused.
pub(crate) type Found<T> = Result<Option<T>, Error>;

/// A position told with few bits, in counts of [`Info::position`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct AngleForm {
    /// One step.
    pub step: i32,
    /// After so many counts it starts again, or stays: the last step to both sides of 0 tells
    /// nothing.
    pub span: i32,
    /// The hardest acceleration that a motor can be set to.
    pub acceleration_rad_s2: f32,
}

/// What the core must know of a protocol. A step for which a motor has no command is passed over.
pub(crate) struct Info {
    /// Nodes are 1 to this one.
    pub last_node: u8,
    /// The lowest and the highest bitrate on CAN, bit/s; `None`: any that the board has.
    pub can_bitrates: Option<(u32, u32)>,
    /// Its form on RS485, if it has one.
    pub serial: Option<Serial>,
    /// Its manual gives no CAN ids: motors answer any id, and with the id that they were asked
    /// with, which is an assumption. It shares a bus with no other protocol.
    pub free_ids: bool,
    /// On CAN its replies win the arbitration against its stops.
    pub replies_outrank_stops: bool,
    /// Whatever a motor hears may set it in motion: one that its own timeout has stopped may go on
    /// with its old setpoint.
    pub resumes_when_asked: bool,
    /// Its motors hold only while they hear something, and ignore what they are told first behind
    /// their own timeout.
    pub polled_to_hold: bool,
    /// Its motors keep their own timeout without power.
    pub stores_timeout: bool,
    /// What the motor's own timeout can be set to beside 0, which is off, ms.
    pub timeouts_ms: (u32, u32),
    /// Bits of the fault word that a motor only reports, and those of them that say that its
    /// temperature is not known.
    pub reported_faults: u16,
    pub sensor_faults: u16,
    /// The units in which its motors tell their speed and their position.
    pub(in crate::protocol) speed: &'static Scale,
    pub(in crate::protocol) position: &'static Scale,
    /// The farthest position that they tell to either side, in its unit.
    pub farthest: i32,
    /// How replies to setpoints tell the position, where they do, and with it the speed.
    pub angle: Option<AngleForm>,
    /// The parameters that only its motors have, beside limits.
    pub own_parameters: &'static [AxisParameter],
    /// Before motion is allowed.
    pub arming: &'static [Exchange],
    /// For a host that asks which version the motor speaks; arming does the same.
    pub recognising: &'static [Exchange],
    /// For a host that reads the state.
    pub state: &'static [Exchange],
    /// In turn while armed, beside the fault word and the position.
    pub polls: &'static [Exchange],
    /// Before a trip is cleared.
    pub clearing: &'static [Exchange],
    /// A restart of the motor, and what comes before a trip is cleared after it.
    pub restarting: &'static [Exchange],
    /// The stop actions that its motors can carry out, and the steps of each: `Stop` until it is
    /// acknowledged, what follows once; `Velocity` is standstill, `Faults` the brake seen locked.
    pub stops: &'static [(StopAction, &'static [Exchange])],
    /// The limits that can act: its motors measure what is limited, or setpoints carry it.
    pub limits: fn(BusKind, &AxisConfig) -> &'static [AxisParameter],
    /// Whether a motor that is set as the axis says answers what stops it.
    pub can_confirm: fn(&AxisConfig) -> bool,
    /// The id of requests to a node, and all ids of a node.
    pub request_id: fn(u8, &AxisConfig) -> Option<CanId>,
    pub ids: fn(u8, &AxisConfig) -> Ids,
    /// The command that serves an exchange; `None` where the motor has none or needs none.
    pub command: fn(Exchange, &AxisConfig) -> Option<Command>,
    /// The command that carries out a setpoint of an axis; `None` where there is none.
    pub motion: fn(u8, Setpoint, &AxisConfig) -> Found<Command>,
    /// A position command with its target at a count of the motor's, or the counts that it takes.
    pub at: fn(Command, i32) -> Result<Command, (i32, i32)>,
    /// The command that bytes are, and what it does; `None` where they are none.
    pub native: fn(u8, &[u8], &AxisConfig) -> Found<Native>,
    /// Whether the motor answers a command.
    pub is_answered: fn(&Command, &AxisConfig) -> bool,
    /// A command to a node as a CAN frame, and a CAN frame as a reply.
    pub to_can: fn(&Command, u8, &AxisConfig) -> Option<CanFrame>,
    pub from_can: fn(&CanFrame) -> Option<Received>,
    /// Whether a CAN frame is a request that only reads.
    pub reads: fn(&CanFrame) -> bool,
}

impl Info {
    pub fn of(protocol: Protocol) -> &'static Self {
        match protocol {
            Protocol::Rmd => &rmd::INFO,
            Protocol::Thruster => &thruster::INFO,
            Protocol::D5 => &d5::INFO,
        }
    }

    /// That of the axis's protocol.
    pub fn of_axis(config: &AxisConfig) -> Option<&'static Self> {
        config.protocol().map(Self::of)
    }

    /// The steps of a stop action; `None` where its motors cannot carry it out.
    pub fn stop(&self, action: StopAction) -> Option<&'static [Exchange]> {
        self.stops.iter().find(|(known, _)| *known == action).map(|(_, steps)| *steps)
    }

    /// Whether it runs on such a bus.
    pub fn runs_on(&self, kind: BusKind) -> bool {
        kind == BusKind::Can || self.serial.is_some()
    }

    /// One unit in which motors report their speed: what is slower reads as 0.
    pub fn speed_unit_rad_s(&self) -> f32 {
        self.speed.to_si(1)
    }

    /// What so many counts of the motor's are in its sense of rotation, rad.
    pub fn position_rad(&self, count: i32) -> f32 {
        self.position.to_si(count)
    }
}

impl Received {
    pub fn protocol(&self) -> Protocol {
        match self {
            Self::Rmd { .. } => Protocol::Rmd,
            Self::Thruster { .. } => Protocol::Thruster,
            Self::D5 { .. } => Protocol::D5,
        }
    }

    pub fn node(&self) -> u8 {
        match self {
            Self::Rmd { node, .. } | Self::Thruster { node, .. } | Self::D5 { node, .. } => *node,
        }
    }

    /// What it is if it answers nothing.
    pub fn unasked(&self) -> Unasked {
        match self {
            Self::Rmd { reply, .. } => rmd::unasked(reply),
            Self::Thruster { reply, .. } => thruster::unasked(reply),
            Self::D5 { reply, .. } => d5::unasked(reply),
        }
    }

    /// What it tells by itself, whatever was asked.
    pub fn observation(&self, config: &AxisConfig) -> Observation {
        match self {
            Self::Rmd { reply, .. } => rmd::observe(reply, config),
            Self::Thruster { reply, .. } => thruster::observe(reply, config.sign()),
            Self::D5 { reply, .. } => d5::observe(reply, config.sign()),
        }
    }
}

impl Command {
    /// What the motor keeps of it.
    pub fn sets(&self) -> Sets {
        match self {
            Self::Rmd(request) => rmd::sets(request),
            Self::Thruster(request) => thruster::sets(request),
            Self::D5(request) => d5::sets(request),
            Self::D5Execute => Sets::Output(true),
            Self::RmdProbe(_) => Sets::Nothing,
        }
    }

    /// What shows that it was carried out, where its own reply may stay away.
    pub fn read_back(&self) -> Option<Exchange> {
        matches!(self.sets(), Sets::AckLevel(level) if d5::answers_reads(level))
            .then_some(Exchange::AckLevel)
    }
}

/// The protocols that run on a bus of this kind.
pub(crate) fn on(kind: BusKind) -> ProtocolSet {
    let here = Protocol::ALL.iter().filter(|protocol| Info::of(**protocol).runs_on(kind));
    here.fold(ProtocolSet::NONE, |set, protocol| set.with(*protocol))
}

/// The protocol whose motors alone have what a parameter sets; `None` where others have it too.
pub(crate) fn only_of(parameter: AxisParameter) -> Option<Protocol> {
    let has = |protocol: &Protocol| Info::of(*protocol).own_parameters.contains(&parameter);
    Protocol::ALL.iter().copied().find(has)
}

/// The command that serves an exchange on this axis; `None` where its motor has none or needs none.
pub(crate) fn command(exchange: Exchange, config: &AxisConfig) -> Option<Command> {
    (Info::of_axis(config)?.command)(exchange, config)
}

/// Whether there is one.
pub(crate) fn is_served(exchange: Exchange, config: &AxisConfig) -> bool {
    command(exchange, config).is_some()
}

/// The steps of the axis's stop action.
pub(crate) fn stop_steps(config: &AxisConfig) -> &'static [Exchange] {
    let info = Info::of_axis(config);
    info.zip(config.stop_action())
        .and_then(|(info, action)| info.stop(action))
        .unwrap_or(&[Exchange::Stop])
}

/// The command that carries out a setpoint, which has already passed the axis's own limits.
pub(crate) fn motion(axis: u8, setpoint: Setpoint, config: &AxisConfig) -> Result<Command, Error> {
    let Some(protocol) = config.protocol() else {
        return Err(Error::NotConfigured { axis, parameter: AxisParameter::Protocol.number() });
    };
    let command = (Info::of(protocol).motion)(axis, setpoint, config)?;
    command.ok_or(Error::Unsupported { axis, protocol })
}

/// A position command some way from where the motor is.
pub(crate) struct Further {
    pub command: Command,
    pub start_rad: f32,
    pub target_rad: f32,
}

/// `command`, a position of 0, moved to `distance_rad` from the motor's own count `start`. The sum
/// is one of counts: far from zero an f32 of radians is coarser than they are.
pub(crate) fn further(
    command: Command,
    start: i32,
    distance_rad: f32,
    config: &AxisConfig,
) -> Result<Further, Error> {
    let (sign, quantity) = (config.sign(), Quantity::Position);
    let Some(info) = Info::of_axis(config) else {
        return Err(Error::OutOfRange { quantity, value: distance_rad, min: 0.0, max: 0.0 });
    };
    let unit = info.position;
    let start_rad = sign * unit.to_si(start);
    let beyond = |(lowest, highest)| {
        let (one, other) = (sign * unit.to_si(lowest), sign * unit.to_si(highest));
        let value = start_rad + distance_rad;
        Error::OutOfRange { quantity, value, min: one.min(other), max: one.max(other) }
    };
    let target = unit.nearest(sign * distance_rad).and_then(|way| start.checked_add(way));
    let target = target.ok_or(beyond((i32::MIN, i32::MAX)))?;
    let command = (info.at)(command, target).map_err(beyond)?;
    Ok(Further { command, start_rad, target_rad: sign * unit.to_si(target) })
}

/// Whether the motor answers this command at all.
pub(crate) fn is_answered(command: &Command, config: &AxisConfig) -> bool {
    Info::of_axis(config).is_some_and(|info| (info.is_answered)(command, config))
}

/// Whether the motor of an axis answers its stop.
pub(crate) fn answers_stops(config: &AxisConfig) -> bool {
    command(Exchange::Stop, config).is_some_and(|stop| is_answered(&stop, config))
}

/// Whether a motor that is set as the axis says answers what stops it.
pub(crate) fn can_confirm(config: &AxisConfig) -> bool {
    Info::of_axis(config).is_none_or(|info| (info.can_confirm)(config))
}

/// Whether a frame is one that a motor returns for such a command, however it is set, and for
/// nothing else.
pub(crate) fn is_returned_for(command: &Command, received: &Received) -> bool {
    match received {
        Received::Thruster { reply, .. } => thruster::is_returned_for(command, reply),
        Received::Rmd { .. } | Received::D5 { .. } => false,
    }
}

/// Whether the motor tells its model in parts, of which its answer in such a version was the first.
pub(crate) fn is_part_of_model(versions: Versions) -> bool {
    rmd::is_part_of_model(versions)
}

/// Whether one reply may answer the one command as well as the other.
pub(crate) fn are_answered_alike(one: &Command, other: &Command, config: &AxisConfig) -> bool {
    one == other || thruster::are_answered_alike(one, other, config)
}

/// The frames that the motor sends by itself, and how often.
pub(crate) fn stream(config: &AxisConfig) -> Option<Stream> {
    Stream::of_word(config.unsigned(AxisParameter::Stream).unwrap_or(0))
}

/// How many frames answer a motion command.
pub(crate) fn replies_to_motion(config: &AxisConfig) -> u8 {
    ReturnMode::of(config).count()
}

/// Bits of `return_mode` that mean nothing.
pub(crate) const RETURN_MODE_RESERVED: u32 = ReturnMode::RESERVED;

/// Those of a board's bitrates that motors of a protocol can be set to.
pub(crate) fn can_be_set_to(bitrate: u32) -> bool {
    thruster::bitrates().any(|own| is_within_tolerance(own, bitrate))
}

/// Whether nodes of two bitrates understand each other: within 0.3 %, which leaves most of what CAN
/// allows to their clocks.
pub(crate) fn is_within_tolerance(one: u32, other: u32) -> bool {
    const PARTS: u64 = 1_000;
    const ALLOWED: u64 = 3;
    u64::from(one.abs_diff(other)) * PARTS <= u64::from(other) * ALLOWED
}

/// Refuses a time that the motor's own timeout cannot be set to.
pub(crate) fn check_timeout(timeout_ms: u32, config: &AxisConfig) -> Result<(), Error> {
    match Info::of_axis(config).filter(|_| timeout_ms != 0) {
        Some(info) => Quantity::MotorTimeout.check(timeout_ms, info.timeouts_ms),
        None => Ok(()),
    }
}

/// So long the motor hears nothing while arming or a stop waits for its brake.
pub(crate) fn waits_for_brake(config: &AxisConfig) -> Duration {
    let brakes = command(Exchange::ReleaseBrake, config).is_some()
        || stop_steps(config).contains(&Exchange::LockBrake);
    if brakes { BRAKE_TAKES } else { Duration::ZERO }
}

/// The bits of a motor's fault word that neither bar arming nor trip the axis: those that it only
/// reports, unless the axis treats them as faults. Without its sensor a temperature limit cannot be
/// kept.
pub(crate) fn warnings(faults: u16, config: &AxisConfig) -> u16 {
    let Some(info) = Info::of_axis(config) else { return 0 };
    let limits_temperature = config.float(AxisParameter::TemperatureLimitC).is_some();
    faults
        & match config.flag(AxisParameter::WarningsAreFaults) {
            true => 0,
            false if limits_temperature => info.reported_faults & !info.sensor_faults,
            false => info.reported_faults,
        }
}

/// How a received frame ends a command, and what its answer tells; `None` where it has nothing to do
/// with it.
pub(crate) fn judge(
    command: &Command,
    received: &Received,
    config: &AxisConfig,
    seen: &mut Observation,
) -> Option<Outcome> {
    match received {
        Received::Rmd { reply, .. } => rmd::judge(command, reply, config, seen),
        Received::Thruster { reply, .. } => thruster::judge(command, reply, config, seen),
        Received::D5 { node, reply } => d5::judge(command, *node, reply, config, seen),
    }
}

/// The command as a CAN frame to the axis's motor.
pub(crate) fn to_can(command: &Command, config: &AxisConfig) -> Option<CanFrame> {
    (Info::of_axis(config)?.to_can)(command, config.node()?, config)
}

/// The command as bytes on a serial bus to the axis's motor.
pub(crate) fn to_serial(command: &Command, config: &AxisConfig) -> Option<SerialFrame> {
    (Info::of_axis(config)?.serial.as_ref()?.encode)(command, config.node()?)
}

/// Decodes a frame of a CAN bus as one protocol's reply; `None` where it is none.
pub(crate) fn from_can(protocol: Protocol, frame: &CanFrame) -> Option<Received> {
    (Info::of(protocol).from_can)(frame)
}

#[cfg(test)]
#[path = "../../tests/unit/limits.rs"]
mod limit_tests;
#[cfg(test)]
#[path = "../../tests/unit/protocol.rs"]
mod tests;
