//! A request by name, field by field.

use codec::{CommandInfo, UNKNOWN, Visit};

use super::Request;
use crate::returned::{ReturnFlags, ReturnFrames};
use crate::table::{self, field as f};
use crate::units::{LimitDecidegrees, Milliseconds};

impl Request {
    /// The command in [`COMMANDS`](crate::COMMANDS); `None` for what the manual does not list.
    pub const fn info(&self) -> Option<&'static CommandInfo> {
        Some(match self {
            Request::Signal { .. } => &table::SIGNAL,
            Request::Speed { .. } => &table::SPEED,
            Request::ReadSpeed => &table::READ_SPEED,
            Request::ReadCurrent => &table::READ_CURRENT,
            Request::ReadVoltage => &table::READ_VOLTAGE,
            Request::ReadMotorTemperature => &table::READ_MOTOR_TEMPERATURE,
            Request::ReadDriverTemperature => &table::READ_DRIVER_TEMPERATURE,
            Request::ReadFaults => &table::READ_FAULTS,
            Request::ClearFaults => &table::CLEAR_FAULTS,
            Request::RequestMode => &table::REQUEST_MODE,
            Request::LowSpeedMode => &table::LOW_SPEED_MODE,
            Request::MediumSpeedMode => &table::MEDIUM_SPEED_MODE,
            Request::SetId { .. } => &table::SET_ID,
            Request::SetBitrate { .. } => &table::SET_BITRATE,
            Request::SetTimeout { .. } => &table::SET_TIMEOUT,
            Request::ConfigureReturn { .. } => &table::CONFIGURE_RETURN,
            Request::ConfigureStream { .. } => &table::CONFIGURE_STREAM,
            Request::ReadFaultRecord => &table::READ_FAULT_RECORD,
            Request::SetParameter { .. } => &table::SET_PARAMETER,
            Request::ReadParameter { .. } => &table::READ_PARAMETER,
            Request::AbsolutePosition { .. } => &table::ABSOLUTE_POSITION,
            Request::ReadAbsolutePosition => &table::READ_ABSOLUTE_POSITION,
            Request::SetAbsoluteZero => &table::SET_ABSOLUTE_ZERO,
            Request::SetPositionLimits { .. } => &table::SET_POSITION_LIMITS,
            Request::ReadPositionLimits => &table::READ_POSITION_LIMITS,
            Request::RelativePosition { .. } => &table::RELATIVE_POSITION,
            Request::ReadRelativePosition => &table::READ_RELATIVE_POSITION,
            Request::SetRelativeZero => &table::SET_RELATIVE_ZERO,
            Request::ClearRelativePosition => &table::CLEAR_RELATIVE_POSITION,
            Request::EmergencyStop => &table::EMERGENCY_STOP,
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

    /// Hands on every field in the order of [`CommandInfo::request`].
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        match self {
            Request::Signal { signal } => f::SIGNAL.visit_count(visit, signal.0),
            Request::Speed { speed } => f::SPEED.visit_count(visit, speed.0),
            Request::SetId { id } => f::ID.visit_integer(visit, *id),
            Request::SetBitrate { bitrate } => f::BITRATE.visit_integer(visit, bitrate.0),
            Request::SetTimeout { timeout } => f::TIMEOUT.visit_integer(visit, timeout.0),
            Request::ConfigureReturn { flags, frames } => visit_return(visit, *flags, *frames),
            Request::ConfigureStream { frames, interval } => visit_stream(visit, *frames, *interval),
            Request::SetParameter { parameter, data } => visit_parameter(visit, *parameter, *data),
            Request::ReadParameter { parameter } => f::PARAMETER.visit_integer(visit, *parameter),
            Request::SetPositionLimits { reverse, forward } => visit_limits(visit, *reverse, *forward),
            Request::AbsolutePosition { speed, position } => {
                f::MOVE_SPEED.visit_count(visit, speed.0);
                f::ANGLE.visit_count(visit, position.0);
            }
            Request::RelativePosition { speed, position } => {
                f::MOVE_SPEED.visit_count(visit, speed.0);
                f::WIDE_ANGLE.visit_count(visit, position.0);
            }
            Request::Unknown { payload } => f::DATA.visit_bytes(visit, payload.as_slice()),
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
            | Request::SetAbsoluteZero
            | Request::ReadPositionLimits
            | Request::ReadRelativePosition
            | Request::SetRelativeZero
            | Request::ClearRelativePosition
            | Request::EmergencyStop => {}
        }
    }
}

pub(crate) fn visit_return(visit: &mut Visit<'_>, flags: ReturnFlags, frames: ReturnFrames) {
    f::FLAGS.visit_flags(visit, flags.bits(), ReturnFlags::visit_names);
    f::FRAMES.visit_flags(visit, frames.bits(), ReturnFrames::visit_names);
}

pub(crate) fn visit_stream(visit: &mut Visit<'_>, frames: ReturnFrames, interval: Milliseconds) {
    f::FRAMES.visit_flags(visit, frames.bits(), ReturnFrames::visit_names);
    f::INTERVAL.visit_integer(visit, interval.0);
}

pub(crate) fn visit_parameter(visit: &mut Visit<'_>, parameter: u16, data: [u8; 4]) {
    f::PARAMETER.visit_integer(visit, parameter);
    f::VALUE.visit_integer(visit, u32::from_be_bytes(data));
}

pub(crate) fn visit_limits(visit: &mut Visit<'_>, reverse: LimitDecidegrees, forward: LimitDecidegrees) {
    f::REVERSE.visit_count(visit, reverse.0);
    f::FORWARD.visit_count(visit, forward.0);
}
