//! Field values on their way to a reader.

use crate::field::FieldInfo;

/// A field's value as a tool prints it.
#[derive(Debug, Clone, Copy)]
pub enum FieldValue<'a> {
    /// A whole number.
    Integer(i64),
    /// A quantity in the unit of the field's name.
    Physical(f64),
    /// False or true.
    Bool(bool),
    /// A bit mask.
    Flags {
        /// The whole word, unnamed bits included.
        raw: u32,
        /// Hands on the name of every named bit that is set in the word, lowest bit first.
        names: fn(u32, &mut dyn FnMut(&'static str)),
    },
    /// A name or printable characters.
    Text(&'a str),
    /// Bytes without further meaning.
    Bytes(&'a [u8]),
}

/// Takes field names with their values.
pub type Visit<'v> = dyn FnMut(&'static str, FieldValue<'_>) + 'v;

impl FieldInfo {
    /// Hands on a quantity that the wire counts.
    pub fn visit_count(&self, visit: &mut Visit<'_>, count: impl Into<i64>) {
        visit(self.name, FieldValue::Physical(count.into() as f64 / self.counts_per_unit));
    }

    /// Hands on a quantity in its unit.
    pub fn visit_physical(&self, visit: &mut Visit<'_>, value: f64) {
        visit(self.name, FieldValue::Physical(value));
    }

    /// Hands on a whole number.
    pub fn visit_integer(&self, visit: &mut Visit<'_>, value: impl Into<i64>) {
        visit(self.name, FieldValue::Integer(value.into()));
    }

    /// Hands on false or true.
    pub fn visit_bool(&self, visit: &mut Visit<'_>, value: bool) {
        visit(self.name, FieldValue::Bool(value));
    }

    /// Hands on a bit mask and what names its bits.
    pub fn visit_flags(
        &self,
        visit: &mut Visit<'_>,
        raw: impl Into<u32>,
        names: fn(u32, &mut dyn FnMut(&'static str)),
    ) {
        visit(self.name, FieldValue::Flags { raw: raw.into(), names });
    }

    /// Hands on a name, if there is one.
    pub fn visit_name(&self, visit: &mut Visit<'_>, text: Option<&str>) {
        if let Some(text) = text {
            visit(self.name, FieldValue::Text(text));
        }
    }

    /// Hands on bytes as they are.
    pub fn visit_bytes(&self, visit: &mut Visit<'_>, bytes: &[u8]) {
        visit(self.name, FieldValue::Bytes(bytes));
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::String;
    use std::{format, vec, vec::Vec};

    use super::*;
    use crate::field::FieldKind;

    /// Every visit as `name kind value`.
    fn shown(visit_fields: impl Fn(&mut Visit<'_>)) -> Vec<String> {
        let mut lines = vec![];
        visit_fields(&mut |name, value| {
            lines.push(match value {
                FieldValue::Flags { raw, names } => {
                    let mut line = format!("{name} {raw:#x}");
                    names(raw, &mut |name| line = format!("{line} {name}"));
                    line
                }
                value => format!("{name} {value:?}"),
            });
        });
        lines
    }

    #[test]
    fn each_kind_is_handed_on_under_the_name_of_its_field() {
        let voltage = FieldInfo::physical("voltage_v", "V", (0, 65_535), 10.0);
        let faults = FieldInfo::other(FieldKind::Flags, "faults");
        let named = |raw: u32, name: &mut dyn FnMut(&'static str)| {
            if raw & 2 != 0 {
                name("stall");
            }
        };
        let lines = shown(|visit| {
            voltage.visit_count(visit, 485_u16);
            voltage.visit_physical(visit, -0.5);
            FieldInfo::integer("id", "", 1, 32).visit_integer(visit, 7_u8);
            FieldInfo::boolean("enabled").visit_bool(visit, true);
            faults.visit_flags(visit, 0x8002_u16, named);
            FieldInfo::other(FieldKind::Text, "model").visit_name(visit, Some("X8S2"));
            FieldInfo::other(FieldKind::Bytes, "data").visit_bytes(visit, &[0x90, 1]);
        });
        let expected = [
            "voltage_v Physical(48.5)",
            "voltage_v Physical(-0.5)",
            "id Integer(7)",
            "enabled Bool(true)",
            "faults 0x8002 stall",
            "model Text(\"X8S2\")",
            "data Bytes([144, 1])",
        ];
        assert_eq!(lines, expected);
    }

    #[test]
    fn a_missing_name_is_not_handed_on() {
        let lines =
            shown(|visit| FieldInfo::other(FieldKind::Text, "mode_name").visit_name(visit, None));
        assert!(lines.is_empty());
    }
}
