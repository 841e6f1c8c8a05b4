//! `mgw motor`

use crate::args::{MotorArgs, MotorSetting, MotorTarget, Zero};
use crate::failure::Failure;
use crate::motor::{self, Asked, Group, on_motor};
use crate::session::Session;

/// Shows or changes a setting of a motor.
pub fn run(session: &mut Session, arguments: &MotorArgs) -> Result<(), Failure> {
    let MotorArgs { yes, setting, .. } = arguments;
    let target = session.motor(&arguments.target)?;
    if let MotorSetting::Restore { file, with_id, with_bitrate } = setting {
        return motor::restore(session, target, *yes, file, (*with_id, *with_bitrate));
    }
    if let MotorSetting::Id { id } = setting {
        return set_id(session, target, *yes, *id).map(drop);
    }
    on_motor(session, target, *yes, asked(setting), |run| match setting {
        // These are done above.
        MotorSetting::Id { .. } | MotorSetting::Restore { .. } => Ok(()),
        MotorSetting::Bitrate { bitrate } => motor::bitrate(run, *bitrate),
        MotorSetting::Zero { at: Some(Zero::Here) } => motor::zero_here(run),
        MotorSetting::Zero { at: None } => motor::zero(run),
        MotorSetting::Zero { at: Some(Zero::Pulses(pulses)) } => {
            motor::change_to(run, "zero", Group::Zero, Some((*pulses).into()))
        }
        MotorSetting::Pid { values, ram } => {
            motor::change_by_text(run, "pid", Group::Pid, values, !ram)
        }
        MotorSetting::Acceleration { values } => {
            motor::change_by_text(run, "acceleration", Group::Acceleration, values, true)
        }
        MotorSetting::Timeout { timeout_ms } => motor::timeout(run, *timeout_ms),
        MotorSetting::Limits { values } => {
            motor::change_by_text(run, "limits", Group::Limits, values, true)
        }
        MotorSetting::Brake { action } => motor::brake(run, *action),
        MotorSetting::Reset => motor::reset(run),
        MotorSetting::ClearFaults => motor::clear_faults(run),
        MotorSetting::AckLevel { level } => {
            motor::change_to(run, "ack_level", Group::AckLevel, level.map(i64::from))
        }
        MotorSetting::ReplyDelay { raw } => {
            motor::change_to(run, "reply_delay", Group::ReplyDelay, raw.map(i64::from))
        }
        MotorSetting::Function { function, state } => motor::function(run, *function, *state),
        MotorSetting::Returns { flags, frames } => motor::returns(run, *flags, *frames),
        MotorSetting::Stream { frames, interval_ms } => motor::stream(run, *frames, *interval_ms),
        MotorSetting::Reports { mode } => motor::reports(run, *mode),
        MotorSetting::Dump { output, force } => motor::dump(run, output.as_deref(), *force),
        MotorSetting::Diff { file } => motor::diff(run, file),
    })
}

/// Shows the id of a motor or changes it, and returns that which the motor has shown.
pub fn set_id(
    session: &mut Session,
    target: MotorTarget,
    yes: bool,
    id: Option<u8>,
) -> Result<u8, Failure> {
    let asked = if id.is_some() { Asked::WriteId } else { Asked::Read };
    let mut shown = 0;
    on_motor(session, target, yes, asked, |run| {
        shown = motor::id(run, id)?;
        Ok(())
    })?;
    Ok(shown)
}

/// What a setting asks of the motor.
fn asked(setting: &MotorSetting) -> Asked {
    match setting {
        MotorSetting::Id { id: None }
        | MotorSetting::Bitrate { bitrate: None }
        | MotorSetting::Zero { at: None }
        | MotorSetting::Timeout { timeout_ms: None }
        | MotorSetting::Brake { action: None }
        | MotorSetting::AckLevel { level: None }
        | MotorSetting::ReplyDelay { raw: None }
        | MotorSetting::Dump { .. }
        | MotorSetting::Diff { .. } => Asked::Read,
        MotorSetting::Pid { values, .. }
        | MotorSetting::Acceleration { values }
        | MotorSetting::Limits { values }
            if values.is_empty() =>
        {
            Asked::Read
        }
        MotorSetting::Id { .. } => Asked::WriteId,
        MotorSetting::AckLevel { .. } => Asked::WriteAckLevel,
        _ => Asked::Write,
    }
}
