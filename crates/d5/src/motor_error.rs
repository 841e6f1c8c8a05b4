//! What a motor finds wrong with a request.

use codec::{Encode, FieldInfo, FieldKind, Visit};

use crate::field::{ERROR_CHECKSUM, ERROR_COMMAND, ERROR_ID, ERROR_MARK, TWO_DATA_BYTES};
use crate::payload::Payload;

/// What a motor finds wrong with a request (D5 manual, table rows 3 to 5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MotorError {
    /// The request was for another id.
    Id,
    /// The motor does not know the command.
    Command,
    /// The checksum of the request was wrong.
    Checksum,
}

impl MotorError {
    /// Its name in listings.
    pub const fn name(self) -> &'static str {
        match self {
            MotorError::Id => "id",
            MotorError::Command => "command",
            MotorError::Checksum => "checksum",
        }
    }

    fn address(self) -> u8 {
        match self {
            MotorError::Id => ERROR_ID,
            MotorError::Command => ERROR_COMMAND,
            MotorError::Checksum => ERROR_CHECKSUM,
        }
    }

    /// The error of an error reply. It can carry any command.
    pub(crate) fn of(payload: &Payload) -> Option<MotorError> {
        let Payload([TWO_DATA_BYTES, _, address, ERROR_MARK, ERROR_MARK]) = *payload else {
            return None;
        };
        [MotorError::Id, MotorError::Command, MotorError::Checksum]
            .into_iter()
            .find(|error| error.address() == address)
    }
}

/// In the byte of the address, and marks in the data bytes.
impl Encode<Payload> for MotorError {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        let Payload([_, _, address, low, high]) = data;
        (*address, *low, *high) = (self.address(), ERROR_MARK, ERROR_MARK);
    }
}

/// How an error reply is shown: what the motor finds wrong, and the command it names.
pub(crate) struct ErrorFields;

const MOTOR_ERROR: FieldInfo = FieldInfo::other(FieldKind::Text, "motor_error");
const COMMAND_CODE: FieldInfo = FieldInfo::integer("command_code", "", 0, u8::MAX as i64);

impl ErrorFields {
    pub(crate) const SHOWN: &[FieldInfo] = &[MOTOR_ERROR, COMMAND_CODE];

    pub(crate) fn visit(visit: &mut Visit<'_>, error: MotorError, command: u8) {
        MOTOR_ERROR.visit_name(visit, Some(error.name()));
        COMMAND_CODE.visit_integer(visit, command);
    }
}
