//! The data bytes of replies, both ways.

use super::{Motion, Reply};
use crate::bus_id;
use crate::command;
use crate::error::{DecodeError, EncodeError};
use crate::faults::Faults;
use crate::field::{DATA_LEN, reply as field, request};
use crate::function::Function;
use crate::model::Model;
use crate::notice::RawNotice;
use crate::pid::PidGains;
use crate::ramp::Ramp;
use crate::request::check_acceleration;
use crate::run_mode::RunMode;
use crate::units::{
    Celsius, Centiamps, Centidegrees, Decivolts, Deciwatts, DegreesPerSecondSquared, EncoderPulses,
    Milliseconds, VersionDate,
};

impl Reply {
    /// The eight data bytes; a short timeout notice is filled up with zeros.
    ///
    /// Refused are values outside the manual's ranges, a [`Function::Other`], and a [`Reply::Unknown`] whose command
    /// has a variant of its own.
    pub fn encode(&self) -> Result<[u8; DATA_LEN], EncodeError> {
        match self {
            Reply::Status2 { motion }
            | Reply::TorqueCurrent { motion }
            | Reply::Velocity { motion }
            | Reply::PositionTracking { motion }
            | Reply::AbsolutePosition { motion }
            | Reply::LimitedPositionTracking { motion }
            | Reply::IncrementalPosition { motion } => motion.check()?,
            Reply::Acceleration { acceleration } => check_acceleration(*acceleration)?,
            Reply::AccelerationWritten { ramp, acceleration } => {
                ramp.check()?;
                check_acceleration(*acceleration)?;
            }
            Reply::RunMode { mode } => mode.check()?,
            Reply::Function { function } => function.check()?,
            Reply::MotionMode { feedback } => feedback.check()?,
            Reply::Unknown { data } if !matches!(Reply::decode_full(data), Reply::Unknown { .. }) => {
                return Err(EncodeError::Forbidden {
                    field: "command",
                    value: i64::from(self.command()),
                    reason: "this command has a reply of its own",
                });
            }
            _ => {}
        }
        Ok(self.to_bytes())
    }

    /// The reply that the data bytes of a single motor's frame hold: eight of them, except that a timeout notice may be
    /// shorter.
    ///
    /// The bytes do not tell motion mode and the id commands: their ids do, and [`can`](crate::can) and
    /// [`rs485`](crate::rs485) look at those.
    pub fn decode(data: &[u8]) -> Result<Reply, DecodeError> {
        if let Ok(data) = <&[u8; DATA_LEN]>::try_from(data) {
            return Ok(Reply::decode_full(data));
        }
        if let [command::TIMEOUT_NOTICE, payload @ ..] = data
            && let Ok(raw) = RawNotice::new(payload)
        {
            return Ok(Reply::TimeoutNotice { raw });
        }
        Err(DecodeError::Length { got: data.len(), expected: DATA_LEN })
    }

    /// The reply that eight data bytes hold.
    pub(crate) fn decode_full(data: &[u8; DATA_LEN]) -> Reply {
        let [command, payload @ ..] = data;
        match *command {
            command::READ_PID => Reply::Pid { gains: PidGains::decode(data) },
            command::WRITE_PID_RAM => Reply::PidRamWritten { gains: PidGains::decode(data) },
            command::WRITE_PID_ROM => Reply::PidRomWritten { gains: PidGains::decode(data) },
            command::READ_ACCELERATION => Reply::Acceleration { acceleration: acceleration(data) },
            command::WRITE_ACCELERATION => {
                let [index] = request::INDEX.get(data);
                Reply::AccelerationWritten { ramp: Ramp(index), acceleration: acceleration(data) }
            }
            command::READ_ENCODER_POSITION => Reply::EncoderPosition { position: pulses(data) },
            command::READ_ENCODER_RAW_POSITION => Reply::EncoderRawPosition { position: pulses(data) },
            command::READ_ENCODER_OFFSET => Reply::EncoderOffset { offset: pulses(data) },
            command::WRITE_ENCODER_OFFSET => Reply::EncoderOffsetWritten { offset: pulses(data) },
            command::WRITE_POSITION_AS_ZERO => Reply::PositionWrittenAsZero { offset: pulses(data) },
            command::READ_MULTI_TURN_ANGLE => Reply::MultiTurnAngle {
                angle: Centidegrees(i32::from_le_bytes(field::MULTI_TURN_ANGLE.get(data))),
            },
            command::READ_STATUS_1 => Reply::Status1 {
                temperature: temperature(data),
                brake_released: field::BRAKE.get(data) != [field::BRAKE_LOCKED],
                voltage: Decivolts(u16::from_le_bytes(field::VOLTAGE.get(data))),
                faults: Faults::from_bits_retain(u16::from_le_bytes(field::FAULTS.get(data))),
            },
            command::READ_STATUS_2 => Reply::Status2 { motion: Motion::decode(data) },
            command::READ_STATUS_3 => Reply::Status3 {
                temperature: temperature(data),
                phase_a: Centiamps(i16::from_le_bytes(field::PHASE_A.get(data))),
                phase_b: Centiamps(i16::from_le_bytes(field::PHASE_B.get(data))),
                phase_c: Centiamps(i16::from_le_bytes(field::PHASE_C.get(data))),
            },
            command::SHUTDOWN => Reply::Shutdown,
            command::STOP => Reply::Stop,
            command::TORQUE_CURRENT => Reply::TorqueCurrent { motion: Motion::decode(data) },
            command::VELOCITY => Reply::Velocity { motion: Motion::decode(data) },
            command::POSITION_TRACKING => Reply::PositionTracking { motion: Motion::decode(data) },
            command::ABSOLUTE_POSITION => Reply::AbsolutePosition { motion: Motion::decode(data) },
            command::LIMITED_POSITION_TRACKING => {
                Reply::LimitedPositionTracking { motion: Motion::decode(data) }
            }
            command::INCREMENTAL_POSITION => Reply::IncrementalPosition { motion: Motion::decode(data) },
            command::READ_RUN_MODE => {
                let [mode] = field::RUN_MODE.get(data);
                Reply::RunMode { mode: RunMode::from_code(mode) }
            }
            command::READ_POWER => {
                Reply::Power { power: Deciwatts(u16::from_le_bytes(field::POWER.get(data))) }
            }
            command::RELEASE_BRAKE => Reply::BrakeReleased,
            command::LOCK_BRAKE => Reply::BrakeLocked,
            command::READ_RUN_TIME => {
                Reply::RunTime { time: Milliseconds(u32::from_le_bytes(field::RUN_TIME.get(data))) }
            }
            command::READ_VERSION_DATE => {
                Reply::VersionDate { date: VersionDate(u32::from_le_bytes(field::VERSION_DATE.get(data))) }
            }
            command::SET_COMMUNICATION_TIMEOUT => Reply::CommunicationTimeout {
                timeout: Milliseconds(u32::from_le_bytes(request::TIMEOUT.get(data))),
            },
            command::SET_BAUD_RATE => Reply::BaudRateSet { raw: *payload },
            command::READ_MODEL => Reply::Model { model: Model(field::AFTER_COMMAND.get(data)) },
            command::FUNCTION => Reply::Function { function: Function::decode(data) },
            command::TIMEOUT_NOTICE => match RawNotice::new(payload) {
                Ok(raw) => Reply::TimeoutNotice { raw },
                Err(_) => Reply::Unknown { data: *data },
            },
            _ => Reply::Unknown { data: *data },
        }
    }

    /// The data bytes, whether or not they may be sent.
    pub(crate) fn to_bytes(self) -> [u8; DATA_LEN] {
        let mut data = [self.command(), 0, 0, 0, 0, 0, 0, 0];
        match self {
            Reply::Shutdown | Reply::Stop | Reply::BrakeReleased | Reply::BrakeLocked => {}
            Reply::Pid { gains } | Reply::PidRamWritten { gains } | Reply::PidRomWritten { gains } => {
                gains.put(&mut data);
            }
            Reply::Acceleration { acceleration } => {
                request::ACCELERATION.put(&mut data, acceleration.0.to_le_bytes());
            }
            Reply::AccelerationWritten { ramp, acceleration } => {
                request::INDEX.put(&mut data, [ramp.0]);
                request::ACCELERATION.put(&mut data, acceleration.0.to_le_bytes());
            }
            Reply::EncoderPosition { position: pulses }
            | Reply::EncoderRawPosition { position: pulses }
            | Reply::EncoderOffset { offset: pulses }
            | Reply::EncoderOffsetWritten { offset: pulses }
            | Reply::PositionWrittenAsZero { offset: pulses } => {
                field::PULSES.put(&mut data, pulses.0.to_le_bytes());
            }
            Reply::MultiTurnAngle { angle } => field::MULTI_TURN_ANGLE.put(&mut data, angle.0.to_le_bytes()),
            Reply::Status1 { temperature, brake_released, voltage, faults } => {
                let brake = if brake_released { field::BRAKE_RELEASED } else { field::BRAKE_LOCKED };
                field::TEMPERATURE.put(&mut data, temperature.0.to_le_bytes());
                field::BRAKE.put(&mut data, [brake]);
                field::VOLTAGE.put(&mut data, voltage.0.to_le_bytes());
                field::FAULTS.put(&mut data, faults.bits().to_le_bytes());
            }
            Reply::Status3 { temperature, phase_a, phase_b, phase_c } => {
                field::TEMPERATURE.put(&mut data, temperature.0.to_le_bytes());
                field::PHASE_A.put(&mut data, phase_a.0.to_le_bytes());
                field::PHASE_B.put(&mut data, phase_b.0.to_le_bytes());
                field::PHASE_C.put(&mut data, phase_c.0.to_le_bytes());
            }
            Reply::Status2 { motion }
            | Reply::TorqueCurrent { motion }
            | Reply::Velocity { motion }
            | Reply::PositionTracking { motion }
            | Reply::AbsolutePosition { motion }
            | Reply::LimitedPositionTracking { motion }
            | Reply::IncrementalPosition { motion } => motion.put(&mut data),
            Reply::RunMode { mode } => field::RUN_MODE.put(&mut data, [mode.code()]),
            Reply::Power { power } => field::POWER.put(&mut data, power.0.to_le_bytes()),
            Reply::RunTime { time } => field::RUN_TIME.put(&mut data, time.0.to_le_bytes()),
            Reply::VersionDate { date } => field::VERSION_DATE.put(&mut data, date.0.to_le_bytes()),
            Reply::CommunicationTimeout { timeout } => {
                request::TIMEOUT.put(&mut data, timeout.0.to_le_bytes());
            }
            Reply::BaudRateSet { raw } => field::AFTER_COMMAND.put(&mut data, raw),
            Reply::Model { model } => field::AFTER_COMMAND.put(&mut data, model.0),
            Reply::Function { function } => function.put(&mut data),
            Reply::CanId { id } => data = bus_id::can_reply(id),
            Reply::Rs485Id { id } => data = bus_id::rs485_reply(id),
            Reply::CanIdSet { id } | Reply::Rs485IdSet { id } => data = bus_id::write(id.get()),
            Reply::MotionMode { feedback } => data = feedback.to_bytes(),
            Reply::TimeoutNotice { raw } => data = raw.to_bytes(),
            Reply::Unknown { data: received } => data = received,
        }
        data
    }

    /// Data bytes of this frame on CAN.
    pub(crate) fn frame_len(&self) -> usize {
        match self {
            Reply::TimeoutNotice { raw } => raw.frame_len(),
            _ => DATA_LEN,
        }
    }
}

fn temperature(data: &[u8; DATA_LEN]) -> Celsius {
    Celsius(i8::from_le_bytes(field::TEMPERATURE.get(data)))
}

fn acceleration(data: &[u8; DATA_LEN]) -> DegreesPerSecondSquared {
    DegreesPerSecondSquared(u32::from_le_bytes(request::ACCELERATION.get(data)))
}

fn pulses(data: &[u8; DATA_LEN]) -> EncoderPulses {
    EncoderPulses(i32::from_le_bytes(field::PULSES.get(data)))
}
