//! Field values on their way to a reader.

use super::FieldInfo;

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
pub(crate) type Visit<'v> = dyn FnMut(&'static str, FieldValue<'_>) + 'v;

impl FieldInfo {
    /// Hands on a quantity that the wire counts.
    pub(crate) fn visit_count(&self, visit: &mut Visit<'_>, count: impl Into<i64>) {
        visit(self.name, FieldValue::Physical(count.into() as f64 / self.counts_per_unit));
    }

    pub(crate) fn visit_integer(&self, visit: &mut Visit<'_>, value: impl Into<i64>) {
        visit(self.name, FieldValue::Integer(value.into()));
    }

    pub(crate) fn visit_bool(&self, visit: &mut Visit<'_>, value: bool) {
        visit(self.name, FieldValue::Bool(value));
    }

    pub(crate) fn visit_flags(
        &self,
        visit: &mut Visit<'_>,
        raw: impl Into<u32>,
        names: fn(u32, &mut dyn FnMut(&'static str)),
    ) {
        visit(self.name, FieldValue::Flags { raw: raw.into(), names });
    }

    pub(crate) fn visit_bytes(&self, visit: &mut Visit<'_>, bytes: &[u8]) {
        visit(self.name, FieldValue::Bytes(bytes));
    }
}

/// The count nearest to a value, halves away from zero. What no count can express becomes the nearest `i64`, NaN 0:
/// callers check ranges before.
#[expect(clippy::cast_possible_truncation, reason = "the fraction is what is to be cut off; `as` saturates")]
pub(crate) fn count(value: f64) -> i64 {
    let whole = value as i64;
    let rest = value - whole as f64;
    if rest >= 0.5 {
        whole.saturating_add(1)
    } else if rest <= -0.5 {
        whole.saturating_sub(1)
    } else {
        whole
    }
}
