//! Reads a file: each value in its range, and each slip with its line, key and what is allowed.

use std::fs;
use std::io::{self, Read};
use std::ops::Range;

use host_protocol::{AxisParameter, Named, Subject, Text, is_name};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{
    BUS_KEYS, Configuration, Entry, Finding, INCOMPLETE, MOTOR_TIMEOUT, NAME, NEW_BUS, entry,
    protocols,
};
use crate::args::Typed;
use crate::config::BusKey;
use crate::failure::Failure;
use crate::given::{begin, unread};
use crate::names::Names;
use crate::parameters;
use crate::printable::printable;

/// Bytes that a file may have: many times what every axis with every parameter takes.
const MAX_FILE: u64 = 256 * 1024;

/// The text of a file, and what the file is called.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    pub path: String,
    pub text: String,
}

/// A file that has been read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct File {
    /// What it is called in a failure.
    pub path: String,
    /// What it sets, each with its line.
    pub entries: Vec<(Entry, usize)>,
    /// The buses and axes that it names, each with its line.
    pub rows: Vec<(Subject, usize)>,
    /// What is wrong with it by itself.
    pub findings: Vec<Finding>,
}

impl Source {
    /// Reads a regular file, or standard input (`-`).
    pub fn read(given: &str) -> Result<Self, Failure> {
        let path = if given == "-" { "standard input" } else { given };
        let failed = |source| unread(path, source);
        let wrong = |what: &str| Failure::Usage(format!("{path}: {what}"));
        let bytes = if given == "-" {
            let mut bytes = Vec::new();
            io::stdin().lock().take(MAX_FILE + 1).read_to_end(&mut bytes).map_err(failed)?;
            bytes
        } else {
            // Before it is opened: opening a pipe waits for who writes into it.
            let metadata = fs::metadata(path).map_err(failed)?;
            if !metadata.is_file() {
                let kind = if metadata.is_dir() { "a directory" } else { "a pipe or a device" };
                let text = format!("it is {kind}; a configuration is a regular file, or `-`");
                return Err(wrong(&text));
            }
            begin(path.as_ref(), MAX_FILE + 1)?
        };
        if u64::try_from(bytes.len()).is_ok_and(|length| length > MAX_FILE) {
            let text = format!("it has more than {MAX_FILE} bytes, too many for a configuration");
            return Err(wrong(&text));
        }
        let text = String::from_utf8(bytes);
        let text = text.map_err(|error| wrong(&format!("it is no text: {error}")))?;
        Ok(Self { path: printable(path).into_owned(), text })
    }
}

impl File {
    /// What this makes of a configuration: of an empty one all that the file says and nothing else.
    pub fn onto(&self, mut base: Configuration) -> Configuration {
        for (row, _) in &self.rows {
            match *row {
                Subject::Bus(bus) => drop(base.buses.entry(bus).or_insert(NEW_BUS)),
                Subject::Axis(axis) => drop(base.axes.entry(axis).or_default()),
                Subject::Gateway => {}
            }
        }
        self.entries.iter().for_each(|(entry, _)| base.set(entry));
        base
    }

    /// The line of a key, or that of its row.
    pub fn line(&self, row: Subject, key: Option<&str>) -> Option<usize> {
        let is_key = |entry: &Entry| match (entry, row) {
            (Entry::Gateway(parameter, _), Subject::Gateway) => key == Some(parameter.text().name),
            (Entry::Bus(bus, of), Subject::Bus(index)) => {
                *bus == index && key == Some(BUS_KEYS[bus_key_place(*of)])
            }
            (Entry::Axis(axis, parameter, _), Subject::Axis(index)) => {
                *axis == index && key == Some(parameter.text().name)
            }
            (Entry::MotorTimeout(axis, _), Subject::Axis(index)) => {
                *axis == index && key == Some(MOTOR_TIMEOUT)
            }
            (Entry::Incomplete(axis, _), Subject::Axis(index)) => {
                *axis == index && key == Some(INCOMPLETE)
            }
            (Entry::Name(of, _), row) => *of == row && key == Some(NAME),
            _ => false,
        };
        let key_line = self.entries.iter().find(|(entry, _)| is_key(entry)).map(|(_, line)| *line);
        key_line.or_else(|| self.rows.iter().find(|(of, _)| *of == row).map(|(_, line)| *line))
    }

    /// Whether a row must have all that it needs: one that the file names, and does not call
    /// incomplete.
    pub fn must_be_whole(&self, row: Subject) -> bool {
        let incomplete = |(entry, _): &(Entry, usize)| matches!(*entry, Entry::Incomplete(axis, true) if row == Subject::Axis(axis));
        self.names(row) && !self.entries.iter().any(incomplete)
    }

    /// Whether it says something of a row.
    pub fn names(&self, row: Subject) -> bool {
        self.rows.iter().any(|(of, _)| *of == row)
    }

    /// Whether it sets the protocols of a bus.
    pub fn sets_protocols(&self, bus: u8) -> bool {
        let sets =
            |entry: &Entry| matches!(*entry, Entry::Bus(of, BusKey::Protocols(_)) if of == bus);
        self.entries.iter().any(|(entry, _)| sets(entry))
    }

    /// Whether a key is there with a value that it cannot have.
    pub fn has_slip(&self, row: Subject, key: &str) -> bool {
        self.findings
            .iter()
            .any(|finding| finding.row == Some(row) && finding.key.as_deref() == Some(key))
    }
}

fn bus_key_place(key: BusKey) -> usize {
    match key {
        BusKey::Bitrate(_) => 0,
        BusKey::Protocols(_) => 1,
        BusKey::Exclusive(_) => 2,
        BusKey::ReplyWindow(_) => 3,
    }
}

/// Reads the text of a file. It may name what it names itself, and what `base` has.
pub fn parse(source: &Source, base: &Configuration) -> File {
    let (table, errors) = DeTable::parse_recoverable(&source.text);
    let mut reader = Reader {
        text: &source.text,
        names: names_in(table.get_ref(), base),
        file: File { path: source.path.clone(), ..File::default() },
    };
    for error in errors {
        let at = error.span().unwrap_or(0..0);
        reader.finds(None, None, &at, error.message().to_owned());
    }
    for (name, value) in table.get_ref() {
        reader.section(name, value);
    }
    if reader.file.rows.is_empty() && reader.file.findings.is_empty() {
        // It may come from a command that has failed.
        reader.file.findings.push(Finding {
            line: None,
            row: None,
            key: None,
            name: "Usage",
            text: "it has no section, [gateway], [[bus]] or [[axis]]; `mgw config reset` removes \
                everything"
                .to_owned(),
        });
    }
    let mut file = reader.file;
    file.findings.sort_by_key(|finding| finding.line);
    file
}

/// The names of a configuration as a file makes them.
fn names_in(table: &DeTable<'_>, base: &Configuration) -> Names {
    let mut names = base.names.clone();
    for (kind, row) in [("bus", Subject::Bus as fn(u8) -> _), ("axis", Subject::Axis)] {
        let rows = table.get(kind).and_then(|rows| rows.get_ref().as_array());
        let rows = rows.into_iter().flat_map(|rows| rows.iter());
        for table in rows.filter_map(|row| row.get_ref().as_table()) {
            let value = |key| table.get(key).map(Spanned::get_ref);
            let number = value(kind).and_then(integer).and_then(|number| number.try_into().ok());
            let name = value(NAME).and_then(DeValue::as_str).filter(|name| is_name(name));
            if let (Some(number), Some(Ok(name))) = (number, name.map(Text::try_from)) {
                names.insert(row(number), name);
            }
        }
    }
    let named: Vec<Named> = names.into_iter().map(|(of, name)| Named { of, name }).collect();
    named.into()
}

/// The number of a row, or that of the row that has this name.
pub fn row_number(kind: &str, value: &DeValue<'_>, names: &Names) -> Result<u8, Failure> {
    match value.as_str().map(|name| Typed::Name(name.to_owned())) {
        Some(name) if kind == "bus" => names.find_bus(&name),
        Some(name) => names.find_axis(&name),
        None => integer(value)
            .and_then(|number| u8::try_from(number).ok())
            .ok_or_else(|| Failure::Usage(format!("{kind} takes a number from 0 on, or a name"))),
    }
}

/// Reads a file part by part.
struct Reader<'a> {
    text: &'a str,
    names: Names,
    file: File,
}

impl Reader<'_> {
    fn section(&mut self, name: &Spanned<std::borrow::Cow<'_, str>>, value: &Spanned<DeValue<'_>>) {
        let (kind, at) = (name.get_ref().as_ref(), name.span());
        match (kind, value.get_ref()) {
            ("gateway", DeValue::Table(table)) => {
                self.file.rows.push((Subject::Gateway, line_of(self.text, &at)));
                self.keys(Subject::Gateway, table);
            }
            ("bus" | "axis", DeValue::Array(tables)) => {
                for part in tables.iter() {
                    match part.get_ref() {
                        DeValue::Table(table) => self.row(kind, table, &part.span()),
                        _ => self.is_no_section(kind, &part.span()),
                    }
                }
            }
            ("gateway" | "bus" | "axis", _) => self.is_no_section(kind, &at),
            _ => {
                let text = format!("there is no `{kind}`. There are: [gateway], [[bus]], [[axis]]");
                self.finds(None, Some(kind), &at, text);
            }
        }
    }

    fn is_no_section(&mut self, kind: &str, at: &Range<usize>) {
        let heading = if kind == "gateway" { "[gateway]" } else { &format!("[[{kind}]]") };
        self.finds(None, Some(kind), at, format!("write it as a section: {heading}"));
    }

    /// A section of a bus or an axis.
    fn row(&mut self, kind: &str, table: &DeTable<'_>, at: &Range<usize>) {
        let number = table.iter().find(|(name, _)| name.get_ref() == kind);
        let Some((_, value)) = number else {
            let text = format!("{kind}: lacks its number: {kind} = 0");
            return self.finds(None, Some(kind), at, text);
        };
        let number = match row_number(kind, value.get_ref(), &self.names) {
            Ok(number) => number,
            Err(failure) => {
                return self.finds(None, Some(kind), &value.span(), failure.to_string());
            }
        };
        let row = if kind == "bus" { Subject::Bus(number) } else { Subject::Axis(number) };
        let line = line_of(self.text, &value.span());
        if let Some((_, other)) = self.file.rows.iter().find(|(other, _)| *other == row) {
            let text = format!("is there already, in line {other}");
            return self.finds(Some(row), Some(kind), &value.span(), text);
        }
        self.file.rows.push((row, line));
        self.keys(row, table);
    }

    fn keys(&mut self, row: Subject, table: &DeTable<'_>) {
        for (name, value) in table {
            let key = name.get_ref().as_ref();
            // Its own number.
            if matches!((row, key), (Subject::Bus(_), "bus") | (Subject::Axis(_), "axis")) {
                continue;
            }
            match read_value(row, key, value.get_ref(), &self.names) {
                Ok(entry) => self.file.entries.push((entry, line_of(self.text, &name.span()))),
                Err(failure) => {
                    let text = failure.to_string();
                    let text = if text.contains(key) { text } else { format!("{key}: {text}") };
                    self.finds_named(Some(row), Some(key), &name.span(), failure.name(), text);
                }
            }
        }
    }

    fn finds(&mut self, row: Option<Subject>, key: Option<&str>, at: &Range<usize>, text: String) {
        self.finds_named(row, key, at, "Usage", text);
    }

    fn finds_named(
        &mut self,
        row: Option<Subject>,
        key: Option<&str>,
        at: &Range<usize>,
        name: &'static str,
        text: String,
    ) {
        let line = Some(line_of(self.text, at));
        self.file.findings.push(Finding { line, row, key: key.map(str::to_owned), name, text });
    }
}

/// Reads the value of a key of a row.
pub fn read_value(
    row: Subject,
    key: &str,
    value: &DeValue<'_>,
    names: &Names,
) -> Result<Entry, Failure> {
    let wrong = |takes: &str| Failure::Usage(format!("{key} takes {takes}"));
    match (row, key, value) {
        (Subject::Axis(axis), MOTOR_TIMEOUT, value) => {
            let timeout_ms = integer(value).and_then(|number| u32::try_from(number).ok());
            let timeout_ms = timeout_ms.ok_or_else(|| wrong("a whole number from 0 on"))?;
            Ok(Entry::MotorTimeout(axis, timeout_ms))
        }
        (Subject::Axis(axis), INCOMPLETE, value) => {
            let incomplete = value.as_bool().ok_or_else(|| wrong("true or false, without quotes"));
            incomplete.map(|incomplete| Entry::Incomplete(axis, incomplete))
        }
        (Subject::Bus(bus), "protocols", value) => {
            let names: Option<Vec<&str>> = value
                .as_array()
                .and_then(|names| names.iter().map(|n| n.get_ref().as_str()).collect());
            let names = names.ok_or_else(|| wrong("names, for example [\"rmd\", \"thruster\"]"))?;
            let protocols = protocols(names.into_iter())?;
            Ok(Entry::Bus(bus, BusKey::Protocols(protocols)))
        }
        (row, key, value) => {
            let text = scalar(value).ok_or_else(|| wrong("a single value"))?;
            let entry = entry(row, key, &text, |bus| names.find_bus(bus))?;
            match value.as_str().and_then(|text| takes_no_text(&entry, text)) {
                Some(takes) => Err(wrong(&format!("{takes}, without quotes"))),
                None => Ok(entry),
            }
        }
    }
}

/// What a key takes that has no words.
fn takes_no_text(entry: &Entry, text: &str) -> Option<String> {
    let info = match entry {
        Entry::Gateway(parameter, _) => parameter.info(),
        Entry::Axis(_, AxisParameter::Bus, _) if is_name(text) => return None,
        Entry::Axis(_, parameter, _) => parameter.info(),
        Entry::Bus(_, BusKey::Exclusive(_)) | Entry::Incomplete(..) => {
            return Some("true or false".to_owned());
        }
        Entry::Bus(..) | Entry::MotorTimeout(..) => return Some("a whole number".to_owned()),
        Entry::Name(..) => return None,
    };
    (!parameters::takes_words(info)).then(|| parameters::allowed(info))
}

/// The number of the line in which a place stands, from 1.
fn line_of(text: &str, at: &Range<usize>) -> usize {
    1 + text.bytes().take(at.start).filter(|byte| *byte == b'\n').count()
}

fn integer(value: &DeValue<'_>) -> Option<i64> {
    let number = value.as_integer()?;
    i64::from_str_radix(number.as_str(), number.radix()).ok()
}

/// A single value, as the command line would have it.
fn scalar(value: &DeValue<'_>) -> Option<String> {
    match value {
        DeValue::String(text) => Some(text.clone().into_owned()),
        DeValue::Integer(number) => {
            Some(integer(value).map_or_else(|| number.to_string(), |number| number.to_string()))
        }
        DeValue::Float(number) => Some(number.as_str().to_owned()),
        DeValue::Boolean(flag) => Some(flag.to_string()),
        _ => None,
    }
}
