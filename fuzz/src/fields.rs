//! The fields that a codec shows of a request, on their way back into a request.

/// A macro, because each codec has a `FieldValue` of its own.
macro_rules! shown_fields {
    ($codec:ident, $request:expr) => {{
        let mut numbers = std::collections::BTreeMap::new();
        $request.visit_fields(&mut |name, value| {
            let number = match value {
                $codec::FieldValue::Integer(value) => value as f64,
                $codec::FieldValue::Physical(value) => value,
                $codec::FieldValue::Bool(value) => f64::from(u8::from(value)),
                $codec::FieldValue::Flags { raw, names } => {
                    names(raw, &mut |_| ());
                    f64::from(raw)
                }
                $codec::FieldValue::Text(_) | $codec::FieldValue::Bytes(_) => return,
            };
            numbers.insert(name, number);
        });
        numbers
    }};
}

pub(crate) use shown_fields;
