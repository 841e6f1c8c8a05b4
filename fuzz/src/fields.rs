//! The fields that a codec shows of a request, on their way back into a request.

use std::collections::BTreeMap;

use codec::FieldValue;

/// The numbers of a message that hands its fields to what `visit` is given.
pub(crate) fn shown_fields(
    visit: impl FnOnce(&mut codec::Visit<'_>),
) -> BTreeMap<&'static str, f64> {
    let mut numbers = BTreeMap::new();
    visit(&mut |name, value| {
        let number = match value {
            FieldValue::Integer(value) => value as f64,
            FieldValue::Physical(value) => value,
            FieldValue::Bool(value) => f64::from(u8::from(value)),
            FieldValue::Flags { raw, names } => {
                names(raw, &mut |_| ());
                f64::from(raw)
            }
            FieldValue::Text(_) | FieldValue::Bytes(_) => return,
        };
        numbers.insert(name, number);
    });
    numbers
}
