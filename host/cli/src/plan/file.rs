//! Reads the file: each value in its range, and each slip with its line.

use host_protocol::{AxisParameter, ParameterInfo, ProtocolSet, Value};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs;
use std::io::Read;
use toml::Spanned;

use super::{At, AxisPlan, BusPlan, DEFAULT_REPLY_WINDOW_US, Plan, protocols};
use crate::failure::Failure;
use crate::parameters;

/// Bytes that a file may have: many times what every axis with every parameter takes.
const MAX_FILE: u64 = 256 * 1024;

type Entries = BTreeMap<String, Spanned<toml::Value>>;

/// The file as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    gateway: Entries,
    #[serde(default)]
    bus: Vec<Spanned<Entries>>,
    #[serde(default)]
    axis: Vec<Spanned<Entries>>,
}

/// The text of a regular file.
pub fn text(path: &str) -> Result<String, String> {
    if path == "-" {
        return Err("a configuration is read from a file, not from standard input".to_owned());
    }
    // Before it is opened: opening a pipe waits for who writes into it.
    let metadata = fs::metadata(path).map_err(|error| error.to_string())?;
    if !metadata.is_file() {
        let kind = if metadata.is_dir() { "a directory" } else { "a pipe or a device" };
        return Err(format!("it is {kind}; a configuration is read from a regular file"));
    }
    let mut bytes = Vec::new();
    let file = fs::File::open(path).map_err(|error| error.to_string())?;
    file.take(MAX_FILE + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if u64::try_from(bytes.len()).is_ok_and(|length| length > MAX_FILE) {
        return Err(format!("it has more than {MAX_FILE} bytes, too many for a configuration"));
    }
    String::from_utf8(bytes).map_err(|error| format!("it is no text: {error}"))
}

/// Reads the text.
pub fn parse(text: &str) -> Result<Plan, Failure> {
    let file: File = toml::from_str(text)
        .map_err(|error| Failure::Usage(format!("not a configuration: {error}")))?;
    let mut plan = Plan::default();
    let mut gateway = Section { text, line: 1, name: "gateway".to_owned(), entries: file.gateway };
    for (name, entry) in std::mem::take(&mut gateway.entries) {
        let parameter = gateway.is_right(&entry, parameters::gateway_parameter(&name))?;
        plan.gateway.push((parameter, gateway.value(&name, &entry, parameter.info())?));
    }
    for entries in file.bus {
        let (number, section) = Section::numbered(text, "bus", entries)?;
        if let Some(other) = plan.buses.iter().find(|other| other.what.bus == number) {
            return Err(
                section.wrong(section.line, format!("is there already, in line {}", other.line))
            );
        }
        plan.buses.push(At { line: section.line, what: section.bus(number)? });
    }
    for entries in file.axis {
        let (number, section) = Section::numbered(text, "axis", entries)?;
        if let Some(other) = plan.axes.iter().find(|other| other.what.axis == number) {
            return Err(
                section.wrong(section.line, format!("is there already, in line {}", other.line))
            );
        }
        plan.axes.push(At { line: section.line, what: section.axis(number)? });
    }
    Ok(plan)
}

/// One table of the file.
struct Section<'a> {
    text: &'a str,
    /// Where it begins.
    line: usize,
    /// What it is of, for people.
    name: String,
    entries: Entries,
}

impl<'a> Section<'a> {
    /// The section of the bus or axis that it names under `kind`, and which that is.
    fn numbered(
        text: &'a str,
        kind: &str,
        entries: Spanned<Entries>,
    ) -> Result<(u8, Self), Failure> {
        let line = line_of(text, entries.span().start);
        let mut section = Self { text, line, name: kind.to_owned(), entries: entries.into_inner() };
        let Some(number) = section.entries.remove(kind) else {
            return Err(section.wrong(line, format!("lacks its number: {kind} = 0")));
        };
        section.line = line_of(text, number.span().start);
        let given = number.as_ref().as_integer().and_then(|number| u8::try_from(number).ok());
        let Some(number) = given else {
            return Err(section.wrong(section.line, "takes a number from 0 on"));
        };
        section.name = format!("{kind} {number}");
        Ok((number, section))
    }

    fn bus(mut self, bus: u8) -> Result<BusPlan, Failure> {
        let bitrate = self.unsigned("bitrate")?;
        let protocols = self.protocols()?;
        let exclusive =
            self.take("exclusive", "true or false", toml::Value::as_bool)?.unwrap_or(false);
        let reply_window_us = self.unsigned("reply_window_us")?.unwrap_or(DEFAULT_REPLY_WINDOW_US);
        if let Some((name, entry)) = self.entries.first_key_value() {
            let names = ["bus", "bitrate", "protocols", "exclusive", "reply_window_us"];
            return self
                .is_right(entry, Err(parameters::unknown("a bus", name, names.into_iter())));
        }
        let (Some(bitrate), Some(protocols)) = (bitrate, protocols) else {
            let example = "bitrate = 1_000_000 and protocols = [\"rmd\", \"thruster\"]";
            return Err(self
                .wrong(self.line, format!("needs bitrate and protocols, for example {example}")));
        };
        let plan = BusPlan { bus, bitrate, protocols, exclusive, reply_window_us };
        plan.check().map_err(|error| self.wrong(self.line, error))?;
        Ok(plan)
    }

    fn axis(mut self, axis: u8) -> Result<AxisPlan, Failure> {
        let motor_timeout_ms = self.unsigned("motor_timeout_ms")?;
        let mut values = Vec::new();
        for (name, entry) in std::mem::take(&mut self.entries) {
            let parameter = self.is_right(&entry, parameters::axis_parameter(&name))?;
            values.push((parameter, self.value(&name, &entry, parameter.info())?));
        }
        // Bus, protocol and node first, and whether there is an encoder: what a parameter may be
        // can depend on them.
        let is_address = |parameter| parameter == AxisParameter::PositionDevice;
        values.sort_by_key(|(parameter, _)| (!is_address(*parameter), parameter.number()));
        Ok(AxisPlan { axis, parameters: values, motor_timeout_ms })
    }

    fn protocols(&mut self) -> Result<Option<ProtocolSet>, Failure> {
        let Some(entry) = self.entries.remove("protocols") else { return Ok(None) };
        let names: Option<Vec<&str>> = entry
            .as_ref()
            .as_array()
            .and_then(|names| names.iter().map(toml::Value::as_str).collect());
        let Some(names) = names else {
            return Err(
                self.wrong_at(&entry, "protocols takes names, for example [\"rmd\", \"thruster\"]")
            );
        };
        self.is_right(&entry, protocols(names.into_iter())).map(Some)
    }

    fn unsigned(&mut self, name: &str) -> Result<Option<u32>, Failure> {
        let number =
            |value: &toml::Value| value.as_integer().and_then(|number| u32::try_from(number).ok());
        self.take(name, "a whole number from 0 on", number)
    }

    fn take<T>(
        &mut self,
        name: &str,
        takes: &str,
        read: impl Fn(&toml::Value) -> Option<T>,
    ) -> Result<Option<T>, Failure> {
        let Some(entry) = self.entries.remove(name) else { return Ok(None) };
        match read(entry.as_ref()) {
            Some(value) => Ok(Some(value)),
            None => Err(self.wrong_at(&entry, format!("{name} takes {takes}"))),
        }
    }

    /// The value of a parameter, in its range.
    fn value(
        &self,
        name: &str,
        entry: &Spanned<toml::Value>,
        info: &ParameterInfo,
    ) -> Result<Value, Failure> {
        let value = match scalar(entry.as_ref()) {
            Some(text) => self.is_right(entry, parameters::value(info, &text))?,
            None => return Err(self.wrong_at(entry, format!("{name} takes a single value"))),
        };
        info.check(value).map_err(|error| self.wrong_at(entry, error))?;
        Ok(value)
    }

    fn is_right<T>(
        &self,
        entry: &Spanned<toml::Value>,
        read: Result<T, Failure>,
    ) -> Result<T, Failure> {
        read.map_err(|failure| self.wrong_at(entry, failure))
    }

    fn wrong_at(&self, entry: &Spanned<toml::Value>, why: impl Display) -> Failure {
        self.wrong(line_of(self.text, entry.span().start), why)
    }

    fn wrong(&self, line: usize, why: impl Display) -> Failure {
        Failure::Usage(format!("line {line}, {}: {why}", self.name))
    }
}

/// The number of the line in which the byte at `offset` stands, from 1.
fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
}

/// A single value, as the command line would have it.
fn scalar(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(text) => Some(text.clone()),
        toml::Value::Integer(number) => Some(number.to_string()),
        toml::Value::Float(number) => Some(number.to_string()),
        toml::Value::Boolean(flag) => Some(flag.to_string()),
        _ => None,
    }
}
