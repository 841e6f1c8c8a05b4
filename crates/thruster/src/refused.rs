//! A reply that refuses a set command: `00 00 EE EE` (Thruster manual §1.3).

use codec::{CommandInfo, FieldInfo, Shown, Visit, check_range};

use crate::command::{self, WITH_PARAMETER};
use crate::error::{DecodeError, EncodeError};
use crate::field::POSITION_LIMITS;
use crate::payload::Payload;
use crate::table::{COMMANDS, SET_POSITION_LIMITS};
use crate::units::RpmLimit;

/// How a refusal is shown: `refused`, and what it repeats of the request.
pub(crate) struct Refusal;

impl Refusal {
    pub(crate) fn visit(visit: &mut Visit<'_>, command: u16, parameter: u16) {
        FieldInfo::boolean("refused").visit_bool(visit, true);
        match command {
            command::ABSOLUTE_POSITION | command::RELATIVE_POSITION => {
                RpmLimit(parameter).visit(&<RpmLimit as Shown>::INFO.named("speed_rpm"), visit);
            }
            command::SET_PARAMETER if parameter != POSITION_LIMITS => {
                parameter.visit(&<u16 as Shown>::INFO.named("parameter"), visit);
            }
            _ => {}
        }
    }
}

/// The row of the refused command.
pub(crate) fn info(command: u16, parameter: u16) -> Option<&'static CommandInfo> {
    match (command, parameter) {
        (command::SET_PARAMETER, POSITION_LIMITS) => Some(&SET_POSITION_LIMITS),
        _ => COMMANDS.iter().find(|info| info.code == command),
    }
}

/// The command and the parameter of a payload with the data of a refusal, if it refuses a set
/// command; never a query.
pub(crate) fn decode(payload: &Payload) -> Result<Option<(u16, u16)>, DecodeError> {
    let command = payload.command();
    if !command::sets(command) {
        return Ok(None);
    }
    if !WITH_PARAMETER.contains(&command) {
        payload.expect_no_parameter()?;
    }
    Ok(Some((command, payload.parameter())))
}

/// Refuses a refusal that no device sends.
pub(crate) fn check(command: u16, parameter: u16) -> Result<(), EncodeError> {
    if !command::sets(command) {
        let reason = "only a set command with a variant of its own can be refused";
        return Err(EncodeError::Forbidden { field: "command", value: i64::from(command), reason });
    }
    if !WITH_PARAMETER.contains(&command) {
        check_range("parameter", i64::from(parameter), 0, 0)?;
    }
    Ok(())
}

/// The error for data with which a device refuses; it names the field they come from.
pub(crate) const fn meant(field: &'static str, value: i64) -> EncodeError {
    EncodeError::Forbidden { field, value, reason: "its bytes 00 00 EE EE mean a refusal" }
}
