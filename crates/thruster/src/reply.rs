//! What a device answers.

use codec::check_range;

use crate::error::{DecodeError, EncodeError};
use crate::faults::Faults;
use crate::field::{self, POSITION_LIMITS, REFUSAL, command};
use crate::payload::Payload;
use crate::returned::{Headerless, ReturnFlags, ReturnFrames, ReturnSource, Returned};
use crate::units::{
    Celsius, Deciamps, Decidegrees, Decivolts, Kilobits, LimitDecidegrees, Milliseconds, Percent, Rpm,
    RpmLimit,
};

mod fields;
#[cfg(test)]
mod tests;

/// A reply of one node. It repeats the command word of the request (Thruster manual §1.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// TC: the signal was taken.
    Signal {
        /// The signal set, %.
        signal: Percent,
    },
    /// VC: the speed was taken.
    Speed {
        /// The speed set, rpm.
        speed: Rpm,
    },
    /// QV: the speed measured (Thruster manual §2.1). ML and MM make a device send it unasked.
    MeasuredSpeed {
        /// rpm; −4370 is a value like any other here.
        speed: Rpm,
    },
    /// QC: the current (Thruster manual §2.1). ML and MM make a device send it unasked.
    Current {
        /// 0.1 A each.
        current: Deciamps,
    },
    /// QP: the voltage (Thruster manual §2.1).
    Voltage {
        /// 0.1 V each.
        voltage: Decivolts,
    },
    /// QT: the motor temperature (Thruster manual §2.1).
    MotorTemperature {
        /// °C.
        temperature: Celsius,
    },
    /// EQ: the driver temperature (Thruster manual §2.1).
    DriverTemperature {
        /// °C.
        temperature: Celsius,
    },
    /// EF: the present faults (Thruster manual §3). A timeout is shown once only (§2.3).
    Faults {
        /// The fault word.
        faults: Faults,
    },
    /// CF was taken.
    FaultsCleared,
    /// MQ was taken.
    RequestMode,
    /// ML was taken.
    LowSpeedMode,
    /// MM was taken.
    MediumSpeedMode,
    /// CI: the id was taken; the device has it from the next power-on (Thruster manual §2.2).
    Id {
        /// The id set.
        id: u16,
    },
    /// CB: the bitrate was taken; the device has it from the next power-on (Thruster manual §2.2).
    Bitrate {
        /// The bitrate set, kbit/s.
        bitrate: Kilobits,
    },
    /// ST: the timeout was taken.
    Timeout {
        /// The timeout set, ms; 0 = off.
        timeout: Milliseconds,
    },
    /// VM: what TC and VC return was taken (Thruster manual §2.4).
    ReturnConfigured {
        /// Whether and how.
        flags: ReturnFlags,
        /// Which frames.
        frames: ReturnFrames,
    },
    /// SR: the power-on stream was taken (Thruster manual §2.5).
    StreamConfigured {
        /// Which frames.
        frames: ReturnFrames,
        /// Time between them.
        interval: Milliseconds,
    },
    /// A frame that VM or SR asked for (Thruster manual §2.4, §2.5). After TC or VC it stands for the echo.
    Returned(Returned),
    /// FR: all faults since the start (Thruster manual §2.6).
    FaultRecord {
        /// The fault word.
        faults: Faults,
    },
    /// SP: the system parameter was taken (Thruster manual §2.7).
    ParameterSet {
        /// Bytes 2–3.
        parameter: u16,
        /// Bytes 4–7.
        data: [u8; 4],
    },
    /// RP: a system parameter (Thruster manual §2.7).
    Parameter {
        /// Bytes 2–3.
        parameter: u16,
        /// Bytes 4–7.
        data: [u8; 4],
    },
    /// LA: the position was taken.
    AbsolutePosition {
        /// The speed of the move, rpm.
        speed: RpmLimit,
        /// The target, 0.1° each.
        position: Decidegrees,
    },
    /// QA: the absolute position (Thruster manual §4.1).
    MeasuredPosition {
        /// 0.1° each.
        position: Decidegrees,
    },
    /// AZ was taken.
    AbsoluteZeroSet,
    /// SPLA: the limits of the absolute position were taken (Thruster manual §4.1).
    PositionLimitsSet {
        /// 0.1° each.
        reverse: LimitDecidegrees,
        /// 0.1° each.
        forward: LimitDecidegrees,
    },
    /// RPLA: the limits of the absolute position (Thruster manual §4.1).
    PositionLimits {
        /// 0.1° each.
        reverse: LimitDecidegrees,
        /// 0.1° each.
        forward: LimitDecidegrees,
    },
    /// LR: the move was taken.
    RelativePosition {
        /// The speed of the move, rpm.
        speed: RpmLimit,
        /// By how much, 0.1° each.
        position: Decidegrees,
    },
    /// QR: the relative position (Thruster manual §4.2).
    MeasuredRelativePosition {
        /// 0.1° each.
        position: Decidegrees,
    },
    /// RZ was taken.
    RelativeZeroSet,
    /// RC was taken.
    RelativePositionCleared,
    /// LS was taken.
    EmergencyStop,
    /// The device refuses a set command, for instance after a stall (Thruster manual §1.3); EF says why.
    Refused {
        /// The command word of the refused request.
        command: u16,
        /// Bytes 2–3 of the refused request: the speed of LA or LR, the sub-command of SP, else 0.
        parameter: u16,
    },
    /// A command that has no variant here.
    Unknown {
        /// The data field as it is.
        payload: Payload,
    },
}

impl Reply {
    /// The command word, bytes 0–1; of a returned frame its header.
    pub fn command(&self) -> u16 {
        match self {
            Reply::Signal { .. } => command::TC,
            Reply::Speed { .. } => command::VC,
            Reply::MeasuredSpeed { .. } => command::QV,
            Reply::Current { .. } => command::QC,
            Reply::Voltage { .. } => command::QP,
            Reply::MotorTemperature { .. } => command::QT,
            Reply::DriverTemperature { .. } => command::EQ,
            Reply::Faults { .. } => command::EF,
            Reply::FaultsCleared => command::CF,
            Reply::RequestMode => command::MQ,
            Reply::LowSpeedMode => command::ML,
            Reply::MediumSpeedMode => command::MM,
            Reply::Id { .. } => command::CI,
            Reply::Bitrate { .. } => command::CB,
            Reply::Timeout { .. } => command::ST,
            Reply::ReturnConfigured { .. } => command::VM,
            Reply::StreamConfigured { .. } => command::SR,
            Reply::Returned(returned) => returned.header(),
            Reply::FaultRecord { .. } => command::FR,
            Reply::ParameterSet { .. } | Reply::PositionLimitsSet { .. } => command::SP,
            Reply::Parameter { .. } | Reply::PositionLimits { .. } => command::RP,
            Reply::AbsolutePosition { .. } => command::LA,
            Reply::MeasuredPosition { .. } => command::QA,
            Reply::AbsoluteZeroSet => command::AZ,
            Reply::RelativePosition { .. } => command::LR,
            Reply::MeasuredRelativePosition { .. } => command::QR,
            Reply::RelativeZeroSet => command::RZ,
            Reply::RelativePositionCleared => command::RC,
            Reply::EmergencyStop => command::LS,
            Reply::Refused { command, .. } => *command,
            Reply::Unknown { payload } => payload.command(),
        }
    }

    /// Whether nobody has asked for it. A speed or current may be an event too (ML and MM, Thruster manual §2.1), as may
    /// what follows the first returned frame; only the pending request tells, as [`answer`](crate::answer) does.
    pub const fn is_event(&self) -> bool {
        matches!(self, Reply::Returned(Returned { source: ReturnSource::Stream, .. }))
    }

    /// What it tells if it is the form without a header (Thruster manual §2.4); nothing if it begins as any other reply does.
    ///
    /// Only for a device that is set so, while its reply to TC or VC is due: see [`Headerless`]. The command words and headers of
    /// the manual read as speeds beyond ±16 000 rpm, so that no speed of a device is lost.
    pub fn headerless(&self) -> Option<Headerless> {
        match self {
            Reply::Unknown { payload } => Headerless::decode(payload.as_slice()).ok(),
            _ => None,
        }
    }

    /// The data field; an echo outside the manual's range is refused. Reserved bits stay.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        Ok(match *self {
            Reply::Signal { signal } => Payload::signed(command::TC, field::signal_word(signal)?),
            Reply::Speed { speed } => Payload::signed(command::VC, field::speed_word(speed)?),
            Reply::MeasuredSpeed { speed } => Payload::signed(command::QV, speed.0),
            Reply::Current { current } => Payload::signed(command::QC, current.0),
            Reply::Voltage { voltage } => Payload::unsigned(command::QP, voltage.0),
            Reply::MotorTemperature { temperature } => Payload::signed(command::QT, temperature.0),
            Reply::DriverTemperature { temperature } => Payload::signed(command::EQ, temperature.0),
            Reply::Faults { faults } => Payload::unsigned(command::EF, faults.bits()),
            Reply::Id { id } => Payload::unsigned(command::CI, field::id_word(id)?),
            Reply::Bitrate { bitrate } => Payload::unsigned(command::CB, bitrate.word()?),
            Reply::Timeout { timeout } => Payload::unsigned(command::ST, field::timeout_word(timeout)?),
            Reply::ReturnConfigured { flags, frames } => {
                Payload::returning(flags, frames).expect_no_refusal("flags", i64::from(flags.bits()))?
            }
            Reply::StreamConfigured { frames, interval } => {
                Payload::streaming(frames, interval).expect_no_refusal("interval", i64::from(interval.0))?
            }
            Reply::Returned(returned) => returned.payload(),
            Reply::FaultRecord { faults } => Payload::unsigned(command::FR, faults.bits()),
            Reply::ParameterSet { parameter, data } => {
                let payload = Payload::full(command::SP, field::raw_parameter(parameter)?, data);
                payload.expect_no_refusal("data", i64::from(u32::from_be_bytes(data)))?
            }
            Reply::Parameter { parameter, data } => {
                Payload::full(command::RP, field::raw_parameter(parameter)?, data)
            }
            Reply::AbsolutePosition { speed, position } => {
                Payload::position(command::LA, speed.0, field::absolute_position(position)?)
            }
            Reply::MeasuredPosition { position } => Payload::position(command::QA, 0, position.0),
            Reply::PositionLimitsSet { reverse, forward } => {
                Payload::full(command::SP, POSITION_LIMITS, field::position_limits(reverse, forward)?)
            }
            Reply::PositionLimits { reverse, forward } => {
                Payload::full(command::RP, POSITION_LIMITS, field::limit_bytes(reverse, forward))
            }
            Reply::RelativePosition { speed, position } => {
                Payload::position(command::LR, speed.0, field::relative_position(position)?)
            }
            Reply::MeasuredRelativePosition { position } => Payload::position(command::QR, 0, position.0),
            // The manual does not draw these; eight bytes leave room for a refusal in the same place.
            Reply::FaultsCleared
            | Reply::RequestMode
            | Reply::LowSpeedMode
            | Reply::MediumSpeedMode
            | Reply::AbsoluteZeroSet
            | Reply::RelativeZeroSet
            | Reply::RelativePositionCleared
            | Reply::EmergencyStop => Payload::full(self.command(), 0, [0; 4]),
            Reply::Refused { command, parameter } => refused(command, parameter)?,
            Reply::Unknown { payload } => unknown(payload)?,
        })
    }

    /// The reply in a data field of 4 or 8 bytes.
    ///
    /// The bytes `00 00 EE EE` are a refusal in the reply to a set command only, never in a query's. What a device
    /// returns without a header is not found here; see [`Headerless`](crate::Headerless).
    pub fn decode(bytes: &[u8]) -> Result<Reply, DecodeError> {
        let payload = Payload::try_from(bytes)?;
        if payload.has_refusal_data() && command::SET.contains(&payload.command()) {
            return decode_refused(payload);
        }
        // No command word ends with a number from 1 to 3, so none is taken for a header.
        if let Some(returned) = Returned::of(payload) {
            return Ok(Reply::Returned(returned));
        }
        Ok(match payload.command() {
            command::TC => Reply::Signal { signal: Percent(payload.signed_value()?) },
            command::VC => Reply::Speed { speed: Rpm(payload.signed_value()?) },
            command::QV => Reply::MeasuredSpeed { speed: Rpm(payload.signed_value()?) },
            command::QC => Reply::Current { current: Deciamps(payload.signed_value()?) },
            command::QP => Reply::Voltage { voltage: Decivolts(payload.unsigned_value()?) },
            command::QT => Reply::MotorTemperature { temperature: Celsius(payload.signed_value()?) },
            command::EQ => Reply::DriverTemperature { temperature: Celsius(payload.signed_value()?) },
            command::EF => Reply::Faults { faults: Faults::from_bits_retain(payload.unsigned_value()?) },
            command::CF => bare(payload, Reply::FaultsCleared)?,
            command::MQ => bare(payload, Reply::RequestMode)?,
            command::ML => bare(payload, Reply::LowSpeedMode)?,
            command::MM => bare(payload, Reply::MediumSpeedMode)?,
            command::CI => Reply::Id { id: payload.unsigned_value()? },
            command::CB => Reply::Bitrate { bitrate: Kilobits(payload.unsigned_value()?) },
            command::ST => Reply::Timeout { timeout: Milliseconds(payload.unsigned_value()?) },
            command::VM => {
                let (flags, frames) = payload.return_value()?;
                Reply::ReturnConfigured { flags, frames }
            }
            command::SR => {
                let (frames, interval) = payload.stream_value()?;
                Reply::StreamConfigured { frames, interval }
            }
            command::FR => Reply::FaultRecord { faults: Faults::from_bits_retain(payload.unsigned_value()?) },
            command::SP | command::RP => decode_parameter(payload)?,
            command::LA => Reply::AbsolutePosition {
                speed: RpmLimit(payload.parameter()),
                position: Decidegrees(payload.position_value()?),
            },
            command::QA => {
                payload.expect_no_parameter()?;
                Reply::MeasuredPosition { position: Decidegrees(payload.position_value()?) }
            }
            command::AZ => bare(payload, Reply::AbsoluteZeroSet)?,
            command::LR => Reply::RelativePosition {
                speed: RpmLimit(payload.parameter()),
                position: Decidegrees(payload.position_value()?),
            },
            command::QR => {
                payload.expect_no_parameter()?;
                Reply::MeasuredRelativePosition { position: Decidegrees(payload.position_value()?) }
            }
            command::RZ => bare(payload, Reply::RelativeZeroSet)?,
            command::RC => bare(payload, Reply::RelativePositionCleared)?,
            command::LS => bare(payload, Reply::EmergencyStop)?,
            _ => Reply::Unknown { payload },
        })
    }
}

fn bare(payload: Payload, reply: Reply) -> Result<Reply, DecodeError> {
    payload.expect_bare()?;
    Ok(reply)
}

/// The reply to SP or RP.
fn decode_parameter(payload: Payload) -> Result<Reply, DecodeError> {
    let (parameter, data) = (payload.parameter(), payload.data()?);
    let (reverse, forward) = field::limits_of(data);
    Ok(match (payload.command(), parameter) {
        (command::SP, POSITION_LIMITS) => Reply::PositionLimitsSet { reverse, forward },
        (command::SP, _) => Reply::ParameterSet { parameter, data },
        (_, POSITION_LIMITS) => Reply::PositionLimits { reverse, forward },
        (_, _) => Reply::Parameter { parameter, data },
    })
}

fn decode_refused(payload: Payload) -> Result<Reply, DecodeError> {
    if !command::WITH_PARAMETER.contains(&payload.command()) {
        payload.expect_no_parameter()?;
    }
    Ok(Reply::Refused { command: payload.command(), parameter: payload.parameter() })
}

fn refused(command: u16, parameter: u16) -> Result<Payload, EncodeError> {
    if !command::SET.contains(&command) {
        let reason = "only a set command with a variant of its own can be refused";
        return Err(EncodeError::Forbidden { field: "command", value: i64::from(command), reason });
    }
    if !command::WITH_PARAMETER.contains(&command) {
        check_range("parameter", i64::from(parameter), 0, 0)?;
    }
    Ok(Payload::full(command, parameter, REFUSAL))
}

/// Lets raw bytes pass unless they would go around the checks of a named command.
fn unknown(payload: Payload) -> Result<Payload, EncodeError> {
    if matches!(Reply::decode(payload.as_slice()), Ok(Reply::Unknown { .. })) {
        return Ok(payload);
    }
    let reason = "this command has a variant of its own";
    Err(EncodeError::Forbidden { field: "command", value: i64::from(payload.command()), reason })
}
