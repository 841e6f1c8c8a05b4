//! Every field of a frame: its name, unit, range and counts per unit. Those of registers are in their own table.

use codec::{FieldInfo, FieldKind};

use crate::register::{Coding, RegisterInfo};

const BYTE: (i64, i64) = (0, u8::MAX as i64);
const ONES: f64 = 1.0;
/// Highest magnetic angle in degrees (D5 manual, table row 14).
const FULL_TURN: i64 = 360;

/// Address of a register.
pub(crate) const REGISTER: FieldInfo = FieldInfo::integer("register", "", BYTE.0, BYTE.1);
pub(crate) const REGISTER_NAME: FieldInfo = FieldInfo::other(FieldKind::Text, "register_name");
/// How many bytes are read.
pub(crate) const BYTES: FieldInfo = FieldInfo::integer("bytes", "", 1, 2);
/// What is written, in the unit of the register; also goes by the name of the register's own field. In replies: raw data
/// to which the table of registers gives no other name.
pub(crate) const VALUE: FieldInfo = FieldInfo::integer("value", "", i16::MIN as i64, u16::MAX as i64);
pub(crate) const ANGLE: FieldInfo = FieldInfo::physical("angle_deg", "deg", (0, FULL_TURN), ONES);
/// In an error reply: what the motor finds wrong.
pub(crate) const MOTOR_ERROR: FieldInfo = FieldInfo::other(FieldKind::Text, "motor_error");
/// In an error reply: the command it names.
pub(crate) const COMMAND_CODE: FieldInfo = FieldInfo::integer("command_code", "", BYTE.0, BYTE.1);
/// Bytes of unknown meaning.
pub(crate) const DATA: FieldInfo = FieldInfo::other(FieldKind::Bytes, "data");

pub(crate) const READ: &[FieldInfo] = &[REGISTER, BYTES];
pub(crate) const WRITE: &[FieldInfo] = &[REGISTER, VALUE];
pub(crate) const REGISTER_VALUE: &[FieldInfo] = &[REGISTER, REGISTER_NAME, VALUE];

impl RegisterInfo {
    /// The register's value as a field.
    pub const fn field_info(&self) -> FieldInfo {
        let (min, max) = self.value_range();
        let kind = match self.coding {
            Coding::Faults => FieldKind::Flags,
            _ if self.unit.is_empty() => FieldKind::Integer,
            _ => FieldKind::Physical,
        };
        FieldInfo {
            name: self.field,
            unit: self.unit,
            kind,
            min: min as f64,
            max: max as f64,
            counts_per_unit: ONES,
        }
    }
}
