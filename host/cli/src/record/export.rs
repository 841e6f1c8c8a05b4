//! Recordings in the forms of others: CSV, and the lines of candump.

use std::collections::BTreeSet;
use std::io::{self, BufWriter, Write};

use super::read::Recorded;
use super::show::flat;
use crate::failure::Failure;

/// The columns before those of the messages.
const FIRST: [&str; 3] = ["time_s", "host_time_s", "topic"];

/// Where exports go: standard output, a whole buffer at a time.
pub struct Lines(BufWriter<io::StdoutLock<'static>>);

impl Lines {
    pub fn new() -> Self {
        Self(BufWriter::new(io::stdout().lock()))
    }

    pub fn line(&mut self, line: &str) -> Result<(), Failure> {
        writeln!(self.0, "{line}").map_err(Failure::Output)
    }

    pub fn end(mut self) -> Result<(), Failure> {
        self.0.flush().map_err(Failure::Output)
    }
}

/// The columns of all messages together.
#[derive(Default)]
pub struct Columns(BTreeSet<String>);

impl Columns {
    pub fn add(&mut self, message: &Recorded) {
        self.0.extend(flat(&message.value).into_iter().map(|(name, _)| name));
        self.0.remove("time_us");
    }

    /// The first line.
    pub fn head(&self) -> String {
        let names = self.0.iter().map(String::as_str);
        FIRST.into_iter().chain(names).map(cell).collect::<Vec<_>>().join(",")
    }

    /// The line of a message.
    pub fn row(&self, message: &Recorded) -> String {
        let fields = flat(&message.value);
        let time = message.time_s().map_or(String::new(), |time| format!("{time:.6}"));
        let (seconds, rest) = (message.log_ns / 1_000_000_000, message.log_ns % 1_000_000_000);
        let mut row = vec![time, format!("{seconds}.{rest:09}"), cell(&message.topic)];
        row.extend(self.0.iter().map(|name| {
            let field = fields.iter().find(|(of, _)| of == name);
            field.map_or(String::new(), |(_, value)| cell(value))
        }));
        row.join(",")
    }
}

/// As RFC 4180 has it.
fn cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// A raw frame as `candump -L` writes it, in the gateway's time; nothing of another message.
pub fn candump(message: &Recorded) -> Option<String> {
    let value = &message.value;
    if value["event"] != "frame" {
        return None;
    }
    let time_us = value["time_us"].as_u64().unwrap_or(message.log_ns / 1_000);
    let (seconds, rest) = (time_us / 1_000_000, time_us % 1_000_000);
    let (kind, frame) = (value["kind"].as_str()?, value["frame"].as_str()?);
    Some(format!("({seconds:010}.{rest:06}) {kind}{} {frame}", value["bus"]))
}
