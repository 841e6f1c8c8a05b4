//! How commands show registers and what these hold.

use codec::{BuildError, FieldInfo, FieldKind, Fields, Visit};

use crate::faults::Faults;
use crate::payload::{Value, Width};
use crate::register::{Coding, Register, RegisterInfo};

/// Address of a register.
const REGISTER: FieldInfo = FieldInfo::integer("register", "", 0, u8::MAX as i64);
const REGISTER_NAME: FieldInfo = FieldInfo::other(FieldKind::Text, "register_name");
/// How many bytes are read.
const BYTES: FieldInfo = FieldInfo::integer("bytes", "", 1, 2);
/// What is written, in the unit of the register; also goes by the name of the register's own field.
/// In replies: raw data to which the table of registers gives no other name.
const VALUE: FieldInfo = FieldInfo::integer("value", "", i16::MIN as i64, u16::MAX as i64);

/// What is to be read.
pub(crate) struct ReadFields;

impl ReadFields {
    pub(crate) const FIELDS: &[FieldInfo] = &[REGISTER, BYTES];

    pub(crate) fn build(fields: &Fields<'_>) -> Result<(Register, Width), BuildError> {
        let register = Register(fields.count(&REGISTER)?);
        let width = match (fields.count::<u8>(&BYTES), register.info()) {
            (Ok(1), _) => Width::Byte,
            (Ok(_), _) => Width::Word,
            (Err(BuildError::MissingField { .. }), Some(info)) => info.width,
            (Err(error), _) => return Err(error),
        };
        Ok((register, width))
    }

    pub(crate) fn visit(visit: &mut Visit<'_>, register: Register, width: Width) {
        visit_register(visit, register);
        let bytes = match width {
            Width::Byte => 1,
            Width::Word => 2,
        };
        BYTES.visit_integer(visit, bytes);
    }
}

/// What was read.
pub(crate) struct ReadValue;

impl ReadValue {
    pub(crate) const SHOWN: &[FieldInfo] = WrittenValue::SHOWN;

    pub(crate) fn visit(visit: &mut Visit<'_>, register: Register, value: Value) {
        visit_register(visit, register);
        register.visit_value(visit, value);
    }
}

/// What is written.
pub(crate) struct WrittenValue;

impl WrittenValue {
    pub(crate) const FIELDS: &[FieldInfo] = &[REGISTER, VALUE];
    pub(crate) const SHOWN: &[FieldInfo] = &[REGISTER, REGISTER_NAME, VALUE];

    pub(crate) fn build(fields: &Fields<'_>) -> Result<(Register, Value), BuildError> {
        let register = Register(fields.count(&REGISTER)?);
        let Some(info) = register.info() else {
            // No register without a function is written; the codec says so of whatever value.
            register.check_write(Value::Byte(0))?;
            return Err(BuildError::UnknownCommand);
        };
        let own = info.field_info();
        let value: i64 = match fields.count(&own) {
            Err(BuildError::MissingField { .. }) => {
                fields.count(&FieldInfo { name: VALUE.name, ..own })?
            }
            given => given?,
        };
        let value = info.encode(value)?;
        // What goes to the next register as well is given under that one's own name (D5 manual,
        // table row 7, frame format).
        let next =
            register.written_with().map(|next| (next, fields.count::<i64>(&next.field_info())));
        match (value, next) {
            (Value::Byte(low), Some((next, Ok(high)))) => {
                let Value::Byte(high) = next.encode(high)? else { return Ok((register, value)) };
                Ok((register, Value::Word(u16::from_le_bytes([low, high]))))
            }
            (_, Some((_, Err(error)))) if !matches!(error, BuildError::MissingField { .. }) => {
                Err(error)
            }
            _ => Ok((register, value)),
        }
    }

    pub(crate) fn visit(visit: &mut Visit<'_>, register: Register, value: Value) {
        match (register.info(), value) {
            // The id is one byte, but is written as a word.
            (Some(info), Value::Word(id)) if register == Register::ID => {
                visit_register(visit, register);
                info.field_info().visit_integer(visit, id);
            }
            _ => ReadValue::visit(visit, register, value),
        }
    }
}

fn visit_register(visit: &mut Visit<'_>, register: Register) {
    REGISTER.visit_integer(visit, register.0);
    REGISTER_NAME.visit_name(visit, register.info().map(|info| info.name));
}

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
            counts_per_unit: 1.0,
        }
    }
}

impl Register {
    /// Hands on a value as the field of this register; two bytes as those of this register and the
    /// next, where both have one; anything else raw.
    pub(crate) fn visit_value(self, visit: &mut Visit<'_>, value: Value) {
        let byte_register =
            |register: Register| register.info().filter(|info| info.width == Width::Byte);
        if let Some(info) = self.info()
            && let Some(number) = info.decode(value)
        {
            return visit_number(visit, info, number);
        }
        if let (Value::Word(word), Some(next)) = (value, self.0.checked_add(1))
            && let (Some(first), Some(second)) =
                (byte_register(self), byte_register(Register(next)))
        {
            for (info, byte) in [first, second].into_iter().zip(word.to_le_bytes()) {
                if let Some(number) = info.decode(Value::Byte(byte)) {
                    visit_number(visit, info, number);
                }
            }
            return;
        }
        match value {
            Value::Byte(raw) => VALUE.visit_integer(visit, raw),
            Value::Word(raw) => VALUE.visit_integer(visit, raw),
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
