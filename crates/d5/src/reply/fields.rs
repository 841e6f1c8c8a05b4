//! A reply by name, field by field.

use codec::{CommandInfo, FieldKind, UNKNOWN, Visit};

use super::{MotorError, Reply};
use crate::faults::Faults;
use crate::payload::{Value, Width};
use crate::register::{Register, RegisterInfo};
use crate::request::{visit_register, visit_written};
use crate::table::{self, COMMANDS, field as f};

impl Reply {
    /// The command in [`COMMANDS`](crate::COMMANDS), of an error the one it names; `None` for what the manual does not
    /// list.
    pub fn info(&self) -> Option<&'static CommandInfo> {
        Some(match self {
            Reply::Id => &table::QUERY_ID,
            Reply::Read { .. } => &table::READ,
            Reply::Written { .. } => &table::WRITE,
            Reply::AsyncWritten { .. } => &table::ASYNC_WRITE,
            Reply::Executed { .. } => &table::EXECUTE,
            Reply::ResetDone => &table::RESET,
            Reply::MagneticAngle { .. } => &table::READ_MAGNETIC_ANGLE,
            Reply::SelfTest { .. } => &table::SELF_TEST,
            Reply::Error { command, .. } => {
                return COMMANDS.iter().find(|info| info.code == u16::from(*command));
            }
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

    /// Hands on every field in the order of [`CommandInfo::reply`]: a register with its name, where it has one, and its
    /// value as the register's own field; of an error what is wrong and the command that the motor names.
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        match self {
            Reply::Id | Reply::ResetDone => {}
            Reply::Read { register, value } => {
                visit_register(visit, *register);
                register.visit_value(visit, *value);
            }
            Reply::Written { register, value }
            | Reply::AsyncWritten { register, value }
            | Reply::Executed { register, value } => visit_written(visit, *register, *value),
            Reply::MagneticAngle { angle } => f::ANGLE.visit_count(visit, angle.0),
            Reply::Error { error, command } => {
                f::MOTOR_ERROR.visit_name(visit, Some(error.name()));
                f::COMMAND_CODE.visit_integer(visit, *command);
            }
            Reply::SelfTest { raw } | Reply::Unknown { raw } => f::DATA.visit_bytes(visit, &raw.0),
        }
    }
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
}

impl Register {
    /// Hands on a value as the field of this register; two bytes as those of this register and the next, where both
    /// have one; anything else raw.
    pub(crate) fn visit_value(self, visit: &mut Visit<'_>, value: Value) {
        let byte_register = |register: Register| register.info().filter(|info| info.width == Width::Byte);
        if let Some(info) = self.info()
            && let Some(number) = info.decode(value)
        {
            return visit_number(visit, info, number);
        }
        if let (Value::Word(word), Some(next)) = (value, self.0.checked_add(1))
            && let (Some(first), Some(second)) = (byte_register(self), byte_register(Register(next)))
        {
            for (info, byte) in [first, second].into_iter().zip(word.to_le_bytes()) {
                if let Some(number) = info.decode(Value::Byte(byte)) {
                    visit_number(visit, info, number);
                }
            }
            return;
        }
        match value {
            Value::Byte(raw) => f::VALUE.visit_integer(visit, raw),
            Value::Word(raw) => f::VALUE.visit_integer(visit, raw),
        }
    }
}

fn visit_number(visit: &mut Visit<'_>, info: &RegisterInfo, number: i64) {
    let field = info.field_info();
    match field.kind {
        FieldKind::Physical => field.visit_count(visit, number),
        FieldKind::Flags => {
            // A byte, so the fallback is never used.
            field.visit_flags(visit, u32::try_from(number).unwrap_or(0), Faults::visit_names);
        }
        _ => field.visit_integer(visit, number),
    }
}
