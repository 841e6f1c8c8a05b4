//! The settings that a motor tells: how each is asked for, and how it is written.

use std::collections::BTreeMap;
use std::fmt;

use ::rmd::{Dialect, Function, Gain, GainValue, Node, PidGains, Ramp, Request};
use d5::{Register, RegisterInfo};
use host_protocol::{Error, Protocol};
use serde_json::{Value, json};
use thruster::LimitDecidegrees;

use super::{Motor, Run, lacks};
use crate::failure::Failure;

/// Decidegrees in a degree.
pub(super) const DECI: f32 = 10.0;

/// What settings have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    Pid,
    Acceleration,
    Zero,
    Limits,
    AckLevel,
    ReplyDelay,
    /// A part of nothing but a dump.
    Other,
}

/// A setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// With the unit as its last part, where there is one.
    pub name: &'static str,
    pub group: Group,
    pub(super) kind: Kind,
}

/// How a setting is asked for and written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// One of the six of 0x30, by its place.
    OldGain(usize),
    Gain(Gain),
    /// The only ramp that 0x42 tells up to V3.8. The manual does not say which of the four it is;
    /// taken for the first.
    OldRamp,
    Ramp(Ramp),
    /// A ramp that cannot be read.
    BlindRamp(Ramp),
    Offset,
    Reverse,
    Forward,
    Register(&'static RegisterInfo),
}

/// A value, in the unit of its name.
#[derive(Debug, Clone, Copy)]
pub enum Number {
    Integer(i64),
    Real(f32),
}

/// Values by the name of their setting.
pub type Values = BTreeMap<String, Number>;

impl PartialEq for Number {
    /// By its bits, so that no number is another than itself.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Integer(one), Self::Integer(other)) => one == other,
            _ => self.real().to_bits() == other.real().to_bits(),
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(number) => number.fmt(f),
            Self::Real(number) => write!(f, "{number:?}"),
        }
    }
}

impl Number {
    pub fn to_json(self) -> Value {
        match self {
            Self::Integer(number) => json!(number),
            Self::Real(number) => crate::output::number(number),
        }
    }

    pub(super) fn real(self) -> f32 {
        #[allow(clippy::cast_precision_loss, reason = "so many digits no setting has")]
        match self {
            Self::Integer(number) => number as f32,
            Self::Real(number) => number,
        }
    }
}

pub(super) const OLD_GAINS: [&str; 6] =
    ["current_kp", "current_ki", "speed_kp", "speed_ki", "position_kp", "position_ki"];
const RAMPS: [&str; 4] = [
    "position_acceleration_dps2",
    "position_deceleration_dps2",
    "velocity_acceleration_dps2",
    "velocity_deceleration_dps2",
];
const REGISTERS: [(Register, Group); 5] = [
    (Register::REPLY_DELAY, Group::ReplyDelay),
    (Register::ACK_LEVEL, Group::AckLevel),
    (Register::TIMEOUT_SWITCH, Group::Other),
    (Register::ACCELERATION, Group::Acceleration),
    (Register::DECELERATION, Group::Acceleration),
];

/// The settings that a motor has.
pub fn keys(motor: &Motor) -> Vec<Key> {
    let key = |name, group, kind| Key { name, group, kind };
    let mut keys = Vec::new();
    match motor.protocol {
        Protocol::Rmd => {
            let all = |request: &Request| {
                motor.dialects.iter().all(|dialect| request.dialects().contains(*dialect))
            };
            if all(&Request::ReadPid) {
                let gains = OLD_GAINS.into_iter().enumerate();
                keys.extend(gains.map(|(at, name)| key(name, Group::Pid, Kind::OldGain(at))));
            } else if all(&Request::WriteGainRam { gain: GainValue::new(Gain(1), 0.0) }) {
                let gains = Gain::ALL.into_iter();
                keys.extend(gains.map(|(gain, name)| key(name, Group::Pid, Kind::Gain(gain))));
            }
            // What an unknown motor may be asked it may not be told.
            let reads_ramps = all(&Request::ReadRamp { ramp: Ramp(1) });
            let reads_one = all(&Request::ReadAcceleration);
            for (index, name) in (0u8..).zip(RAMPS) {
                let kind = match (reads_ramps, reads_one, index) {
                    (true, _, _) => Kind::Ramp(Ramp(index)),
                    (_, true, 0) => Kind::OldRamp,
                    _ => Kind::BlindRamp(Ramp(index)),
                };
                keys.push(key(name, Group::Acceleration, kind));
            }
            keys.push(key("encoder_offset_pulses", Group::Zero, Kind::Offset));
        }
        Protocol::Thruster => {
            keys.push(key("reverse_limit_deg", Group::Limits, Kind::Reverse));
            keys.push(key("forward_limit_deg", Group::Limits, Kind::Forward));
        }
        Protocol::D5 => keys.extend(REGISTERS.into_iter().filter_map(|(register, group)| {
            let info = register.info()?;
            Some(key(info.field, group, Kind::Register(info)))
        })),
    }
    keys
}

/// Those of a group; an error where the motor has none.
pub fn keys_of(motor: &Motor, group: Group) -> Result<Vec<Key>, Failure> {
    let keys: Vec<Key> = keys(motor).into_iter().filter(|key| key.group == group).collect();
    if keys.is_empty() {
        let (what, instead) = match (group, motor.protocol) {
            (Group::Pid, Protocol::Rmd) => {
                let text = format!(
                    "it may speak {}, in which gains are written otherwise",
                    motor.dialect_names()
                );
                return Err(lacks(motor, &text, "State rmd_dialect on its axis"));
            }
            (Group::Pid, _) => ("its manual has no gains", ""),
            (Group::Acceleration, _) => ("its manual has no ramps", ""),
            (Group::Limits, Protocol::Rmd) => (
                "the unit of its position limits (0x20, 6 and 7) stands in no manual",
                "Limit the axis: position_min_rad, position_max_rad",
            ),
            (Group::Limits, _) => ("its manual has no limits", ""),
            (Group::Zero, Protocol::D5) => ("its manual has no zero point to set", ""),
            (Group::Zero, _) => {
                ("its zero point is not told in numbers", "`zero here` sets it where it stands")
            }
            (Group::AckLevel, _) => ("only a D5 has acknowledge levels", ""),
            (Group::ReplyDelay, _) => ("only a D5 has a reply delay", ""),
            (Group::Other, _) => ("it has no such setting", ""),
        };
        return Err(lacks(motor, what, instead));
    }
    Ok(keys)
}

impl Kind {
    /// What asks for it; nothing where the motor does not tell it.
    pub(super) fn read(self, motor: &Motor) -> Option<Result<Vec<u8>, Failure>> {
        Some(match self {
            Self::OldGain(_) => motor.rmd(&Request::ReadPid),
            Self::Gain(gain) => motor.rmd(&Request::ReadGain { gain }),
            Self::OldRamp => motor.rmd(&Request::ReadAcceleration),
            Self::Ramp(ramp) => motor.rmd(&Request::ReadRamp { ramp }),
            Self::BlindRamp(_) => return None,
            Self::Offset => motor.rmd(&Request::ReadEncoderOffset),
            Self::Reverse | Self::Forward => motor.thruster(&thruster::Request::ReadPositionLimits),
            Self::Register(info) => {
                let (register, width) = (info.register, info.width);
                motor.d5(&d5::Request::Read { register, width })
            }
        })
    }

    /// Its value in a reply.
    fn of(self, motor: &Motor, reply: &[u8]) -> Option<Number> {
        let rmd = || ::rmd::Reply::decode_in(motor.dialect(), reply).ok();
        let limits = || match thruster::Reply::decode(reply).ok()? {
            thruster::Reply::PositionLimits { reverse, forward } => Some((reverse, forward)),
            _ => None,
        };
        let degrees = |limit: LimitDecidegrees| Number::Real(f32::from(limit.0) / DECI);
        match self {
            Self::OldGain(at) => match rmd()? {
                ::rmd::Reply::Pid { gains } => {
                    bytes(&gains).get(at).map(|gain| Number::Integer((*gain).into()))
                }
                _ => None,
            },
            Self::Gain(wanted) => match rmd()? {
                ::rmd::Reply::Gain { gain } if gain.gain == wanted => {
                    Some(Number::Real(gain.value()))
                }
                _ => None,
            },
            Self::OldRamp | Self::Ramp(_) | Self::BlindRamp(_) => match (self, rmd()?) {
                (Self::OldRamp, ::rmd::Reply::Acceleration { acceleration }) => {
                    Some(Number::Integer(acceleration.0.into()))
                }
                (Self::Ramp(wanted), ::rmd::Reply::Ramp { ramp, acceleration })
                    if ramp == wanted =>
                {
                    Some(Number::Integer(acceleration.0.into()))
                }
                _ => None,
            },
            Self::Offset => match rmd()? {
                ::rmd::Reply::EncoderOffset { offset } => Some(Number::Integer(offset.0.into())),
                _ => None,
            },
            Self::Reverse => limits().map(|(reverse, _)| degrees(reverse)),
            Self::Forward => limits().map(|(_, forward)| degrees(forward)),
            Self::Register(info) => match d5::decode_reply_frame(reply.try_into().ok()?).ok()?.1 {
                d5::Reply::Read { register, value } if register == info.register => {
                    info.decode(value).map(Number::Integer)
                }
                _ => None,
            },
        }
    }
}

fn bytes(gains: &PidGains) -> [u8; 6] {
    let PidGains { current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki } = *gains;
    [current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki]
}

/// What a motor has of these; what it does not tell, or refuses to, is missing.
pub fn read(run: &mut Run<'_>, keys: &[Key]) -> Result<Values, Failure> {
    let mut values = Values::new();
    // Several stand in one reply.
    let mut asked: Vec<(Vec<u8>, Option<Vec<u8>>)> = Vec::new();
    for key in keys {
        let Some(data) = key.kind.read(&run.motor) else { continue };
        let data = data?;
        let known = asked.iter().position(|(request, _)| *request == data);
        let at = match known {
            Some(at) => at,
            None => {
                let reply = told(run, &data)?;
                asked.push((data, reply));
                asked.len() - 1
            }
        };
        let reply = asked.get(at).and_then(|(_, reply)| reply.as_deref());
        if let Some(value) = reply.and_then(|reply| key.kind.of(&run.motor, reply)) {
            values.insert(key.name.to_owned(), value);
        }
    }
    Ok(values)
}

/// A reply; of a thruster without an encoder none to what needs one.
fn told(run: &mut Run<'_>, data: &[u8]) -> Result<Option<Vec<u8>>, Failure> {
    match run.ask(data) {
        Ok(reply) => Ok(Some(reply.to_vec())),
        Err(failure)
            if run.motor.protocol == Protocol::Thruster
                && matches!(
                    failure.gateway_error(),
                    Some(Error::NoReply { .. } | Error::Refused { .. })
                ) =>
        {
            Ok(None)
        }
        Err(failure) => Err(failure),
    }
}

/// The function of that name (RMD V3.6 §2.33.4).
pub fn function(name: crate::args::FunctionName, enabled: bool) -> Function {
    use crate::args::FunctionName as Name;
    match name {
        Name::CanIdFilter => Function::CanIdFilter { enabled },
        Name::ErrorReporting => Function::ErrorReporting { enabled },
        Name::MultiTurnSaving => Function::MultiTurnSaving { enabled },
        Name::FaultRecovery => Function::FaultRecovery { enabled },
    }
}

/// Whether the dialect gives a motor its id by 0x20 index 5; nothing where that differs among those
/// that it may speak.
pub fn has_next_id(dialects: &[Dialect]) -> Option<bool> {
    let next =
        Request::Function { function: Function::NextCanId { id: Node::new(Node::MIN).ok()? } };
    let old = Request::SetCanId { id: Node::MIN };
    if dialects.iter().all(|dialect| next.dialects().contains(*dialect)) {
        return Some(true);
    }
    let is_old = |dialect: &Dialect| {
        old.dialects().contains(*dialect) && !next.dialects().contains(*dialect)
    };
    dialects.iter().all(is_old).then_some(false)
}
