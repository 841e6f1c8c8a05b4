//! A system parameter and its four raw bytes.

use codec::{BuildError, FieldInfo, Fields, Visit};

/// How SP and RP show a parameter: its number, and its bytes as one big-endian number.
pub(crate) struct RawParameter;

const PARAMETER: FieldInfo = FieldInfo::integer("parameter", "", 0, u16::MAX as i64);
const VALUE: FieldInfo = FieldInfo::integer("value", "", 0, u32::MAX as i64);

impl RawParameter {
    pub(crate) const FIELDS: &[FieldInfo] = &[PARAMETER, VALUE];
    pub(crate) const SHOWN: &[FieldInfo] = RawParameter::FIELDS;

    pub(crate) fn build(fields: &Fields<'_>) -> Result<(u16, [u8; 4]), BuildError> {
        let (parameter, value) = (fields.count(&PARAMETER)?, fields.count::<u32>(&VALUE)?);
        Ok((parameter, value.to_be_bytes()))
    }

    pub(crate) fn visit(visit: &mut Visit<'_>, parameter: u16, data: [u8; 4]) {
        PARAMETER.visit_integer(visit, parameter);
        VALUE.visit_integer(visit, u32::from_be_bytes(data));
    }
}
