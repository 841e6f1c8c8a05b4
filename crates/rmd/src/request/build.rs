//! A request from a name and numbers.

use codec::{BuildError, Fields};

use super::Request;
use crate::baud::BaudCode;
use crate::function::Function;
use crate::motion_mode::{MotionCommand, MotionRanges, MotionTarget};
use crate::pid::PidGains;
use crate::ramp::Ramp;
use crate::table::field as f;
use crate::units::{
    Centiamps, Centidegrees, CentidegreesPerSecond, DegreesPerSecondSquared, EncoderPulses, FineSpeedLimit,
    Milliseconds, SpeedLimit,
};

impl Request {
    /// The command of this name in [`COMMANDS`](crate::COMMANDS) with the values that `fields` gives for the names in
    /// its [`request`](crate::CommandInfo::request), in the units of those names; 0 or 1 for a bool. Motion mode in the
    /// manual's ranges.
    ///
    /// A value outside its range is refused; inside it is rounded to the nearest count of the wire.
    ///
    /// ```
    /// use rmd::{Centiamps, Request};
    ///
    /// let request = Request::build("torque_current", &|field| (field == "current_a").then_some(-1.0))?;
    /// assert_eq!(request, Request::TorqueCurrent { current: Centiamps(-100) });
    /// # Ok::<(), rmd::BuildError>(())
    /// ```
    pub fn build(name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Request, BuildError> {
        Request::build_in(&MotionRanges::DEFAULT, name, fields)
    }

    /// [`build`](Request::build) with motion mode in these ranges.
    pub fn build_in(
        ranges: &MotionRanges,
        name: &str,
        fields: &dyn Fn(&str) -> Option<f64>,
    ) -> Result<Request, BuildError> {
        let request = BLANKS.iter().find(|blank| blank.name() == name).ok_or(BuildError::UnknownCommand)?;
        let request = fill(*request, &Fields(fields), ranges)?;
        request.encode()?;
        Ok(request)
    }
}

const GAINS: PidGains =
    PidGains { current_kp: 0, current_ki: 0, speed_kp: 0, speed_ki: 0, position_kp: 0, position_ki: 0 };

/// Every command that can be sent, its fields yet to be filled in.
const BLANKS: [Request; 41] = [
    Request::ReadPid,
    Request::WritePidRam { gains: GAINS },
    Request::WritePidRom { gains: GAINS },
    Request::ReadAcceleration,
    Request::WriteAcceleration { ramp: Ramp(0), acceleration: DegreesPerSecondSquared(0) },
    Request::ReadEncoderPosition,
    Request::ReadEncoderRawPosition,
    Request::ReadEncoderOffset,
    Request::WriteEncoderOffset { offset: EncoderPulses(0) },
    Request::WritePositionAsZero,
    Request::ReadMultiTurnAngle,
    Request::ReadStatus1,
    Request::ReadStatus2,
    Request::ReadStatus3,
    Request::Shutdown,
    Request::Stop,
    Request::TorqueCurrent { current: Centiamps(0) },
    Request::Velocity { speed: CentidegreesPerSecond(0) },
    Request::PositionTracking { angle: Centidegrees(0) },
    Request::AbsolutePosition { max_speed: SpeedLimit(0), angle: Centidegrees(0) },
    Request::LimitedPositionTracking { max_speed: FineSpeedLimit(0), angle: Centidegrees(0) },
    Request::IncrementalPosition { max_speed: SpeedLimit(0), angle: Centidegrees(0) },
    Request::ReadRunMode,
    Request::ReadPower,
    Request::Reset,
    Request::ReleaseBrake,
    Request::LockBrake,
    Request::ReadRunTime,
    Request::ReadVersionDate,
    Request::SetCommunicationTimeout { timeout: Milliseconds(0) },
    Request::SetBaudRate { code: BaudCode(0) },
    Request::ReadModel,
    Request::Function { function: Function::ClearMultiTurn },
    Request::Function { function: Function::CanIdFilter { enabled: false } },
    Request::Function { function: Function::ErrorReporting { enabled: false } },
    Request::Function { function: Function::MultiTurnSaving { enabled: false } },
    Request::ReadCanId,
    Request::SetCanId { id: 0 },
    Request::MotionMode { command: MotionCommand::NEUTRAL },
    Request::ReadRs485Id,
    Request::SetRs485Id { id: 0 },
];

fn fill(blank: Request, fields: &Fields<'_>, ranges: &MotionRanges) -> Result<Request, BuildError> {
    Ok(match blank {
        Request::WritePidRam { .. } => Request::WritePidRam { gains: gains(fields)? },
        Request::WritePidRom { .. } => Request::WritePidRom { gains: gains(fields)? },
        Request::WriteAcceleration { .. } => Request::WriteAcceleration {
            ramp: Ramp(fields.count(&f::RAMP)?),
            acceleration: DegreesPerSecondSquared(fields.count(&f::ACCELERATION)?),
        },
        Request::WriteEncoderOffset { .. } => {
            Request::WriteEncoderOffset { offset: EncoderPulses(fields.count(&f::OFFSET_PULSES)?) }
        }
        Request::TorqueCurrent { .. } => {
            Request::TorqueCurrent { current: Centiamps(fields.count(&f::CURRENT)?) }
        }
        Request::Velocity { .. } => {
            Request::Velocity { speed: CentidegreesPerSecond(fields.count(&f::SPEED)?) }
        }
        Request::PositionTracking { .. } => Request::PositionTracking { angle: angle(fields)? },
        Request::AbsolutePosition { .. } => {
            Request::AbsolutePosition { max_speed: max_speed(fields)?, angle: angle(fields)? }
        }
        Request::LimitedPositionTracking { .. } => Request::LimitedPositionTracking {
            max_speed: FineSpeedLimit(fields.count(&f::FINE_MAX_SPEED)?),
            angle: angle(fields)?,
        },
        Request::IncrementalPosition { .. } => {
            Request::IncrementalPosition { max_speed: max_speed(fields)?, angle: angle(fields)? }
        }
        Request::SetCommunicationTimeout { .. } => {
            Request::SetCommunicationTimeout { timeout: Milliseconds(fields.count(&f::TIMEOUT)?) }
        }
        Request::SetBaudRate { .. } => Request::SetBaudRate { code: BaudCode(fields.count(&f::BAUD_CODE)?) },
        Request::Function { function } => Request::Function { function: switched(function, fields)? },
        Request::SetCanId { .. } => Request::SetCanId { id: fields.count(&f::ID)? },
        Request::SetRs485Id { .. } => Request::SetRs485Id { id: fields.count(&f::ID)? },
        Request::MotionMode { .. } => Request::MotionMode { command: ranges.command(&target(fields)?)? },
        bare!() | Request::ReadCanId | Request::ReadRs485Id | Request::Unknown { .. } => blank,
    })
}

fn switched(function: Function, fields: &Fields<'_>) -> Result<Function, BuildError> {
    Ok(match function {
        Function::CanIdFilter { .. } => Function::CanIdFilter { enabled: fields.boolean(&f::ENABLED)? },
        Function::ErrorReporting { .. } => Function::ErrorReporting { enabled: fields.boolean(&f::ENABLED)? },
        Function::MultiTurnSaving { .. } => {
            Function::MultiTurnSaving { enabled: fields.boolean(&f::ENABLED)? }
        }
        Function::ClearMultiTurn | Function::Other { .. } => function,
    })
}

fn gains(fields: &Fields<'_>) -> Result<PidGains, BuildError> {
    Ok(PidGains {
        current_kp: fields.count(&f::CURRENT_KP)?,
        current_ki: fields.count(&f::CURRENT_KI)?,
        speed_kp: fields.count(&f::SPEED_KP)?,
        speed_ki: fields.count(&f::SPEED_KI)?,
        position_kp: fields.count(&f::POSITION_KP)?,
        position_ki: fields.count(&f::POSITION_KI)?,
    })
}

fn angle(fields: &Fields<'_>) -> Result<Centidegrees, BuildError> {
    Ok(Centidegrees(fields.count(&f::ANGLE)?))
}

fn max_speed(fields: &Fields<'_>) -> Result<SpeedLimit, BuildError> {
    Ok(SpeedLimit(fields.count(&f::MAX_SPEED)?))
}

/// Not checked against the table's ranges, which are the manual's: the caller's ranges decide.
fn target(fields: &Fields<'_>) -> Result<MotionTarget, BuildError> {
    Ok(MotionTarget {
        position_rad: fields.any(&f::POSITION)?,
        velocity_rad_s: fields.any(&f::VELOCITY)?,
        kp: fields.any(&f::KP)?,
        kd: fields.any(&f::KD)?,
        torque_nm: fields.any(&f::TORQUE)?,
    })
}
