//! What the gateway sends.

use crate::error::{DecodeError, EncodeError};
use crate::field::{self, POSITION_LIMITS, command};
use crate::payload::Payload;
use crate::returned::{ReturnFlags, ReturnFrames};
use crate::units::{Decidegrees, Kilobits, LimitDecidegrees, Milliseconds, Percent, Rpm, RpmLimit};

mod build;
mod fields;
mod reads;
#[cfg(test)]
mod tests;

pub(crate) use fields::{visit_limits, visit_parameter, visit_return, visit_stream};

/// A request to one node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// TC: run at a share of the full signal (Thruster manual §2.1).
    Signal {
        /// −100..=100 %.
        signal: Percent,
    },
    /// VC: run at a speed (Thruster manual §2.1).
    Speed {
        /// 0, or at least 30 rpm in either direction; −4370 rpm cannot be sent, its bytes mean a refusal.
        speed: Rpm,
    },
    /// QV: read the speed (Thruster manual §2.1).
    ReadSpeed,
    /// QC: read the current (Thruster manual §2.1).
    ReadCurrent,
    /// QP: read the voltage (Thruster manual §2.1).
    ReadVoltage,
    /// QT: read the motor temperature (Thruster manual §2.1).
    ReadMotorTemperature,
    /// EQ: read the driver temperature (Thruster manual §2.1).
    ReadDriverTemperature,
    /// EF: read the present faults (Thruster manual §2.1, §3).
    ReadFaults,
    /// CF: clear the faults (Thruster manual §2.1). Only a following EF proves them cleared.
    ClearFaults,
    /// MQ: answer only when asked; ends what ML and MM began (Thruster manual §2.1).
    RequestMode,
    /// ML: return current and speed every second, as replies to QC and QV (Thruster manual §2.1).
    LowSpeedMode,
    /// MM: return current and speed every 100 ms, as replies to QC and QV (Thruster manual §2.1).
    MediumSpeedMode,
    /// CI: change the id, from the next power-on (Thruster manual §2.2).
    SetId {
        /// 1..=127.
        id: u16,
    },
    /// CB: change the bitrate, from the next power-on (Thruster manual §2.2).
    SetBitrate {
        /// One of [`BITRATES`](crate::BITRATES).
        bitrate: Kilobits,
    },
    /// ST: stop when no command has come for this long (Thruster manual §2.3).
    SetTimeout {
        /// 0 = off, or 100..=60000 ms.
        timeout: Milliseconds,
    },
    /// VM: choose what TC and VC return (Thruster manual §2.4).
    ConfigureReturn {
        /// Whether and how.
        flags: ReturnFlags,
        /// Which frames; without effect when there is no header.
        frames: ReturnFrames,
    },
    /// SR: choose the stream that starts with power-on (Thruster manual §2.5). Acts at once, and is kept.
    ConfigureStream {
        /// Which frames; none is taken to mean off.
        frames: ReturnFrames,
        /// Time between them.
        interval: Milliseconds,
    },
    /// FR: read all faults since the start (Thruster manual §2.6).
    ReadFaultRecord,
    /// SP: write a system parameter, raw (Thruster manual §2.7).
    SetParameter {
        /// Bytes 2–3, anything but [`POSITION_LIMITS`].
        parameter: u16,
        /// Bytes 4–7.
        data: [u8; 4],
    },
    /// RP: read a system parameter (Thruster manual §2.7).
    ReadParameter {
        /// Bytes 2–3, anything but [`POSITION_LIMITS`].
        parameter: u16,
    },
    /// LA: move to an absolute position (Thruster manual §4.1); devices with an encoder only.
    AbsolutePosition {
        /// Speed of the move in rpm; 0 does not start it.
        speed: RpmLimit,
        /// −1799..=1799, 0.1° each.
        position: Decidegrees,
    },
    /// QA: read the absolute position (Thruster manual §4.1); devices with an encoder only.
    ReadAbsolutePosition,
    /// AZ: make the present position the absolute zero (Thruster manual §4.1).
    SetAbsoluteZero,
    /// SPLA: set the limits of the absolute position (Thruster manual §4.1). LA beyond them is not executed.
    SetPositionLimits {
        /// At most 0, an assumption.
        reverse: LimitDecidegrees,
        /// At least 0, an assumption.
        forward: LimitDecidegrees,
    },
    /// RPLA: read the limits of the absolute position (Thruster manual §4.1).
    ReadPositionLimits,
    /// LR: move by a relative position (Thruster manual §4.2). Each frame with a speed adds to the target.
    RelativePosition {
        /// Speed of the move in rpm; 0 neither starts it nor adds to the target.
        speed: RpmLimit,
        /// 0.1° each, taken from LA; 61166 cannot be sent, its bytes mean a refusal.
        position: Decidegrees,
    },
    /// QR: read the relative position (Thruster manual §4.2).
    ReadRelativePosition,
    /// RZ: make the present position the relative zero (Thruster manual §4.2).
    SetRelativeZero,
    /// RC: set the relative position to zero (Thruster manual §4.2).
    ClearRelativePosition,
    /// LS: emergency stop (Thruster manual §4.3).
    EmergencyStop,
    /// A command that has no variant here.
    Unknown {
        /// The data field as it is.
        payload: Payload,
    },
}

impl Request {
    /// The command word, bytes 0–1.
    pub fn command(&self) -> u16 {
        match self {
            Request::Signal { .. } => command::TC,
            Request::Speed { .. } => command::VC,
            Request::ReadSpeed => command::QV,
            Request::ReadCurrent => command::QC,
            Request::ReadVoltage => command::QP,
            Request::ReadMotorTemperature => command::QT,
            Request::ReadDriverTemperature => command::EQ,
            Request::ReadFaults => command::EF,
            Request::ClearFaults => command::CF,
            Request::RequestMode => command::MQ,
            Request::LowSpeedMode => command::ML,
            Request::MediumSpeedMode => command::MM,
            Request::SetId { .. } => command::CI,
            Request::SetBitrate { .. } => command::CB,
            Request::SetTimeout { .. } => command::ST,
            Request::ConfigureReturn { .. } => command::VM,
            Request::ConfigureStream { .. } => command::SR,
            Request::ReadFaultRecord => command::FR,
            Request::SetParameter { .. } | Request::SetPositionLimits { .. } => command::SP,
            Request::ReadParameter { .. } | Request::ReadPositionLimits => command::RP,
            Request::AbsolutePosition { .. } => command::LA,
            Request::ReadAbsolutePosition => command::QA,
            Request::SetAbsoluteZero => command::AZ,
            Request::RelativePosition { .. } => command::LR,
            Request::ReadRelativePosition => command::QR,
            Request::SetRelativeZero => command::RZ,
            Request::ClearRelativePosition => command::RC,
            Request::EmergencyStop => command::LS,
            Request::Unknown { payload } => payload.command(),
        }
    }

    /// The data field; a value outside the manual's range is refused.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        Ok(match *self {
            Request::Signal { signal } => Payload::signed(command::TC, field::signal_word(signal)?),
            Request::Speed { speed } => Payload::signed(command::VC, field::speed_word(speed)?),
            Request::SetId { id } => Payload::unsigned(command::CI, field::id_word(id)?),
            Request::SetBitrate { bitrate } => Payload::unsigned(command::CB, bitrate.word()?),
            Request::SetTimeout { timeout } => Payload::unsigned(command::ST, field::timeout_word(timeout)?),
            Request::ConfigureReturn { flags, frames } => {
                no_reserved_bits("flags", flags.bits(), ReturnFlags::all().bits())?;
                no_reserved_bits("frames", frames.bits(), ReturnFrames::all().bits())?;
                Payload::returning(flags, frames)
            }
            Request::ConfigureStream { frames, interval } => {
                no_reserved_bits("frames", frames.bits(), ReturnFrames::all().bits())?;
                let payload = Payload::streaming(frames, interval);
                payload.expect_no_refusal("interval", i64::from(interval.0))?
            }
            Request::SetParameter { parameter, data } => {
                field::raw_parameter(parameter)?;
                let payload = Payload::full(command::SP, parameter, data);
                payload.expect_no_refusal("data", i64::from(u32::from_be_bytes(data)))?
            }
            Request::ReadParameter { parameter } => {
                Payload::short_with(command::RP, field::raw_parameter(parameter)?)
            }
            Request::AbsolutePosition { speed, position } => {
                Payload::position(command::LA, speed.0, field::absolute_position(position)?)
            }
            Request::SetPositionLimits { reverse, forward } => {
                Payload::full(command::SP, POSITION_LIMITS, field::position_limits(reverse, forward)?)
            }
            Request::ReadPositionLimits => Payload::short_with(command::RP, POSITION_LIMITS),
            Request::RelativePosition { speed, position } => {
                Payload::position(command::LR, speed.0, field::relative_position(position)?)
            }
            // §2.1 writes these with four bytes, §4 draws the queries of the positions with four.
            Request::ReadSpeed
            | Request::ReadCurrent
            | Request::ReadVoltage
            | Request::ReadMotorTemperature
            | Request::ReadDriverTemperature
            | Request::ReadFaults
            | Request::ClearFaults
            | Request::RequestMode
            | Request::LowSpeedMode
            | Request::MediumSpeedMode
            | Request::ReadFaultRecord
            | Request::ReadAbsolutePosition
            | Request::ReadRelativePosition => Payload::short_with(self.command(), 0),
            // §4 draws these with eight.
            Request::SetAbsoluteZero
            | Request::SetRelativeZero
            | Request::ClearRelativePosition
            | Request::EmergencyStop => Payload::full(self.command(), 0, [0; 4]),
            Request::Unknown { payload } => unknown(payload)?,
        })
    }

    /// The request in a data field of 4 or 8 bytes.
    ///
    /// What carries no data is accepted in both lengths (public drivers pad with zeros). Values are not judged: an
    /// out-of-range one is decoded, and refused only by [`Request::encode`].
    pub fn decode(bytes: &[u8]) -> Result<Request, DecodeError> {
        let payload = Payload::try_from(bytes)?;
        Ok(match payload.command() {
            command::TC => Request::Signal { signal: Percent(payload.signed_value()?) },
            command::VC => Request::Speed { speed: Rpm(payload.signed_value()?) },
            command::QV => bare(payload, Request::ReadSpeed)?,
            command::QC => bare(payload, Request::ReadCurrent)?,
            command::QP => bare(payload, Request::ReadVoltage)?,
            command::QT => bare(payload, Request::ReadMotorTemperature)?,
            command::EQ => bare(payload, Request::ReadDriverTemperature)?,
            command::EF => bare(payload, Request::ReadFaults)?,
            command::CF => bare(payload, Request::ClearFaults)?,
            command::MQ => bare(payload, Request::RequestMode)?,
            command::ML => bare(payload, Request::LowSpeedMode)?,
            command::MM => bare(payload, Request::MediumSpeedMode)?,
            command::CI => Request::SetId { id: payload.unsigned_value()? },
            command::CB => Request::SetBitrate { bitrate: Kilobits(payload.unsigned_value()?) },
            command::ST => Request::SetTimeout { timeout: Milliseconds(payload.unsigned_value()?) },
            command::VM => {
                let (flags, frames) = payload.return_value()?;
                Request::ConfigureReturn { flags, frames }
            }
            command::SR => {
                let (frames, interval) = payload.stream_value()?;
                Request::ConfigureStream { frames, interval }
            }
            command::FR => bare(payload, Request::ReadFaultRecord)?,
            command::SP => match (payload.parameter(), payload.data()?) {
                (POSITION_LIMITS, data) => {
                    let (reverse, forward) = field::limits_of(data);
                    Request::SetPositionLimits { reverse, forward }
                }
                (parameter, data) => Request::SetParameter { parameter, data },
            },
            command::RP => {
                payload.expect_no_data()?;
                match payload.parameter() {
                    POSITION_LIMITS => Request::ReadPositionLimits,
                    parameter => Request::ReadParameter { parameter },
                }
            }
            command::LA => Request::AbsolutePosition {
                speed: RpmLimit(payload.parameter()),
                position: Decidegrees(payload.position_value()?),
            },
            command::QA => bare(payload, Request::ReadAbsolutePosition)?,
            command::AZ => bare(payload, Request::SetAbsoluteZero)?,
            command::LR => Request::RelativePosition {
                speed: RpmLimit(payload.parameter()),
                position: Decidegrees(payload.position_value()?),
            },
            command::QR => bare(payload, Request::ReadRelativePosition)?,
            command::RZ => bare(payload, Request::SetRelativeZero)?,
            command::RC => bare(payload, Request::ClearRelativePosition)?,
            command::LS => bare(payload, Request::EmergencyStop)?,
            _ => Request::Unknown { payload },
        })
    }
}

fn bare(payload: Payload, request: Request) -> Result<Request, DecodeError> {
    payload.expect_bare()?;
    Ok(request)
}

/// Refuses to set what the manual reserves.
fn no_reserved_bits(field: &'static str, bits: u8, named: u8) -> Result<(), EncodeError> {
    if bits & !named == 0 {
        return Ok(());
    }
    Err(EncodeError::Forbidden { field, value: i64::from(bits), reason: "sets a reserved bit" })
}

/// Lets raw bytes pass unless they would go around the checks of a named command or look like a refusal.
fn unknown(payload: Payload) -> Result<Payload, EncodeError> {
    let value = i64::from(payload.command());
    if !matches!(Request::decode(payload.as_slice()), Ok(Request::Unknown { .. })) {
        let reason = "this command has a variant of its own";
        return Err(EncodeError::Forbidden { field: "command", value, reason });
    }
    payload.expect_no_refusal("command", value)
}
