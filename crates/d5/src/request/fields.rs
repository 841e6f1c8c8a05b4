//! A request by name, field by field.

use codec::{CommandInfo, UNKNOWN, Visit};

use super::Request;
use crate::payload::{Value, Width};
use crate::register::Register;
use crate::table::{self, field as f};

impl Request {
    /// The command in [`COMMANDS`](crate::COMMANDS); `None` for what the manual does not list.
    pub const fn info(&self) -> Option<&'static CommandInfo> {
        Some(match self {
            Request::QueryId => &table::QUERY_ID,
            Request::Read { .. } => &table::READ,
            Request::Write { .. } => &table::WRITE,
            Request::AsyncWrite { .. } => &table::ASYNC_WRITE,
            Request::Execute => &table::EXECUTE,
            Request::Reset => &table::RESET,
            Request::ReadMagneticAngle => &table::READ_MAGNETIC_ANGLE,
            Request::SelfTest => &table::SELF_TEST,
            Request::FaultySelfTest => &table::FAULTY_SELF_TEST,
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

    /// Hands on every field in the order of [`CommandInfo::request`]: a register with its name, where it has one, and
    /// what is written as the register's own field.
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        match self {
            Request::Read { register, width } => {
                visit_register(visit, *register);
                let bytes = match width {
                    Width::Byte => 1,
                    Width::Word => 2,
                };
                f::BYTES.visit_integer(visit, bytes);
            }
            Request::Write { register, value } | Request::AsyncWrite { register, value } => {
                visit_written(visit, *register, *value);
            }
            Request::Unknown { raw } => f::DATA.visit_bytes(visit, &raw.0),
            Request::QueryId
            | Request::Execute
            | Request::Reset
            | Request::ReadMagneticAngle
            | Request::SelfTest
            | Request::FaultySelfTest => {}
        }
    }
}

pub(crate) fn visit_register(visit: &mut Visit<'_>, register: Register) {
    f::REGISTER.visit_integer(visit, register.0);
    f::REGISTER_NAME.visit_name(visit, register.info().map(|info| info.name));
}

/// A register and what was written to it.
pub(crate) fn visit_written(visit: &mut Visit<'_>, register: Register, value: Value) {
    visit_register(visit, register);
    match (register.info(), value) {
        // The id is one byte, but is written as a word.
        (Some(info), Value::Word(id)) if register == Register::ID => {
            info.field_info().visit_integer(visit, id);
        }
        _ => register.visit_value(visit, value),
    }
}
