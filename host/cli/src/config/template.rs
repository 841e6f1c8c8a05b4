//! A configuration in the words of a file that somebody wrote: its comments, its order, its way to
//! write numbers. Only what differs is written anew.

use host_protocol::Subject;
use toml::de::DeValue;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TomlError};

use super::file::{read_value, row_number};
use super::{Configuration, DEFAULT_REPLY_WINDOW_US, Entry, dump};
use crate::config::BusKey;
use crate::names::Names;

/// The sections that come once for each bus and each axis, with the key of their number.
const ROWS: [&str; 2] = ["bus", "axis"];

/// The text of a template with the values of a configuration.
///
/// # Errors
/// The template is no TOML.
pub fn dump_like(template: &str, configuration: &Configuration) -> Result<String, TomlError> {
    let mut document: DocumentMut = template.parse()?;
    let wanted: DocumentMut = dump(configuration).parse()?;
    let names = Names::from(configuration);
    if let Some(from) = wanted.get("gateway").and_then(Item::as_table) {
        let is_new = document.get("gateway").is_none();
        let section = document.entry("gateway").or_insert(Item::Table(Table::new()));
        if let Some(to) = written_out(section, Item::into_table, Item::Table).as_table_mut() {
            carry_over(Subject::Gateway, from, to, &names);
            if is_new && to.is_empty() {
                document.remove("gateway");
            }
        }
    }
    for kind in ROWS {
        let none = ArrayOfTables::new();
        let from = wanted.get(kind).and_then(Item::as_array_of_tables).unwrap_or(&none);
        let section = document.entry(kind).or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
        let section = written_out(section, Item::into_array_of_tables, Item::ArrayOfTables);
        if let Some(to) = section.as_array_of_tables_mut() {
            rows(kind, from, to, &names);
        }
    }
    Ok(document.to_string())
}

/// A section that stands within one line, `axis = [{ axis = 0 }]`, as one of lines of its own.
fn written_out<T>(
    section: &mut Item,
    read: fn(Item) -> Result<T, Item>,
    section_of: fn(T) -> Item,
) -> &mut Item {
    *section = read(std::mem::take(section)).map_or_else(|item| item, section_of);
    section
}

/// Carries the rows of one kind over, those that the template has not behind the others.
fn rows(kind: &str, from: &ArrayOfTables, to: &mut ArrayOfTables, names: &Names) {
    let number = |table: &Table| {
        let number = table.get(kind)?;
        read(number, |value| row_number(kind, value, names).ok())
    };
    to.retain(|table| from.iter().any(|wanted| number(wanted) == number(table)));
    for wanted in from {
        let place = to.iter().position(|table| number(table) == number(wanted));
        let row = number(wanted).unwrap_or(u8::MAX);
        let row = if kind == "bus" { Subject::Bus(row) } else { Subject::Axis(row) };
        match place.and_then(|place| to.get_mut(place)) {
            Some(table) => carry_over(row, wanted, table, names),
            None => {
                let mut table = wanted.clone();
                // Behind what is there, wherever it stood in the dump.
                table.set_position(None);
                table.retain(|key, item| !is_default(row, key, item, names));
                to.push(table);
            }
        }
    }
}

/// Gives a section the keys and values of another one. A value that means the same stays as it is
/// written.
fn carry_over(row: Subject, from: &Table, to: &mut Table, names: &Names) {
    let meaning = |key: &str, item: &Item| meaning(row, key, item, names);
    to.retain(|key, _| from.contains_key(key));
    for (key, wanted) in from {
        match to.get_mut(key) {
            Some(item) if meaning(key, item) == meaning(key, wanted) => {}
            Some(item) => {
                if let (Some(value), Some(new)) = (item.as_value_mut(), wanted.as_value()) {
                    let decor = value.decor().clone();
                    *value = new.clone();
                    *value.decor_mut() = decor;
                }
            }
            None if is_default(row, key, wanted, names) => {}
            None => {
                to.insert(key, wanted.clone());
            }
        }
    }
}

/// What a key with this value says, where it says something.
fn meaning(row: Subject, key: &str, item: &Item, names: &Names) -> Option<Entry> {
    read(item, |value| read_value(row, key, value, names).ok())
}

/// What is read of a value.
fn read<T>(item: &Item, read: impl FnOnce(&DeValue<'_>) -> Option<T>) -> Option<T> {
    let text = item.as_value()?.clone().decorated("", "").to_string();
    read(DeValue::parse(&text).ok()?.get_ref())
}

/// Whether a key could be left out.
fn is_default(row: Subject, key: &str, item: &Item, names: &Names) -> bool {
    match meaning(row, key, item, names) {
        Some(Entry::Gateway(parameter, value)) => parameter.info().default == Some(value),
        Some(Entry::Bus(_, BusKey::Exclusive(exclusive))) => !exclusive,
        Some(Entry::Bus(_, BusKey::ReplyWindow(us))) => us == DEFAULT_REPLY_WINDOW_US,
        Some(Entry::Incomplete(_, incomplete)) => !incomplete,
        _ => false,
    }
}
