//! What must hold of every table of commands, and requests made from its rows.

use codec::{CommandInfo, FieldKind, FieldValue, Visit};
use std::collections::{BTreeMap, BTreeSet};

/// Checks that the names of commands are unique, and that all names are in snake_case.
pub fn check_names(commands: &[CommandInfo]) {
    let names: BTreeSet<_> = commands.iter().map(|info| info.name).collect();
    assert_eq!(names.len(), commands.len(), "a name stands twice");
    let fields = commands.iter().flat_map(|info| info.request.iter().chain(info.reply));
    for name in names.into_iter().chain(fields.map(|field| field.name)) {
        let is_snake = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'_');
        assert!(name.bytes().all(is_snake), "{name}");
    }
}

/// A value for each field of a command's request: `picks` of 0 and `u16::MAX` are the ends of its
/// range, others lie between.
pub fn fields_in_range<'a>(
    info: &'a CommandInfo,
    picks: &'a [u16],
) -> impl Fn(&str) -> Option<f64> + 'a {
    |name| {
        let (field, pick) =
            info.request.iter().zip(picks.iter().cycle()).find(|(field, _)| field.name == name)?;
        let value = field.min + f64::from(*pick) / f64::from(u16::MAX) * (field.max - field.min);
        Some(if field.kind == FieldKind::Physical { value } else { value.round() })
    }
}

/// The numbers among the fields that a message shows, by name: of a request those that build it
/// again. The flags that are set are asked for their names, too.
pub fn numbers_of(visit_fields: impl FnOnce(&mut Visit<'_>)) -> BTreeMap<&'static str, f64> {
    let mut numbers = BTreeMap::new();
    visit_fields(&mut |name, value| {
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
