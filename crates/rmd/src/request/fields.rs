//! A request by name, field by field.

use codec::{CommandInfo, UNKNOWN, Visit};

use super::Request;
use crate::motion_mode::{MotionCommand, MotionRanges};
use crate::pid::PidGains;
use crate::table::{self, field as f};
use crate::units::Centidegrees;

impl Request {
    /// The command in [`COMMANDS`](crate::COMMANDS); `None` for what the manual does not list.
    pub const fn info(&self) -> Option<&'static CommandInfo> {
        Some(match self {
            Request::ReadPid => &table::READ_PID,
            Request::WritePidRam { .. } => &table::WRITE_PID_RAM,
            Request::WritePidRom { .. } => &table::WRITE_PID_ROM,
            Request::ReadAcceleration => &table::READ_ACCELERATION,
            Request::WriteAcceleration { .. } => &table::WRITE_ACCELERATION,
            Request::ReadEncoderPosition => &table::READ_ENCODER_POSITION,
            Request::ReadEncoderRawPosition => &table::READ_ENCODER_RAW_POSITION,
            Request::ReadEncoderOffset => &table::READ_ENCODER_OFFSET,
            Request::WriteEncoderOffset { .. } => &table::WRITE_ENCODER_OFFSET,
            Request::WritePositionAsZero => &table::WRITE_POSITION_AS_ZERO,
            Request::ReadMultiTurnAngle => &table::READ_MULTI_TURN_ANGLE,
            Request::ReadStatus1 => &table::READ_STATUS_1,
            Request::ReadStatus2 => &table::READ_STATUS_2,
            Request::ReadStatus3 => &table::READ_STATUS_3,
            Request::Shutdown => &table::SHUTDOWN,
            Request::Stop => &table::STOP,
            Request::TorqueCurrent { .. } => &table::TORQUE_CURRENT,
            Request::Velocity { .. } => &table::VELOCITY,
            Request::PositionTracking { .. } => &table::POSITION_TRACKING,
            Request::AbsolutePosition { .. } => &table::ABSOLUTE_POSITION,
            Request::LimitedPositionTracking { .. } => &table::LIMITED_POSITION_TRACKING,
            Request::IncrementalPosition { .. } => &table::INCREMENTAL_POSITION,
            Request::ReadRunMode => &table::READ_RUN_MODE,
            Request::ReadPower => &table::READ_POWER,
            Request::Reset => &table::RESET,
            Request::ReleaseBrake => &table::RELEASE_BRAKE,
            Request::LockBrake => &table::LOCK_BRAKE,
            Request::ReadRunTime => &table::READ_RUN_TIME,
            Request::ReadVersionDate => &table::READ_VERSION_DATE,
            Request::SetCommunicationTimeout { .. } => &table::SET_COMMUNICATION_TIMEOUT,
            Request::SetBaudRate { .. } => &table::SET_BAUD_RATE,
            Request::ReadModel => &table::READ_MODEL,
            Request::Function { function } => return function.info(),
            Request::ReadCanId => &table::READ_CAN_ID,
            Request::SetCanId { .. } => &table::SET_CAN_ID,
            Request::MotionMode { .. } => &table::MOTION_MODE,
            Request::ReadRs485Id => &table::READ_RS485_ID,
            Request::SetRs485Id { .. } => &table::SET_RS485_ID,
            Request::Unknown { .. } => return None,
        })
    }

    /// The command's name in [`COMMANDS`](crate::COMMANDS), or `unknown`.
    pub const fn name(&self) -> &'static str {
        match self.info() {
            Some(info) => info.name,
            None => UNKNOWN,
        }
    }

    /// Hands on every field in the order of [`CommandInfo::request`]; motion mode in the manual's ranges.
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        self.visit_fields_in(&MotionRanges::DEFAULT, visit);
    }

    /// Hands on every field; motion mode in these ranges.
    pub fn visit_fields_in(&self, ranges: &MotionRanges, visit: &mut Visit<'_>) {
        match self {
            Request::WritePidRam { gains } | Request::WritePidRom { gains } => gains.visit(visit),
            Request::WriteAcceleration { ramp, acceleration } => {
                f::RAMP.visit_integer(visit, ramp.0);
                f::RAMP_NAME.visit_name(visit, ramp.name());
                f::ACCELERATION.visit_count(visit, acceleration.0);
            }
            Request::WriteEncoderOffset { offset } => f::OFFSET_PULSES.visit_integer(visit, offset.0),
            Request::TorqueCurrent { current } => f::CURRENT.visit_count(visit, current.0),
            Request::Velocity { speed } => f::SPEED.visit_count(visit, speed.0),
            Request::PositionTracking { angle } => visit_angle(*angle, visit),
            Request::AbsolutePosition { max_speed, angle }
            | Request::IncrementalPosition { max_speed, angle } => {
                f::MAX_SPEED.visit_count(visit, max_speed.0);
                visit_angle(*angle, visit);
            }
            Request::LimitedPositionTracking { max_speed, angle } => {
                f::FINE_MAX_SPEED.visit_count(visit, max_speed.0);
                visit_angle(*angle, visit);
            }
            Request::SetCommunicationTimeout { timeout } => f::TIMEOUT.visit_integer(visit, timeout.0),
            Request::SetBaudRate { code } => f::BAUD_CODE.visit_integer(visit, code.0),
            Request::Function { function } => function.visit(visit),
            Request::SetCanId { id } | Request::SetRs485Id { id } => f::ID.visit_integer(visit, *id),
            Request::MotionMode { command } => visit_motion(command, ranges, visit),
            Request::Unknown { data } => f::DATA.visit_bytes(visit, data),
            bare!() | Request::ReadCanId | Request::ReadRs485Id => {}
        }
    }
}

impl PidGains {
    pub(crate) fn visit(&self, visit: &mut Visit<'_>) {
        f::CURRENT_KP.visit_integer(visit, self.current_kp);
        f::CURRENT_KI.visit_integer(visit, self.current_ki);
        f::SPEED_KP.visit_integer(visit, self.speed_kp);
        f::SPEED_KI.visit_integer(visit, self.speed_ki);
        f::POSITION_KP.visit_integer(visit, self.position_kp);
        f::POSITION_KI.visit_integer(visit, self.position_ki);
    }
}

fn visit_angle(angle: Centidegrees, visit: &mut Visit<'_>) {
    f::ANGLE.visit_count(visit, angle.0);
}

fn visit_motion(command: &MotionCommand, ranges: &MotionRanges, visit: &mut Visit<'_>) {
    let target = ranges.target(command);
    f::POSITION.visit_physical(visit, target.position_rad);
    f::VELOCITY.visit_physical(visit, target.velocity_rad_s);
    f::KP.visit_physical(visit, target.kp);
    f::KD.visit_physical(visit, target.kd);
    f::TORQUE.visit_physical(visit, target.torque_nm);
}
