//! The data bytes of requests, both ways.

use codec::check_range;

use super::Request;
use crate::baud::BaudCode;
use crate::bus_id;
use crate::command;
use crate::error::EncodeError;
use crate::field::{ACCELERATION_MAX, ACCELERATION_MIN, DATA_LEN, request as field};
use crate::function::Function;
use crate::node::Node;
use crate::pid::PidGains;
use crate::ramp::Ramp;
use crate::units::{
    Centiamps, Centidegrees, CentidegreesPerSecond, DegreesPerSecondSquared, EncoderPulses, FineSpeedLimit,
    Milliseconds, SpeedLimit,
};

impl Request {
    /// The eight data bytes.
    ///
    /// Refused are values outside the manual's ranges, a [`Function::Other`], and a [`Request::Unknown`] whose command
    /// has a variant of its own: it would pass checks made on that variant unseen.
    ///
    /// The data of motion mode and of the id commands mean something only under their own ids:
    /// [`can`](crate::can) and [`rs485`](crate::rs485) put them there.
    pub fn encode(&self) -> Result<[u8; DATA_LEN], EncodeError> {
        match self {
            Request::WriteAcceleration { ramp, acceleration } => {
                ramp.check()?;
                check_acceleration(*acceleration)?;
            }
            Request::SetBaudRate { code } => code.check()?,
            Request::Function { function } => function.check()?,
            Request::SetCanId { id } | Request::SetRs485Id { id } => {
                check_range("id", i64::from(*id), i64::from(Node::MIN), i64::from(Node::MAX))?;
            }
            Request::MotionMode { command } => command.check()?,
            Request::Unknown { data } if !matches!(Request::decode(data), Request::Unknown { .. }) => {
                return Err(EncodeError::Forbidden {
                    field: "command",
                    value: i64::from(self.command()),
                    reason: "this command has a request of its own",
                });
            }
            _ => {}
        }
        Ok(self.to_bytes())
    }

    /// The request that eight data bytes to a single motor hold. Every byte string is one: what is not listed is
    /// `Unknown`.
    ///
    /// The bytes do not tell motion mode and the id commands: their ids do, and [`can`](crate::can) and
    /// [`rs485`](crate::rs485) look at those.
    pub fn decode(data: &[u8; DATA_LEN]) -> Request {
        let [command, ..] = *data;
        match command {
            command::READ_PID => Request::ReadPid,
            command::WRITE_PID_RAM => Request::WritePidRam { gains: PidGains::decode(data) },
            command::WRITE_PID_ROM => Request::WritePidRom { gains: PidGains::decode(data) },
            command::READ_ACCELERATION => Request::ReadAcceleration,
            command::WRITE_ACCELERATION => {
                let [index] = field::INDEX.get(data);
                let acceleration = u32::from_le_bytes(field::ACCELERATION.get(data));
                Request::WriteAcceleration {
                    ramp: Ramp(index),
                    acceleration: DegreesPerSecondSquared(acceleration),
                }
            }
            command::READ_ENCODER_POSITION => Request::ReadEncoderPosition,
            command::READ_ENCODER_RAW_POSITION => Request::ReadEncoderRawPosition,
            command::READ_ENCODER_OFFSET => Request::ReadEncoderOffset,
            command::WRITE_ENCODER_OFFSET => Request::WriteEncoderOffset {
                offset: EncoderPulses(i32::from_le_bytes(field::ENCODER_OFFSET.get(data))),
            },
            command::WRITE_POSITION_AS_ZERO => Request::WritePositionAsZero,
            command::READ_MULTI_TURN_ANGLE => Request::ReadMultiTurnAngle,
            command::READ_STATUS_1 => Request::ReadStatus1,
            command::READ_STATUS_2 => Request::ReadStatus2,
            command::READ_STATUS_3 => Request::ReadStatus3,
            command::SHUTDOWN => Request::Shutdown,
            command::STOP => Request::Stop,
            command::TORQUE_CURRENT => {
                Request::TorqueCurrent { current: Centiamps(i16::from_le_bytes(field::CURRENT.get(data))) }
            }
            command::VELOCITY => {
                Request::Velocity { speed: CentidegreesPerSecond(i32::from_le_bytes(field::SPEED.get(data))) }
            }
            command::POSITION_TRACKING => Request::PositionTracking { angle: angle(data) },
            command::ABSOLUTE_POSITION => {
                Request::AbsolutePosition { max_speed: SpeedLimit(max_speed(data)), angle: angle(data) }
            }
            command::LIMITED_POSITION_TRACKING => Request::LimitedPositionTracking {
                max_speed: FineSpeedLimit(max_speed(data)),
                angle: angle(data),
            },
            command::INCREMENTAL_POSITION => {
                Request::IncrementalPosition { max_speed: SpeedLimit(max_speed(data)), angle: angle(data) }
            }
            command::READ_RUN_MODE => Request::ReadRunMode,
            command::READ_POWER => Request::ReadPower,
            command::RESET => Request::Reset,
            command::RELEASE_BRAKE => Request::ReleaseBrake,
            command::LOCK_BRAKE => Request::LockBrake,
            command::READ_RUN_TIME => Request::ReadRunTime,
            command::READ_VERSION_DATE => Request::ReadVersionDate,
            command::SET_COMMUNICATION_TIMEOUT => Request::SetCommunicationTimeout {
                timeout: Milliseconds(u32::from_le_bytes(field::TIMEOUT.get(data))),
            },
            command::SET_BAUD_RATE => {
                let [code] = field::BAUD_CODE.get(data);
                Request::SetBaudRate { code: BaudCode(code) }
            }
            command::READ_MODEL => Request::ReadModel,
            command::FUNCTION => Request::Function { function: Function::decode(data) },
            _ => Request::Unknown { data: *data },
        }
    }

    /// The data bytes, whether or not they may be sent.
    pub(crate) fn to_bytes(self) -> [u8; DATA_LEN] {
        let mut data = [self.command(), 0, 0, 0, 0, 0, 0, 0];
        match self {
            bare!() => {}
            Request::WritePidRam { gains } | Request::WritePidRom { gains } => gains.put(&mut data),
            Request::WriteAcceleration { ramp, acceleration } => {
                field::INDEX.put(&mut data, [ramp.0]);
                field::ACCELERATION.put(&mut data, acceleration.0.to_le_bytes());
            }
            Request::WriteEncoderOffset { offset } => {
                field::ENCODER_OFFSET.put(&mut data, offset.0.to_le_bytes());
            }
            Request::TorqueCurrent { current } => field::CURRENT.put(&mut data, current.0.to_le_bytes()),
            Request::Velocity { speed } => field::SPEED.put(&mut data, speed.0.to_le_bytes()),
            Request::PositionTracking { angle } => field::ANGLE.put(&mut data, angle.0.to_le_bytes()),
            Request::AbsolutePosition { max_speed, angle }
            | Request::IncrementalPosition { max_speed, angle } => {
                put_position(&mut data, max_speed.0, angle);
            }
            Request::LimitedPositionTracking { max_speed, angle } => {
                put_position(&mut data, max_speed.0, angle);
            }
            Request::SetCommunicationTimeout { timeout } => {
                field::TIMEOUT.put(&mut data, timeout.0.to_le_bytes());
            }
            Request::SetBaudRate { code } => field::BAUD_CODE.put(&mut data, [code.0]),
            Request::Function { function } => function.put(&mut data),
            Request::ReadCanId | Request::ReadRs485Id => data = bus_id::read(),
            Request::SetCanId { id } | Request::SetRs485Id { id } => data = bus_id::write(id),
            Request::MotionMode { command } => data = command.to_bytes(),
            Request::Unknown { data: received } => data = received,
        }
        data
    }
}

/// Refuses an acceleration outside the range of 0x42 and 0x43.
pub(crate) fn check_acceleration(acceleration: DegreesPerSecondSquared) -> Result<(), EncodeError> {
    let (min, max) = (i64::from(ACCELERATION_MIN), i64::from(ACCELERATION_MAX));
    check_range("acceleration", i64::from(acceleration.0), min, max)
}

fn angle(data: &[u8; DATA_LEN]) -> Centidegrees {
    Centidegrees(i32::from_le_bytes(field::ANGLE.get(data)))
}

fn max_speed(data: &[u8; DATA_LEN]) -> u16 {
    u16::from_le_bytes(field::MAX_SPEED.get(data))
}

fn put_position(data: &mut [u8; DATA_LEN], max_speed: u16, angle: Centidegrees) {
    field::MAX_SPEED.put(data, max_speed.to_le_bytes());
    field::ANGLE.put(data, angle.0.to_le_bytes());
}
