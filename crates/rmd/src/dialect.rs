//! What the versions of the protocol differ in: which commands a motor has, and in which form.
//!
//! Common to all are the stops, the reads of state, current, velocity and position with a speed
//! limit. docs/rmd-dialects.md has the facts with their sources.

use core::convert::Infallible;

use codec::Decode;

use crate::command;
use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::function::Function;
use crate::gain::Gain;
use crate::payload::Payload;
use crate::ramp::Ramp;
use crate::reply::Reply;
use crate::request::Request;
use crate::table::{MODEL_PART_MAX, MODEL_PART_MIN};

/// A version of the protocol, as far as versions differ. The version of a manual is not that of a
/// motor's firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Dialect {
    /// Only what all versions have in common.
    Unknown,
    /// V3.6, the manual that this codec implements.
    #[default]
    V3_6,
    /// V3.7 and V3.8.
    V3_7,
    /// V3.9 to V4.1.
    V3_9,
    /// V4.2.
    V4_2,
    /// V4.3.
    V4_3,
    /// V4.4.
    V4_4,
}

impl Dialect {
    /// Every dialect; its place is its number.
    pub const ALL: [Dialect; 7] = [
        Dialect::Unknown,
        Dialect::V3_6,
        Dialect::V3_7,
        Dialect::V3_9,
        Dialect::V4_2,
        Dialect::V4_3,
        Dialect::V4_4,
    ];

    /// Name in snake_case.
    pub const fn name(self) -> &'static str {
        match self {
            Dialect::Unknown => "unknown",
            Dialect::V3_6 => "v3_6",
            Dialect::V3_7 => "v3_7",
            Dialect::V3_9 => "v3_9",
            Dialect::V4_2 => "v4_2",
            Dialect::V4_3 => "v4_3",
            Dialect::V4_4 => "v4_4",
        }
    }

    /// The dialect with this number.
    pub fn from_number(number: u32) -> Option<Dialect> {
        Dialect::ALL.get(usize::try_from(number).ok()?).copied()
    }

    /// Whether 0xA2 takes a torque cap, and 0xA9 is there.
    pub const fn has_torque_cap(self) -> bool {
        Dialects::FROM_V4_3.contains(self)
    }
}

/// A set of dialects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dialects(u8);

impl Dialects {
    /// None of them.
    pub const NONE: Dialects = Dialects(0);
    const ALL: Dialects = Dialects::between(Dialect::Unknown, Dialect::V4_4);
    const V3_6: Dialects = Dialects::between(Dialect::V3_6, Dialect::V3_6);
    pub(crate) const TO_V3_7: Dialects = Dialects::between(Dialect::V3_6, Dialect::V3_7);
    pub(crate) const TO_V3_9: Dialects = Dialects::between(Dialect::V3_6, Dialect::V3_9);
    pub(crate) const TO_V4_3: Dialects = Dialects::between(Dialect::V3_6, Dialect::V4_3);
    const V3_7_TO_V4_3: Dialects = Dialects::between(Dialect::V3_7, Dialect::V4_3);
    const FROM_V3_7: Dialects = Dialects::between(Dialect::V3_7, Dialect::V4_4);
    pub(crate) const FROM_V3_9: Dialects = Dialects::between(Dialect::V3_9, Dialect::V4_4);
    pub(crate) const FROM_V4_2: Dialects = Dialects::between(Dialect::V4_2, Dialect::V4_4);
    const FROM_V4_3: Dialects = Dialects::between(Dialect::V4_3, Dialect::V4_4);
    pub(crate) const V4_4: Dialects = Dialects::between(Dialect::V4_4, Dialect::V4_4);
    /// Every one but unknown.
    pub const KNOWN: Dialects = Dialects::between(Dialect::V3_6, Dialect::V4_4);

    const fn between(first: Dialect, last: Dialect) -> Dialects {
        Dialects((2 << last as u8) - (1 << first as u8))
    }

    const fn or_unknown(self) -> Dialects {
        Dialects(self.0 | 1 << Dialect::Unknown as u8)
    }

    /// One bit for each, by its number.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Those whose bits are set; others are passed over.
    pub const fn from_bits(bits: u8) -> Dialects {
        Dialects(bits & Dialects::ALL.0)
    }

    /// Whether a dialect is among them.
    pub const fn contains(self, dialect: Dialect) -> bool {
        self.0 & 1 << dialect as u8 != 0
    }

    /// Those in both.
    #[must_use]
    pub const fn both(self, other: Dialects) -> Dialects {
        Dialects(self.0 & other.0)
    }

    /// Those in it.
    pub fn iter(self) -> impl Iterator<Item = Dialect> {
        Dialect::ALL.into_iter().filter(move |dialect| self.contains(*dialect))
    }
}

/// What a request in a dialect that lacks it is refused with.
const LACKED: &str = "the motor's dialect has no such command, or not in this form";

impl Request {
    /// The dialects that have this request in this form. With an unknown one only what means the
    /// same in all of them, and reads whose reply tells its form.
    pub const fn dialects(&self) -> Dialects {
        match self {
            Request::ReadPid | Request::WritePidRam { .. } | Request::WritePidRom { .. } => {
                Dialects::TO_V3_9
            }
            Request::ReadGain { .. } => Dialects::FROM_V4_2.or_unknown(),
            Request::WriteGainRam { .. } | Request::WriteGainRom { .. } => Dialects::FROM_V4_2,
            // Newer motors take it for index 0.
            Request::ReadAcceleration => Dialects::TO_V3_7,
            Request::ReadRamp { .. } => Dialects::FROM_V3_9.or_unknown(),
            Request::PositionTracking { .. } | Request::LimitedPositionTracking { .. } => {
                Dialects::V3_6
            }
            Request::ReadPower => Dialects::TO_V3_9,
            Request::ReadModel => Dialects::TO_V4_3.or_unknown(),
            Request::ReadModelPart { .. } => Dialects::V4_4.or_unknown(),
            Request::ReadSingleTurnEncoder => Dialects::V3_7_TO_V4_3,
            Request::ReadSingleTurnAngle | Request::SingleTurnPosition { .. } => {
                Dialects::FROM_V3_7
            }
            Request::CappedVelocity { .. } | Request::CappedPosition { .. } => Dialects::FROM_V4_3,
            Request::SpeedFedPosition { .. } | Request::TorqueFedPosition { .. } => Dialects::V4_4,
            Request::SetActiveReply { .. } => Dialects::FROM_V3_9,
            Request::ReadCanId
            | Request::SetCanId { .. }
            | Request::ReadRs485Id
            | Request::SetRs485Id { .. } => Dialects::TO_V4_3,
            Request::SetBaudRate { .. } | Request::MotionMode { .. } => Dialects::KNOWN,
            Request::Function { function } => match function {
                // The manual of V3.9 has it not, those of V4.0 and V4.1 have.
                Function::NextCanId { .. } => Dialects::FROM_V4_2,
                Function::FaultRecovery { .. } => Dialects::V4_4,
                // Never encoded; [`Function`] says why.
                _ => Dialects::ALL,
            },
            Request::Unknown { .. } => Dialects::NONE,
            _ => Dialects::ALL,
        }
    }

    /// Refuses a request that a motor of this dialect lacks or would take for something else.
    pub fn check_in(&self, dialect: Dialect) -> Result<(), EncodeError> {
        let command = || ("command", i64::from(self.command()), LACKED);
        let refused = match self {
            _ if !self.dialects().contains(dialect) => Some(command()),
            // From V3.7 on no speed limit, where the position acceleration is 0.
            Request::AbsolutePosition { max_speed, .. }
            | Request::IncrementalPosition { max_speed, .. }
                if max_speed.0 == 0 && dialect != Dialect::V3_6 =>
            {
                Some(("max_speed_dps", 0, "this dialect may take 0 for no speed limit"))
            }
            _ => None,
        };
        match refused {
            None => Ok(()),
            Some((field, value, reason)) => Err(EncodeError::Forbidden { field, value, reason }),
        }
    }

    /// Whether a motor of this dialect stores it only while its output is off (0x80), and echoes it
    /// all the same: the echo proves nothing (V4.4).
    pub const fn is_stored_only_off(&self, dialect: Dialect) -> bool {
        Dialects::V4_4.contains(dialect)
            && matches!(
                self,
                Request::WriteGainRom { .. }
                    | Request::WriteAcceleration { .. }
                    | Request::WriteEncoderOffset { .. }
                    | Request::WritePositionAsZero
                    | Request::SetBaudRate { .. }
                    | Request::Function { .. }
            )
    }

    /// The eight data bytes for a motor of this dialect.
    ///
    /// Refused are what [`check_in`](Request::check_in) and [`encode`](Request::encode) refuse.
    pub fn encode_in(&self, dialect: Dialect) -> Result<[u8; DATA_LEN], EncodeError> {
        self.check_in(dialect)?;
        self.encode()
    }

    /// What eight data bytes to a single motor of this dialect are: `Unknown` where it lacks the
    /// command, or would not see an argument that other dialects have in this command.
    ///
    /// ```
    /// use rmd::{Dialect, Request, TorqueCap};
    ///
    /// let capped = [0xA2, 50, 0, 0, 0x10, 0x27, 0, 0];
    /// let read = |dialect| Request::decode_in(dialect, &capped);
    /// assert!(matches!(read(Dialect::V4_3), Request::CappedVelocity { cap: TorqueCap(50), .. }));
    /// assert!(matches!(read(Dialect::V4_2), Request::Unknown { .. }));
    /// ```
    pub fn decode_in(dialect: Dialect, data: &[u8; DATA_LEN]) -> Request {
        let Ok(newer) = newer_request(data);
        let request = match newer {
            Some(newer) if newer.dialects().contains(dialect) => newer,
            // Index 0 is what older ones send.
            Some(_) if data.get(1).is_some_and(|index| *index != 0) => {
                return Request::Unknown { data: *data };
            }
            _ => Request::decode_row_of(data),
        };
        if request.dialects().contains(dialect) {
            request
        } else {
            Request::Unknown { data: *data }
        }
    }

    /// The dialects in which eight data bytes are a request.
    pub fn dialects_of(data: &[u8; DATA_LEN]) -> Dialects {
        Dialect::ALL.into_iter().fold(Dialects::NONE, |Dialects(all), dialect| {
            match Request::decode_in(dialect, data) {
                Request::Unknown { .. } => Dialects(all),
                _ => Dialects(all | 1 << dialect as u8),
            }
        })
    }
}

/// The request in the form of newer dialects, where the code has another one too.
fn newer_request(data: &[u8; DATA_LEN]) -> Result<Option<Request>, Infallible> {
    let [code, index, part, ..] = *data;
    Ok(Some(match code {
        command::READ_PID if is_gain(data) => Request::ReadGain { gain: Gain(index) },
        command::WRITE_PID_RAM if is_gain(data) => {
            Request::WriteGainRam { gain: Decode::<Payload>::get::<1>(data)? }
        }
        command::WRITE_PID_ROM if is_gain(data) => {
            Request::WriteGainRom { gain: Decode::<Payload>::get::<1>(data)? }
        }
        command::READ_ACCELERATION if Ramp(index).name().is_some() => {
            Request::ReadRamp { ramp: Ramp(index) }
        }
        command::READ_MODEL if is_model_part(data) => Request::ReadModelPart { part },
        command::VELOCITY if index != 0 => Request::CappedVelocity {
            cap: Decode::<Payload>::get::<1>(data)?,
            speed: Decode::<Payload>::get::<4>(data)?,
        },
        _ => return Ok(None),
    }))
}

/// An index of a gain, and zeros where older dialects have gains.
fn is_gain(data: &[u8; DATA_LEN]) -> bool {
    let [_, index, unused @ .., _, _, _, _] = *data;
    Gain(index).name().is_some() && unused == [0; 2]
}

fn is_model_part(data: &[u8; DATA_LEN]) -> bool {
    matches!(data, [_, 1, MODEL_PART_MIN..=MODEL_PART_MAX, ..])
}

impl Reply {
    /// The dialects whose motors send this reply. Of an unknown one, every reply that tells its
    /// form.
    const fn dialects(&self) -> Dialects {
        match self {
            Reply::Pid { .. } | Reply::PidRamWritten { .. } | Reply::PidRomWritten { .. } => {
                Dialects::TO_V3_9.or_unknown()
            }
            Reply::Gain { .. } | Reply::GainRamWritten { .. } | Reply::GainRomWritten { .. } => {
                Dialects::FROM_V4_2.or_unknown()
            }
            Reply::Ramp { .. } => Dialects::FROM_V3_9.or_unknown(),
            Reply::PositionTracking { .. } | Reply::LimitedPositionTracking { .. } => {
                Dialects::V3_6.or_unknown()
            }
            Reply::Power { .. } => Dialects::TO_V3_9.or_unknown(),
            Reply::Model { .. } => Dialects::TO_V4_3.or_unknown(),
            Reply::ModelPart { .. } => Dialects::V4_4.or_unknown(),
            Reply::SingleTurnEncoder { .. } => Dialects::V3_7_TO_V4_3.or_unknown(),
            // Its two layouts cannot be told apart.
            Reply::SingleTurnAngle { .. } => Dialects::V3_7_TO_V4_3,
            Reply::SignedSingleTurnAngle { .. } => Dialects::V4_4,
            Reply::SingleTurnPosition { .. } => Dialects::FROM_V3_7.or_unknown(),
            Reply::CappedPosition { .. } => Dialects::FROM_V4_3.or_unknown(),
            Reply::SpeedFedPosition { .. } | Reply::TorqueFedPosition { .. } => {
                Dialects::V4_4.or_unknown()
            }
            _ => Dialects::ALL,
        }
    }

    /// The reply that eight data bytes of a motor of this dialect hold. Where the dialect is
    /// unknown, the form of the bytes tells.
    pub(crate) fn decode_full_in(dialect: Dialect, data: &[u8; DATA_LEN]) -> Reply {
        let Ok(newer) = newer_reply(dialect, data);
        let reply = match newer {
            Some(newer) if newer.dialects().contains(dialect) => newer,
            _ => Reply::decode_row_of(data),
        };
        if reply.dialects().contains(dialect) { reply } else { Reply::Unknown { data: *data } }
    }
}

/// The reply in the form of newer dialects, where the code has another one too.
fn newer_reply(dialect: Dialect, data: &[u8; DATA_LEN]) -> Result<Option<Reply>, Infallible> {
    let [code, index, part, ..] = *data;
    let gain = || Decode::<Payload>::get::<1>(data);
    Ok(Some(match code {
        command::READ_PID if is_gain(data) => Reply::Gain { gain: gain()? },
        command::WRITE_PID_RAM if is_gain(data) => Reply::GainRamWritten { gain: gain()? },
        command::WRITE_PID_ROM if is_gain(data) => Reply::GainRomWritten { gain: gain()? },
        // Index 0 is also what older motors answer.
        command::READ_ACCELERATION if index != 0 || dialect >= Dialect::V3_9 => {
            Reply::Ramp { ramp: Ramp(index), acceleration: Decode::<Payload>::get::<4>(data)? }
        }
        command::READ_MODEL if is_model_part(data) => {
            Reply::ModelPart { part, text: Decode::<Payload>::get::<3>(data)? }
        }
        command::READ_SINGLE_TURN_ANGLE if dialect == Dialect::V4_4 => {
            Reply::SignedSingleTurnAngle { angle: Decode::<Payload>::get::<4>(data)? }
        }
        _ => return Ok(None),
    }))
}
