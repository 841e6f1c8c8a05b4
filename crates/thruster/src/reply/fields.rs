//! A reply by name, field by field.

use codec::{CommandInfo, UNKNOWN, Visit};

use super::Reply;
use crate::faults::Faults;
use crate::field::{POSITION_LIMITS, command};
use crate::request::{visit_limits, visit_parameter, visit_return, visit_stream};
use crate::returned::{Headerless, ReturnSource, Returned, ReturnedFrame};
use crate::table::{self, COMMANDS, field as f};

impl Reply {
    /// The command in [`COMMANDS`](crate::COMMANDS), of a refusal the refused one; `None` for what the manual does not
    /// list.
    pub fn info(&self) -> Option<&'static CommandInfo> {
        Some(match self {
            Reply::Signal { .. } => &table::SIGNAL,
            Reply::Speed { .. } => &table::SPEED,
            Reply::MeasuredSpeed { .. } => &table::READ_SPEED,
            Reply::Current { .. } => &table::READ_CURRENT,
            Reply::Voltage { .. } => &table::READ_VOLTAGE,
            Reply::MotorTemperature { .. } => &table::READ_MOTOR_TEMPERATURE,
            Reply::DriverTemperature { .. } => &table::READ_DRIVER_TEMPERATURE,
            Reply::Faults { .. } => &table::READ_FAULTS,
            Reply::FaultsCleared => &table::CLEAR_FAULTS,
            Reply::RequestMode => &table::REQUEST_MODE,
            Reply::LowSpeedMode => &table::LOW_SPEED_MODE,
            Reply::MediumSpeedMode => &table::MEDIUM_SPEED_MODE,
            Reply::Id { .. } => &table::SET_ID,
            Reply::Bitrate { .. } => &table::SET_BITRATE,
            Reply::Timeout { .. } => &table::SET_TIMEOUT,
            Reply::ReturnConfigured { .. } => &table::CONFIGURE_RETURN,
            Reply::StreamConfigured { .. } => &table::CONFIGURE_STREAM,
            Reply::Returned(returned) => info_of_returned(returned),
            Reply::FaultRecord { .. } => &table::READ_FAULT_RECORD,
            Reply::ParameterSet { .. } => &table::SET_PARAMETER,
            Reply::Parameter { .. } => &table::READ_PARAMETER,
            Reply::AbsolutePosition { .. } => &table::ABSOLUTE_POSITION,
            Reply::MeasuredPosition { .. } => &table::READ_ABSOLUTE_POSITION,
            Reply::AbsoluteZeroSet => &table::SET_ABSOLUTE_ZERO,
            Reply::PositionLimitsSet { .. } => &table::SET_POSITION_LIMITS,
            Reply::PositionLimits { .. } => &table::READ_POSITION_LIMITS,
            Reply::RelativePosition { .. } => &table::RELATIVE_POSITION,
            Reply::MeasuredRelativePosition { .. } => &table::READ_RELATIVE_POSITION,
            Reply::RelativeZeroSet => &table::SET_RELATIVE_ZERO,
            Reply::RelativePositionCleared => &table::CLEAR_RELATIVE_POSITION,
            Reply::EmergencyStop => &table::EMERGENCY_STOP,
            Reply::Refused { command: command::SP, parameter: POSITION_LIMITS } => {
                &table::SET_POSITION_LIMITS
            }
            Reply::Refused { command, .. } => return COMMANDS.iter().find(|info| info.code == *command),
            Reply::Unknown { .. } => return None,
        })
    }

    /// The command's name in [`COMMANDS`](crate::COMMANDS), or `unknown`.
    pub fn name(&self) -> &'static str {
        match self.info() {
            Some(info) => info.name,
            None => UNKNOWN,
        }
    }

    /// Hands on every field in the order of [`CommandInfo::reply`]; of a refusal `refused`, and what it repeats.
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        match self {
            Reply::Signal { signal } => f::SIGNAL.visit_count(visit, signal.0),
            Reply::Speed { speed } | Reply::MeasuredSpeed { speed } => f::SPEED.visit_count(visit, speed.0),
            Reply::Current { current } => f::CURRENT.visit_count(visit, current.0),
            Reply::Voltage { voltage } => f::VOLTAGE.visit_count(visit, voltage.0),
            Reply::MotorTemperature { temperature } | Reply::DriverTemperature { temperature } => {
                f::TEMPERATURE.visit_count(visit, temperature.0);
            }
            Reply::Faults { faults } | Reply::FaultRecord { faults } => visit_faults(visit, *faults),
            Reply::Id { id } => f::ID.visit_integer(visit, *id),
            Reply::Bitrate { bitrate } => f::BITRATE.visit_integer(visit, bitrate.0),
            Reply::Timeout { timeout } => f::TIMEOUT.visit_integer(visit, timeout.0),
            Reply::ReturnConfigured { flags, frames } => visit_return(visit, *flags, *frames),
            Reply::StreamConfigured { frames, interval } => visit_stream(visit, *frames, *interval),
            Reply::Returned(returned) => visit_returned(visit, &returned.frame),
            Reply::ParameterSet { parameter, data } | Reply::Parameter { parameter, data } => {
                visit_parameter(visit, *parameter, *data);
            }
            Reply::AbsolutePosition { speed, position } | Reply::RelativePosition { speed, position } => {
                f::MOVE_SPEED.visit_count(visit, speed.0);
                f::WIDE_ANGLE.visit_count(visit, position.0);
            }
            Reply::MeasuredPosition { position } | Reply::MeasuredRelativePosition { position } => {
                f::WIDE_ANGLE.visit_count(visit, position.0);
            }
            Reply::PositionLimitsSet { reverse, forward } | Reply::PositionLimits { reverse, forward } => {
                visit_limits(visit, *reverse, *forward);
            }
            Reply::Refused { command, parameter } => visit_refused(visit, *command, *parameter),
            Reply::Unknown { payload } => f::DATA.visit_bytes(visit, payload.as_slice()),
            Reply::FaultsCleared
            | Reply::RequestMode
            | Reply::LowSpeedMode
            | Reply::MediumSpeedMode
            | Reply::AbsoluteZeroSet
            | Reply::RelativeZeroSet
            | Reply::RelativePositionCleared
            | Reply::EmergencyStop => {}
        }
    }
}

impl Headerless {
    /// Name of the frame in listings; no row of [`COMMANDS`](crate::COMMANDS), as it has no command word.
    pub const NAME: &'static str = table::HEADERLESS;

    /// Hands on every field in the order of the wire.
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        f::SPEED.visit_count(visit, self.speed.0);
        f::VOLTAGE.visit_count(visit, self.voltage.0);
        f::CURRENT.visit_count(visit, self.current.0);
        visit_faults(visit, self.faults);
    }
}

fn info_of_returned(returned: &Returned) -> &'static CommandInfo {
    use ReturnSource::{Signal, Speed, Stream};
    use ReturnedFrame::{Condition, Motion, Position};
    match (returned.source, returned.frame) {
        (Signal, Motion { .. }) => &table::SIGNAL_RETURN_1,
        (Signal, Condition { .. }) => &table::SIGNAL_RETURN_2,
        (Signal, Position { .. }) => &table::SIGNAL_RETURN_3,
        (Speed, Motion { .. }) => &table::SPEED_RETURN_1,
        (Speed, Condition { .. }) => &table::SPEED_RETURN_2,
        (Speed, Position { .. }) => &table::SPEED_RETURN_3,
        (Stream, Motion { .. }) => &table::STREAM_1,
        (Stream, Condition { .. }) => &table::STREAM_2,
        (Stream, Position { .. }) => &table::STREAM_3,
    }
}

fn visit_returned(visit: &mut Visit<'_>, frame: &ReturnedFrame) {
    match frame {
        ReturnedFrame::Motion { speed, voltage, current } => {
            f::SPEED.visit_count(visit, speed.0);
            f::VOLTAGE.visit_count(visit, voltage.0);
            f::CURRENT.visit_count(visit, current.0);
        }
        ReturnedFrame::Condition { faults, motor_temperature, driver_temperature } => {
            visit_faults(visit, *faults);
            f::MOTOR_TEMPERATURE.visit_count(visit, motor_temperature.0);
            f::DRIVER_TEMPERATURE.visit_count(visit, driver_temperature.0);
        }
        ReturnedFrame::Position { raw } => {
            if let Some(absolute) = frame.absolute_position() {
                f::ABSOLUTE_ANGLE.visit_count(visit, absolute.0);
            }
            f::DATA.visit_bytes(visit, raw);
        }
    }
}

fn visit_faults(visit: &mut Visit<'_>, faults: Faults) {
    f::FAULTS.visit_flags(visit, faults.bits(), Faults::visit_names);
}

fn visit_refused(visit: &mut Visit<'_>, command: u16, parameter: u16) {
    f::REFUSED.visit_bool(visit, true);
    match command {
        command::LA | command::LR => f::MOVE_SPEED.visit_count(visit, parameter),
        command::SP if parameter != POSITION_LIMITS => f::PARAMETER.visit_integer(visit, parameter),
        _ => {}
    }
}
