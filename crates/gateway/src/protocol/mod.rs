//! From the core's words to each protocol's commands and back. One file per protocol; only they and
//! [`convert`] know a manual's units.

mod convert;
mod counts;
mod d5;
mod exchange;
mod ids;
mod impedance;
#[cfg(test)]
mod limit_tests;
mod native;
mod raw;
mod returned;
mod rmd;
mod stream;
mod thruster;

use counts::{fit, position, turned};
pub(crate) use exchange::Exchange;
pub(crate) use ids::{has_extended_ids, has_extended_request_id, sent_on_an_id_of};
pub(crate) use native::{Demand, Effect, Native, native};
pub(crate) use raw::{is_harmless_on_can, is_harmless_on_serial};
pub(crate) use stream::Stream;

use crate::axis::{AxisConfig, Observation};
use crate::port::MAX_SERIAL;
use crate::time::Duration;
use embedded_can::Id;
use heapless::Vec;
use host_protocol::{
    AxisParameter, BusKind, CanFrame, CanId, Error, Protocol, Quantity, Setpoint, StopAction,
};

/// A command for a motor in the words of its protocol's codec.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Command {
    Rmd(::rmd::Request),
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

/// What a received frame is to a command that waits for its reply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Verdict {
    /// It answers the command.
    Answer(Observation),
    /// The motor refuses the command.
    Refused,
    /// The motor has received the command and does not carry it out.
    NotExecuted,
    /// It has nothing to do with the command.
    Unrelated,
}

/// What the core does with motors of one protocol, step by step. Steps that a motor has no command
/// for are passed over.
pub(crate) struct Sequences {
    /// Before motion is allowed.
    pub arming: &'static [Exchange],
    /// For a host that reads the state.
    pub state: &'static [Exchange],
    /// In turn while armed, beside the fault word.
    pub polls: &'static [Exchange],
    /// Before a trip is cleared.
    pub clearing: &'static [Exchange],
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

    /// Whether motors send such a frame on their own account, so that the host should see it.
    pub fn is_notice(&self) -> bool {
        // 0x9A comes every 100 ms while a fault lasts, where the motor is set so (PROTOCOL-NOTES
        // R16).
        let notice = |reply: &::rmd::Reply| {
            matches!(reply, ::rmd::Reply::TimeoutNotice { .. } | ::rmd::Reply::Status1 { .. })
        };
        matches!(self, Self::Rmd { reply, .. } if notice(reply))
    }

    /// What a thruster sends by itself, or beyond the reply that VM has: ML, MM, SR. Its kind,
    /// counted from 0, where it is such a frame if nobody has asked for it.
    pub fn telemetry(&self) -> Option<u8> {
        let Self::Thruster { reply, .. } = self else { return None };
        thruster::telemetry(reply)
    }

    /// Whether a motor says that a request was not for it.
    pub fn is_objection(&self) -> bool {
        matches!(
            self,
            Self::D5 { reply: ::d5::Reply::Error { error: ::d5::MotorError::Id, .. }, .. }
        )
    }

    /// What the frame tells by itself, whoever asked.
    pub fn observation(&self, config: &AxisConfig) -> Observation {
        match self {
            Self::Rmd { reply, .. } => rmd::observe(reply, config),
            Self::Thruster { reply, .. } => thruster::observe(reply, config.sign()),
            Self::D5 { reply, .. } => d5::observe(reply, config.sign()),
        }
    }
}

/// The sequences of a protocol.
pub(crate) fn sequences(protocol: Protocol) -> &'static Sequences {
    match protocol {
        Protocol::Rmd => &rmd::SEQUENCES,
        Protocol::Thruster => &thruster::SEQUENCES,
        Protocol::D5 => &d5::SEQUENCES,
    }
}

/// The command that serves an exchange on this axis; `None` where its motor has none or needs none.
pub(crate) fn command(exchange: Exchange, config: &AxisConfig) -> Option<Command> {
    match config.protocol()? {
        Protocol::Rmd => rmd::command(exchange, config).map(Command::Rmd),
        Protocol::Thruster => thruster::command(exchange, config).map(Command::Thruster),
        Protocol::D5 => d5::command(exchange).map(Command::D5),
    }
}

/// The command that carries out a setpoint, which has already passed the axis's own limits.
pub(crate) fn motion(axis: u8, setpoint: Setpoint, config: &AxisConfig) -> Result<Command, Error> {
    let Some(protocol) = config.protocol() else {
        return Err(Error::NotConfigured { axis, parameter: AxisParameter::Protocol.number() });
    };
    let command = match protocol {
        Protocol::Rmd => rmd::motion(axis, setpoint, config).map(|r| r.map(Command::Rmd)),
        Protocol::Thruster => {
            thruster::motion(axis, setpoint, config).map(|r| r.map(Command::Thruster))
        }
        Protocol::D5 => d5::motion(setpoint, config).map(|r| r.map(Command::D5)),
    }?;
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
    let sign = config.sign();
    let distance = sign * distance_rad;
    let (moved, to_rad): (_, fn(i32) -> f32) = match command {
        Command::Rmd(request) => {
            let moved =
                rmd::at(request, start, distance).map(|(r, target)| (Command::Rmd(r), target));
            (moved, convert::centidegrees_to_rad)
        }
        Command::Thruster(request) => {
            let moved =
                thruster::at(request, start, distance).map(|(r, t)| (Command::Thruster(r), t));
            (moved, convert::decidegrees_to_rad)
        }
        Command::D5(_) | Command::D5Execute => (None, convert::degrees_to_rad),
    };
    let start_rad = sign * to_rad(start);
    let Some((command, target)) = moved else {
        let limit = to_rad(i32::MAX);
        let value = start_rad + distance_rad;
        return Err(Error::OutOfRange {
            quantity: Quantity::Position,
            value,
            min: -limit,
            max: limit,
        });
    };
    Ok(Further { command, start_rad, target_rad: sign * to_rad(target) })
}

/// Whether motors of a protocol answer on CAN with the id that they were asked with. That a D5 does
/// is an assumption, on the safe side: its manual gives no ids.
pub(crate) fn replies_with_the_id_of_the_request(protocol: Protocol) -> bool {
    match protocol {
        Protocol::D5 => true,
        Protocol::Rmd | Protocol::Thruster => false,
    }
}

/// Whether motors of a protocol can carry out a stop action (GUARANTEES G4, the stop table).
pub(crate) const fn can_stop_by(protocol: Protocol, action: StopAction) -> bool {
    matches!(
        (protocol, action),
        (Protocol::Rmd, _)
            | (Protocol::Thruster, StopAction::Coast)
            | (Protocol::D5, StopAction::Hold)
    )
}

/// Whether a limit can act on an axis of this kind: its motor measures what is limited, or
/// setpoints carry it (GUARANTEES G2).
pub(crate) fn can_keep(limit: AxisParameter, bus: BusKind, config: &AxisConfig) -> bool {
    let Some(protocol) = config.protocol() else { return true };
    match limit {
        AxisParameter::CurrentLimitA => protocol != Protocol::D5,
        AxisParameter::PositionMinRad | AxisParameter::PositionMaxRad => {
            protocol != Protocol::Thruster || config.flag(AxisParameter::PositionDevice)
        }
        AxisParameter::SignalLimit => protocol == Protocol::Thruster,
        // Only motion mode tells it, which has no serial form (RMD V3.6 §5).
        AxisParameter::TorqueLimitNm => protocol == Protocol::Rmd && bus == BusKind::Can,
        _ => true,
    }
}

/// The protocol whose motors alone have what a parameter sets; `None` where others have it too.
/// What limits says [`can_keep`].
pub(crate) fn only_of(parameter: AxisParameter) -> Option<Protocol> {
    match parameter {
        AxisParameter::ReleaseBrakeWhenArming
        | AxisParameter::AllowUnverifiedBrake
        | AxisParameter::MotionPositionRad
        | AxisParameter::MotionVelocityRadS
        | AxisParameter::MotionTorqueNm
        | AxisParameter::MotionStiffness
        | AxisParameter::MotionDamping => Some(Protocol::Rmd),
        AxisParameter::PositionDevice
        | AxisParameter::WarningsAreFaults
        | AxisParameter::ReturnMode
        | AxisParameter::Stream => Some(Protocol::Thruster),
        AxisParameter::D5AckLevel | AxisParameter::D5RequestId | AxisParameter::D5ReplyId => {
            Some(Protocol::D5)
        }
        _ => None,
    }
}

/// One unit in which motors of a protocol report their speed: what is slower reads as 0.
pub(crate) fn speed_unit_rad_s(protocol: Protocol) -> f32 {
    match protocol {
        Protocol::Rmd | Protocol::D5 => convert::degrees_to_rad(1),
        Protocol::Thruster => convert::rpm_to_rad_s(1),
    }
}

/// Whether the motor answers this command at all.
pub(crate) fn is_answered(command: &Command, config: &AxisConfig) -> bool {
    match command {
        Command::Rmd(request) => request.is_answered(),
        Command::Thruster(_) => true,
        Command::D5(request) => d5::is_answered(request, config),
        // No reply to all is printed (D5 manual, quick start (4)).
        Command::D5Execute => false,
    }
}

/// Whether the motor of a D5 axis answers writes.
pub(crate) fn answers_writes(config: &AxisConfig) -> bool {
    let stop = d5::command(Exchange::Stop);
    stop.is_some_and(|stop| d5::is_answered(&stop, config))
}

/// Whether the motor follows such targets from one command to the next: RMD 0xA5.
pub(crate) fn tracks(command: &Command) -> bool {
    matches!(command, Command::Rmd(::rmd::Request::LimitedPositionTracking { .. }))
}

/// A speed that is to wait in the motor instead.
pub(crate) fn to_wait(command: Command) -> Command {
    match command {
        Command::D5(::d5::Request::Write { register, value }) => {
            Command::D5(::d5::Request::AsyncWrite { register, value })
        }
        other => other,
    }
}

/// A speed that was to wait, to act at once.
pub(crate) fn at_once(command: Command) -> Command {
    match command {
        Command::D5(::d5::Request::AsyncWrite { register, value }) => {
            Command::D5(::d5::Request::Write { register, value })
        }
        other => other,
    }
}

/// Whether a command sets which commands its motor answers, so that its own reply may stay away.
pub(crate) fn sets_ack_level(command: &Command) -> bool {
    matches!(command, Command::D5(request) if d5::new_ack_level(request).is_some())
}

/// What shows that a command which sets the acknowledge level was carried out; `None` for another
/// command, and for a level at which nothing is answered.
pub(crate) fn read_back(command: &Command) -> Option<Exchange> {
    let Command::D5(request) = command else { return None };
    match d5::new_ack_level(request)? {
        ::d5::AckLevel::Nothing { .. } => None,
        ::d5::AckLevel::ReadsAndWrites | ::d5::AckLevel::Reads => Some(Exchange::AckLevel),
    }
}

/// Whether a level that was read is the one that a command has set.
pub(crate) fn has_set_ack_level(command: &Command, level: u8) -> bool {
    matches!(command, Command::D5(request) if d5::new_ack_level(request) == Some(::d5::AckLevel::of(level)))
}

/// Whether a motor that is set as the axis says answers what stops it.
pub(crate) fn can_confirm(config: &AxisConfig) -> bool {
    match config.protocol() {
        Some(Protocol::Thruster) => {
            returned::ReturnMode::of(config) != returned::ReturnMode::Nothing
        }
        Some(Protocol::D5) => config.unsigned(AxisParameter::D5AckLevel) != Some(0),
        Some(Protocol::Rmd) | None => true,
    }
}

/// Whether one reply may answer the one command as well as the other.
pub(crate) fn are_answered_alike(one: &Command, other: &Command, config: &AxisConfig) -> bool {
    match (one, other) {
        (Command::Thruster(one), Command::Thruster(other)) => {
            one == other || returned::ReturnMode::of(config).answers_alike(one, other)
        }
        _ => one == other,
    }
}

/// The frames that the motor sends by itself, and how often.
pub(crate) fn stream(config: &AxisConfig) -> Option<Stream> {
    Stream::of_word(stream_word(config))
}

/// The same as `stream` of the axis says it; 0 where there are none.
pub(crate) fn stream_word(config: &AxisConfig) -> u32 {
    match config.protocol() {
        Some(Protocol::Thruster) => config.unsigned(AxisParameter::Stream).unwrap_or(0),
        Some(Protocol::Rmd | Protocol::D5) | None => 0,
    }
}

/// What `stream` of an axis says once its motor has carried out a command; `None` where that stays
/// as it was.
pub(crate) fn stream_after(command: &Command) -> Option<u32> {
    match command {
        Command::Thruster(request) => stream::word_after(request),
        _ => None,
    }
}

/// How many frames answer a motion command.
pub(crate) fn replies_to_motion(config: &AxisConfig) -> u8 {
    match config.protocol() {
        Some(Protocol::Thruster) => returned::ReturnMode::of(config).count(),
        Some(Protocol::Rmd | Protocol::D5) | None => 1,
    }
}

/// Whether the motor's output is on after this command; `None` where it stays as it was.
pub(crate) fn output_after(command: &Command) -> Option<bool> {
    match command {
        Command::Rmd(::rmd::Request::Stop) => Some(true),
        Command::Rmd(::rmd::Request::Shutdown) => Some(false),
        // At speed 0 the motor locks itself (D5 manual, first list).
        Command::D5(::d5::Request::Write { register: ::d5::Register::SPEED, .. })
        | Command::D5Execute => Some(true),
        _ => None,
    }
}

/// The node whose reply a command waits for, where that is not simply the axis's: after a change of
/// the id.
pub(crate) fn answering_node(command: &Command, config: &AxisConfig) -> Option<u8> {
    match command {
        Command::D5(request) => {
            let node = ::d5::Node::new(config.node()?).ok()?;
            Some(request.answering_node(node).get())
        }
        Command::Rmd(_) | Command::Thruster(_) | Command::D5Execute => None,
    }
}

/// The node that the motor has once a command has acted, at once or when it is switched on again.
pub(crate) fn node_after(command: &Command, config: &AxisConfig) -> Option<u8> {
    match command {
        Command::Thruster(::thruster::Request::SetId { id }) => u8::try_from(*id).ok(),
        command => answering_node(command, config),
    }
}

/// The bitrates of a protocol that others do not run at, bit/s: the lowest and the highest; `None`
/// where it shares a bus.
pub(crate) fn own_bitrates(protocol: Protocol) -> Option<(u32, u32)> {
    match protocol {
        Protocol::D5 => Some(::d5::can::BITRATES),
        Protocol::Rmd | Protocol::Thruster => None,
    }
}

/// The bitrate that the motor has once it is switched on again, bit/s, where a command changes it.
pub(crate) fn bitrate_after(command: &Command) -> Option<u32> {
    match command {
        Command::Thruster(::thruster::Request::SetBitrate { bitrate }) => {
            bitrate.info().map(|info| info.bits_per_second)
        }
        _ => None,
    }
}

/// Those of a board's bitrates that motors of a protocol can be set to.
pub(crate) fn can_be_set_to(protocol: Protocol, bitrate: u32) -> bool {
    match protocol {
        Protocol::Thruster => ::thruster::BITRATES
            .iter()
            .any(|info| is_within_tolerance(info.bits_per_second, bitrate)),
        Protocol::Rmd | Protocol::D5 => false,
    }
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
    let checked = match config.protocol() {
        Some(Protocol::Thruster) => thruster::check_timeout(timeout_ms),
        // The motor's time is its own; it can only be switched off and on (D15).
        Some(Protocol::D5) if timeout_ms > 1 => Err((0, 1)),
        // RMD takes any u32 of milliseconds.
        _ => Ok(()),
    };
    #[allow(clippy::cast_precision_loss)]
    checked.map_err(|(min, max)| Error::OutOfRange {
        quantity: Quantity::MotorTimeout,
        value: timeout_ms as f32,
        min: min as f32,
        max: max as f32,
    })
}

/// The bits of a motor's fault word that neither bar arming nor trip the axis.
pub(crate) fn warnings(faults: u16, config: &AxisConfig) -> u16 {
    match config.protocol() {
        Some(Protocol::Thruster) => thruster::warnings(faults, config),
        Some(Protocol::Rmd | Protocol::D5) | None => 0,
    }
}

/// Whether motors of a protocol keep their own timeout without power: RMD writes it to ROM (V3.6
/// §2.30); whether a thruster does, its manual does not say; a D5 motor is asked whenever it is
/// armed.
pub(crate) fn stores_its_timeout(protocol: Protocol) -> bool {
    match protocol {
        Protocol::Rmd => true,
        Protocol::Thruster | Protocol::D5 => false,
    }
}

/// Whether a command acts only after the motor has restarted.
pub(crate) fn acts_after_restart(command: &Command) -> bool {
    matches!(command, Command::Rmd(request) if request.acts_after_restart())
}

/// The reply window of a command where the motor needs longer than its bus's window.
pub(crate) fn slow_reply(command: &Command) -> Option<Duration> {
    match command {
        // Motors were seen to take 50 to 150 ms (PROTOCOL-NOTES R20).
        Command::Rmd(::rmd::Request::ReleaseBrake | ::rmd::Request::LockBrake) => {
            Some(Duration::from_millis(300))
        }
        _ => None,
    }
}

/// What a received frame is to a command.
pub(crate) fn judge(command: &Command, received: &Received, config: &AxisConfig) -> Verdict {
    match (command, received) {
        (Command::Rmd(request), Received::Rmd { reply, .. }) => rmd::judge(request, reply, config),
        (Command::Thruster(request), Received::Thruster { reply, .. }) => {
            thruster::judge(request, reply, config)
        }
        (Command::D5(request), Received::D5 { node, reply }) => {
            d5::judge(request, *node, reply, config)
        }
        _ => Verdict::Unrelated,
    }
}

/// The command as a CAN frame to the axis's motor.
pub(crate) fn to_can(command: &Command, config: &AxisConfig) -> Option<CanFrame> {
    let node = config.node()?;
    match command {
        Command::Rmd(request) => ::rmd::can::request(::rmd::Node::new(node).ok()?, request).ok(),
        Command::Thruster(request) => {
            ::thruster::can::request(::thruster::Node::new(node).ok()?, request).ok()
        }
        Command::D5(request) => d5::to_can(node, request, config),
        Command::D5Execute => d5::execute_all(config),
    }
}

/// The id on CAN of every frame that a stop sends to the axis's motor.
pub(crate) fn stop_id(config: &AxisConfig) -> Option<Id> {
    let node = config.node()?;
    match config.protocol()? {
        Protocol::Rmd => Some(::rmd::can::request_id(::rmd::Node::new(node).ok()?).into()),
        Protocol::Thruster => {
            Some(::thruster::can::request_id(::thruster::Node::new(node).ok()?).into())
        }
        Protocol::D5 => d5::request_id(config).map(|CanId(id)| id),
    }
}

/// The command as bytes on a serial bus to the axis's motor.
pub(crate) fn to_serial(command: &Command, config: &AxisConfig) -> Option<Vec<u8, MAX_SERIAL>> {
    let node = config.node()?;
    match command {
        Command::Rmd(request) => {
            let frame = ::rmd::rs485::request(::rmd::Node::new(node).ok()?, request).ok()?;
            Vec::from_slice(&frame).ok()
        }
        // The thruster protocol has no serial form; D5 over a serial line is refused when the axis
        // is configured.
        Command::Thruster(_) | Command::D5(_) | Command::D5Execute => None,
    }
}

/// Decodes a frame of a CAN bus as one protocol's reply; `None` where it is none.
pub(crate) fn from_can(protocol: Protocol, frame: &CanFrame) -> Option<Received> {
    match protocol {
        Protocol::Rmd => {
            let (node, reply) = ::rmd::can::decode_reply(frame).ok()?;
            Some(Received::Rmd { node: node.get(), reply })
        }
        Protocol::Thruster => {
            let (node, reply) = ::thruster::can::decode_reply(frame).ok()?;
            Some(Received::Thruster { node: node.get(), reply })
        }
        Protocol::D5 => {
            let (node, reply) = ::d5::can::decode_reply(frame).ok()?;
            Some(Received::D5 { node: node.get(), reply })
        }
    }
}

/// Whether a frame of the right node may be this axis's reply: some axes name the id that replies
/// carry.
pub(crate) fn accepts_id(config: &AxisConfig, frame: &CanFrame) -> bool {
    match config.protocol() {
        Some(Protocol::D5) => d5::accepts_id(config, frame),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::Value;

    /// An axis that is due for a poll looks for the exchange when it has its turn
    /// (`axis/wants.rs`): it relies on finding one.
    #[test]
    fn every_motor_has_a_command_for_a_poll_and_for_a_reading_of_its_state() {
        for protocol in Protocol::ALL.iter().copied() {
            for position_device in [false, true] {
                let mut config = AxisConfig::new();
                let unsigned = Value::Unsigned(protocol.number().into());
                config.set(AxisParameter::Protocol, unsigned).unwrap();
                config.set(AxisParameter::PositionDevice, Value::Bool(position_device)).unwrap();
                let is_served = |exchange: &Exchange| command(*exchange, &config).is_some();
                let Sequences { state, polls, .. } = sequences(protocol);
                assert!(polls.iter().any(is_served), "{protocol:?} {position_device}: armed");
                assert!(state.iter().any(is_served), "{protocol:?} {position_device}: watched");
                assert!(
                    is_served(&Exchange::Velocity),
                    "{protocol:?} {position_device}: holding, or in doubt"
                );
            }
        }
    }
}
