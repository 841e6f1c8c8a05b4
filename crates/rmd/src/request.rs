//! What the master sends: the eight data bytes of each command.

/// The requests of which the command alone says all, as a pattern: nothing is filled in, shown or put into bytes.
macro_rules! bare {
    () => {
        Request::ReadPid
            | Request::ReadAcceleration
            | Request::ReadEncoderPosition
            | Request::ReadEncoderRawPosition
            | Request::ReadEncoderOffset
            | Request::WritePositionAsZero
            | Request::ReadMultiTurnAngle
            | Request::ReadStatus1
            | Request::ReadStatus2
            | Request::ReadStatus3
            | Request::Shutdown
            | Request::Stop
            | Request::ReadRunMode
            | Request::ReadPower
            | Request::Reset
            | Request::ReleaseBrake
            | Request::LockBrake
            | Request::ReadRunTime
            | Request::ReadVersionDate
            | Request::ReadModel
    };
}

mod build;
mod bytes;
mod fields;
mod reads;

pub(crate) use self::bytes::check_acceleration;

use crate::baud::BaudCode;
use crate::command;
use crate::field::DATA_LEN;
use crate::function::Function;
use crate::motion_mode::MotionCommand;
use crate::pid::PidGains;
use crate::ramp::Ramp;
use crate::units::{
    Centiamps, Centidegrees, CentidegreesPerSecond, DegreesPerSecondSquared, EncoderPulses, FineSpeedLimit,
    Milliseconds, SpeedLimit,
};

/// One command.
///
/// Bytes the manual calls NULL are sent as zero; when received with another value they are passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// 0x30: read the gains (RMD V3.6 §2.1).
    ReadPid,
    /// 0x31: write the gains; lost with the power (RMD V3.6 §2.2).
    WritePidRam {
        /// All six gains.
        gains: PidGains,
    },
    /// 0x32: write the gains to ROM (RMD V3.6 §2.3).
    WritePidRom {
        /// All six gains.
        gains: PidGains,
    },
    /// 0x42: read the acceleration (RMD V3.6 §2.4).
    ReadAcceleration,
    /// 0x43: write one of the four accelerations, to ROM too (RMD V3.6 §2.5).
    WriteAcceleration {
        /// Which of them; only the four the manual lists are encoded.
        ramp: Ramp,
        /// 100..=60000.
        acceleration: DegreesPerSecondSquared,
    },
    /// 0x60: read the multi-turn encoder position, the offset taken off (RMD V3.6 §2.6).
    ReadEncoderPosition,
    /// 0x61: read the multi-turn encoder position as it is (RMD V3.6 §2.7).
    ReadEncoderRawPosition,
    /// 0x62: read the multi-turn encoder offset (RMD V3.6 §2.8).
    ReadEncoderOffset,
    /// 0x63: write the multi-turn encoder offset, the zero point, to ROM; acts after a restart (RMD V3.6 §2.9).
    WriteEncoderOffset {
        /// Offset, the whole i32 range.
        offset: EncoderPulses,
    },
    /// 0x64: write the present position to ROM as the zero point; acts after a restart (RMD V3.6 §2.10).
    WritePositionAsZero,
    /// 0x92: read the multi-turn angle of the output shaft (RMD V3.6 §2.11).
    ReadMultiTurnAngle,
    /// 0x9A: read temperature, brake, voltage and the error word (RMD V3.6 §2.12).
    ReadStatus1,
    /// 0x9C: read temperature, current, speed and angle (RMD V3.6 §2.13).
    ReadStatus2,
    /// 0x9D: read temperature and phase currents (RMD V3.6 §2.14).
    ReadStatus3,
    /// 0x80: switch the output off and leave every closed loop; the shaft turns freely (RMD V3.6 §2.15).
    Shutdown,
    /// 0x81: stop and hold the position (RMD V3.6 §2.16).
    Stop,
    /// 0xA1: hold a torque current; runs only without a fault (RMD V3.6 §2.17).
    TorqueCurrent {
        /// Torque current, the whole i16 range.
        current: Centiamps,
    },
    /// 0xA2: hold a speed of the output shaft; runs only without a fault (RMD V3.6 §2.18).
    Velocity {
        /// Speed, the whole i32 range.
        speed: CentidegreesPerSecond,
    },
    /// 0xA3: follow a multi-turn angle as fast as the motor can; runs only without a fault (RMD V3.6 §2.19).
    PositionTracking {
        /// Angle from the zero point, the whole i32 range. Nothing limits the speed towards it.
        angle: Centidegrees,
    },
    /// 0xA4: move to a multi-turn angle; runs only without a fault (RMD V3.6 §2.20).
    AbsolutePosition {
        /// Highest speed of the move. 0 is encoded, though the manual does not say what it does.
        max_speed: SpeedLimit,
        /// Target angle from the zero point, the whole i32 range.
        angle: Centidegrees,
    },
    /// 0xA5: follow a multi-turn angle; runs only without a fault (RMD V3.6 §2.21).
    LimitedPositionTracking {
        /// Highest speed. 0 is encoded, though the manual does not say what it does.
        max_speed: FineSpeedLimit,
        /// Angle from the zero point, the whole i32 range.
        angle: Centidegrees,
    },
    /// 0xA8: move by an angle; runs only without a fault (RMD V3.6 §2.22). Every frame adds one more move.
    IncrementalPosition {
        /// Highest speed of the move. 0 is encoded, though the manual does not say what it does.
        max_speed: SpeedLimit,
        /// Angle from the present position, the whole i32 range.
        angle: Centidegrees,
    },
    /// 0x70: read the run mode (RMD V3.6 §2.23).
    ReadRunMode,
    /// 0x71: read the motor power (RMD V3.6 §2.24).
    ReadPower,
    /// 0x76: restart the motor's firmware; not answered (RMD V3.6 §2.25).
    Reset,
    /// 0x77: release the brake (RMD V3.6 §2.26).
    ReleaseBrake,
    /// 0x78: lock the brake, as it also is without power (RMD V3.6 §2.27).
    LockBrake,
    /// 0xB1: read the time since the motor started (RMD V3.6 §2.28).
    ReadRunTime,
    /// 0xB2: read the date of the motor's firmware (RMD V3.6 §2.29).
    ReadVersionDate,
    /// 0xB3: cut the output and lock the brake when nothing is received for this long; stored in the motor's ROM
    /// (RMD V3.6 §2.30).
    SetCommunicationTimeout {
        /// Timeout, the whole u32 range; 0 switches the protection off.
        timeout: Milliseconds,
    },
    /// 0xB4: set the rate of both buses, in ROM (RMD V3.6 §2.31). When it takes effect is contradictory, and whatever
    /// comes back is no answer.
    SetBaudRate {
        /// 0..=4 over RS485, 0..=1 over CAN.
        code: BaudCode,
    },
    /// 0xB5: read the motor model (RMD V3.6 §2.32).
    ReadModel,
    /// 0x20: use or switch one of four functions (RMD V3.6 §2.33).
    Function {
        /// The function with its argument.
        function: Function,
    },
    /// 0x79 under CAN id 0x300: read the CAN id; every motor on the bus answers (RMD V3.6 §4).
    ReadCanId,
    /// 0x79 under CAN id 0x300: set the CAN id of every motor on the bus (RMD V3.6 §4).
    SetCanId {
        /// New id, 1..=32.
        id: u8,
    },
    /// Motion mode, under a CAN id of its own (RMD V3.6 §5).
    MotionMode {
        /// The words of the frame; [`MotionRanges`](crate::MotionRanges) gives them their meaning.
        command: MotionCommand,
    },
    /// 0x79 under RS485 id 0xCD: read the RS485 id; every motor on the line answers (RMD V3.6 §7).
    ReadRs485Id,
    /// 0x79 under RS485 id 0xCD: set the RS485 id of every motor on the line (RMD V3.6 §7).
    SetRs485Id {
        /// New id, 1..=32.
        id: u8,
    },
    /// Any other command. It may well move the motor ([`command::CLOSED_LOOP`]) or write its flash.
    Unknown {
        /// The data bytes as received, the command byte first.
        data: [u8; DATA_LEN],
    },
}

impl Request {
    /// The command code: data byte 0, except for motion mode, which has none ([`command::MOTION_MODE`]).
    pub const fn command(&self) -> u8 {
        match self {
            Request::ReadPid => command::READ_PID,
            Request::WritePidRam { .. } => command::WRITE_PID_RAM,
            Request::WritePidRom { .. } => command::WRITE_PID_ROM,
            Request::ReadAcceleration => command::READ_ACCELERATION,
            Request::WriteAcceleration { .. } => command::WRITE_ACCELERATION,
            Request::ReadEncoderPosition => command::READ_ENCODER_POSITION,
            Request::ReadEncoderRawPosition => command::READ_ENCODER_RAW_POSITION,
            Request::ReadEncoderOffset => command::READ_ENCODER_OFFSET,
            Request::WriteEncoderOffset { .. } => command::WRITE_ENCODER_OFFSET,
            Request::WritePositionAsZero => command::WRITE_POSITION_AS_ZERO,
            Request::ReadMultiTurnAngle => command::READ_MULTI_TURN_ANGLE,
            Request::ReadStatus1 => command::READ_STATUS_1,
            Request::ReadStatus2 => command::READ_STATUS_2,
            Request::ReadStatus3 => command::READ_STATUS_3,
            Request::Shutdown => command::SHUTDOWN,
            Request::Stop => command::STOP,
            Request::TorqueCurrent { .. } => command::TORQUE_CURRENT,
            Request::Velocity { .. } => command::VELOCITY,
            Request::PositionTracking { .. } => command::POSITION_TRACKING,
            Request::AbsolutePosition { .. } => command::ABSOLUTE_POSITION,
            Request::LimitedPositionTracking { .. } => command::LIMITED_POSITION_TRACKING,
            Request::IncrementalPosition { .. } => command::INCREMENTAL_POSITION,
            Request::ReadRunMode => command::READ_RUN_MODE,
            Request::ReadPower => command::READ_POWER,
            Request::Reset => command::RESET,
            Request::ReleaseBrake => command::RELEASE_BRAKE,
            Request::LockBrake => command::LOCK_BRAKE,
            Request::ReadRunTime => command::READ_RUN_TIME,
            Request::ReadVersionDate => command::READ_VERSION_DATE,
            Request::SetCommunicationTimeout { .. } => command::SET_COMMUNICATION_TIMEOUT,
            Request::SetBaudRate { .. } => command::SET_BAUD_RATE,
            Request::ReadModel => command::READ_MODEL,
            Request::Function { .. } => command::FUNCTION,
            Request::ReadCanId
            | Request::SetCanId { .. }
            | Request::ReadRs485Id
            | Request::SetRs485Id { .. } => command::BUS_ID,
            Request::MotionMode { .. } => command::MOTION_MODE,
            Request::Unknown { data: [command, ..] } => *command,
        }
    }

    /// Whether a motor answers at all. What comes back after 0xB4 is random and answers nothing (RMD V3.6 §2.25.3,
    /// §2.31.3).
    pub const fn is_answered(&self) -> bool {
        !matches!(self, Request::Reset | Request::SetBaudRate { .. })
    }
}

#[cfg(test)]
mod tests;
