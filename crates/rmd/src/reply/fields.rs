//! A reply by name, field by field.

use codec::{CommandInfo, FieldValue, UNKNOWN, Visit};

use super::Reply;
use crate::faults::Faults;
use crate::model::Model;
use crate::motion_mode::{MotionFeedback, MotionRanges};
use crate::table::{self, field as f};

impl Reply {
    /// The command in [`COMMANDS`](crate::COMMANDS); `None` for what the manual does not list.
    pub const fn info(&self) -> Option<&'static CommandInfo> {
        Some(match self {
            Reply::Pid { .. } => &table::READ_PID,
            Reply::PidRamWritten { .. } => &table::WRITE_PID_RAM,
            Reply::PidRomWritten { .. } => &table::WRITE_PID_ROM,
            Reply::Acceleration { .. } => &table::READ_ACCELERATION,
            Reply::AccelerationWritten { .. } => &table::WRITE_ACCELERATION,
            Reply::EncoderPosition { .. } => &table::READ_ENCODER_POSITION,
            Reply::EncoderRawPosition { .. } => &table::READ_ENCODER_RAW_POSITION,
            Reply::EncoderOffset { .. } => &table::READ_ENCODER_OFFSET,
            Reply::EncoderOffsetWritten { .. } => &table::WRITE_ENCODER_OFFSET,
            Reply::PositionWrittenAsZero { .. } => &table::WRITE_POSITION_AS_ZERO,
            Reply::MultiTurnAngle { .. } => &table::READ_MULTI_TURN_ANGLE,
            Reply::Status1 { .. } => &table::READ_STATUS_1,
            Reply::Status2 { .. } => &table::READ_STATUS_2,
            Reply::Status3 { .. } => &table::READ_STATUS_3,
            Reply::Shutdown => &table::SHUTDOWN,
            Reply::Stop => &table::STOP,
            Reply::TorqueCurrent { .. } => &table::TORQUE_CURRENT,
            Reply::Velocity { .. } => &table::VELOCITY,
            Reply::PositionTracking { .. } => &table::POSITION_TRACKING,
            Reply::AbsolutePosition { .. } => &table::ABSOLUTE_POSITION,
            Reply::LimitedPositionTracking { .. } => &table::LIMITED_POSITION_TRACKING,
            Reply::IncrementalPosition { .. } => &table::INCREMENTAL_POSITION,
            Reply::RunMode { .. } => &table::READ_RUN_MODE,
            Reply::Power { .. } => &table::READ_POWER,
            Reply::BrakeReleased => &table::RELEASE_BRAKE,
            Reply::BrakeLocked => &table::LOCK_BRAKE,
            Reply::RunTime { .. } => &table::READ_RUN_TIME,
            Reply::VersionDate { .. } => &table::READ_VERSION_DATE,
            Reply::CommunicationTimeout { .. } => &table::SET_COMMUNICATION_TIMEOUT,
            Reply::BaudRateSet { .. } => &table::SET_BAUD_RATE,
            Reply::Model { .. } => &table::READ_MODEL,
            Reply::Function { function } => return function.info(),
            Reply::CanId { .. } => &table::READ_CAN_ID,
            Reply::CanIdSet { .. } => &table::SET_CAN_ID,
            Reply::MotionMode { .. } => &table::MOTION_MODE,
            Reply::Rs485Id { .. } => &table::READ_RS485_ID,
            Reply::Rs485IdSet { .. } => &table::SET_RS485_ID,
            Reply::TimeoutNotice { .. } => &table::TIMEOUT_NOTICE,
            Reply::Unknown { .. } => return None,
        })
    }

    /// The command's name in [`COMMANDS`](crate::COMMANDS), or `unknown`.
    pub const fn name(&self) -> &'static str {
        match self.info() {
            Some(info) => info.name,
            None => UNKNOWN,
        }
    }

    /// Hands on every field in the order of [`CommandInfo::reply`]; motion mode in the manual's ranges.
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        self.visit_fields_in(&MotionRanges::DEFAULT, visit);
    }

    /// Hands on every field; motion mode in these ranges.
    pub fn visit_fields_in(&self, ranges: &MotionRanges, visit: &mut Visit<'_>) {
        match self {
            Reply::Shutdown | Reply::Stop | Reply::BrakeReleased | Reply::BrakeLocked => {}
            Reply::Pid { gains } | Reply::PidRamWritten { gains } | Reply::PidRomWritten { gains } => {
                gains.visit(visit);
            }
            Reply::Acceleration { acceleration } => f::ACCELERATION.visit_count(visit, acceleration.0),
            Reply::AccelerationWritten { ramp, acceleration } => {
                f::RAMP.visit_integer(visit, ramp.0);
                f::RAMP_NAME.visit_name(visit, ramp.name());
                f::ACCELERATION.visit_count(visit, acceleration.0);
            }
            Reply::EncoderPosition { position } | Reply::EncoderRawPosition { position } => {
                f::POSITION_PULSES.visit_integer(visit, position.0);
            }
            Reply::EncoderOffset { offset }
            | Reply::EncoderOffsetWritten { offset }
            | Reply::PositionWrittenAsZero { offset } => f::OFFSET_PULSES.visit_integer(visit, offset.0),
            Reply::MultiTurnAngle { angle } => f::ANGLE.visit_count(visit, angle.0),
            Reply::Status1 { temperature, brake_released, voltage, faults } => {
                f::TEMPERATURE.visit_count(visit, temperature.0);
                f::BRAKE_RELEASED.visit_bool(visit, *brake_released);
                f::VOLTAGE.visit_count(visit, voltage.0);
                visit_faults(*faults, visit);
            }
            Reply::Status3 { temperature, phase_a, phase_b, phase_c } => {
                f::TEMPERATURE.visit_count(visit, temperature.0);
                f::PHASE_A.visit_count(visit, phase_a.0);
                f::PHASE_B.visit_count(visit, phase_b.0);
                f::PHASE_C.visit_count(visit, phase_c.0);
            }
            Reply::Status2 { motion }
            | Reply::TorqueCurrent { motion }
            | Reply::Velocity { motion }
            | Reply::PositionTracking { motion }
            | Reply::AbsolutePosition { motion }
            | Reply::LimitedPositionTracking { motion }
            | Reply::IncrementalPosition { motion } => motion.visit(visit),
            Reply::RunMode { mode } => {
                f::RUN_MODE.visit_integer(visit, mode.code());
                f::RUN_MODE_NAME.visit_name(visit, mode.name());
            }
            Reply::Power { power } => f::POWER.visit_count(visit, power.0),
            Reply::RunTime { time } => f::RUN_TIME.visit_integer(visit, time.0),
            Reply::VersionDate { date } => f::VERSION_DATE.visit_integer(visit, date.0),
            Reply::CommunicationTimeout { timeout } => f::TIMEOUT.visit_integer(visit, timeout.0),
            Reply::BaudRateSet { raw } => f::DATA.visit_bytes(visit, raw),
            Reply::Model { model } => visit_model(model, visit),
            Reply::Function { function } => function.visit(visit),
            Reply::CanId { id }
            | Reply::CanIdSet { id }
            | Reply::Rs485Id { id }
            | Reply::Rs485IdSet { id } => f::ID.visit_integer(visit, id.get()),
            Reply::MotionMode { feedback } => visit_feedback(feedback, ranges, visit),
            Reply::TimeoutNotice { raw } => f::DATA.visit_bytes(visit, raw.payload()),
            Reply::Unknown { data } => f::DATA.visit_bytes(visit, data),
        }
    }
}

fn visit_faults(faults: Faults, visit: &mut Visit<'_>) {
    let raw = u32::from(faults.bits());
    visit(f::FAULTS.name, FieldValue::Flags { raw, names: Faults::visit_names });
}

fn visit_model(model: &Model, visit: &mut Visit<'_>) {
    match model.as_str() {
        Some(text) => visit(f::MODEL.name, FieldValue::Text(text)),
        None => f::MODEL.visit_bytes(visit, &model.0),
    }
}

fn visit_feedback(feedback: &MotionFeedback, ranges: &MotionRanges, visit: &mut Visit<'_>) {
    let state = ranges.state(feedback);
    f::ID.visit_integer(visit, feedback.id);
    f::POSITION.visit_physical(visit, state.position_rad);
    f::VELOCITY.visit_physical(visit, state.velocity_rad_s);
    f::TORQUE.visit_physical(visit, state.torque_nm);
}
