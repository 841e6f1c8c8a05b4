//! One line of output for each frame, as JSON or for people, built in one buffer.

use std::fmt::Display;
use std::io::{self, Write};

use embedded_can::{Frame, Id};
use host_protocol::CanFrame;

use super::line::Origin;
use super::number::{push_hex, push_id, push_integer, push_physical};
use crate::printable::printable;

/// Columns of the text form: as wide as an RS485 frame, `thruster 127`, the longest direction and
/// command.
const FRAME_WIDTH: usize = 26;
const MOTOR_WIDTH: usize = 12;
const DIRECTION_WIDTH: usize = 7;
const COMMAND_WIDTH: usize = 25;
/// Between two columns.
const GAP: usize = 2;

/// Digits of CAN ids.
const STANDARD_DIGITS: usize = 3;
const EXTENDED_DIGITS: usize = 8;

/// Bytes as they were captured.
pub enum Raw<'a> {
    Can(&'a CanFrame),
    Bytes(&'a [u8]),
    /// A line that holds neither.
    Text(&'a [u8]),
}

/// Whom a frame addresses, or who sent it.
pub enum Motor {
    Node(u8),
    All,
}

/// Which way a frame goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    Request,
    Reply,
    /// From a motor that nobody has asked.
    Event,
}

impl Direction {
    fn name(self) -> &'static str {
        match self {
            Direction::Request => "request",
            Direction::Reply => "reply",
            Direction::Event => "event",
        }
    }
}

/// Writes lines of output.
pub struct Record<W: Write> {
    out: W,
    json: bool,
    line: Vec<u8>,
    /// Lines with an error, and all.
    failed: u64,
    total: u64,
}

impl<W: Write> Record<W> {
    pub fn new(out: W, json: bool) -> Self {
        Self { out, json, line: Vec::new(), failed: 0, total: 0 }
    }

    /// Begins the line of a frame; `event` is its kind among the lines of JSON.
    pub fn begin(&mut self, event: &'static str, origin: &Origin<'_>, raw: Raw<'_>) {
        self.line.clear();
        if self.json {
            self.line.push(b'{');
            self.plain("event", event);
        }
        if let Some(time) = origin.time {
            self.time(time);
        }
        if let Some(interface) = origin.interface {
            self.string_or_cell("interface", interface, 0);
        }
        match raw {
            Raw::Can(frame) => self.hex_or_cell(|line| push_can(line, frame)),
            Raw::Bytes(bytes) => self.hex_or_cell(|line| push_hex(line, bytes)),
            Raw::Text(text) => self.string_or_cell("frame", text, FRAME_WIDTH),
        }
    }

    /// What kind of message it is.
    pub fn message(
        &mut self,
        direction: Direction,
        protocol: &'static str,
        motor: &Motor,
        command: &'static str,
    ) {
        if !self.json {
            return self.message_cells(direction, protocol, motor, command);
        }
        self.plain("direction", direction.name());
        self.plain("protocol", protocol);
        match motor {
            Motor::Node(node) => self.integer("node", i64::from(*node)),
            Motor::All => self.plain("node", "all"),
        }
        self.plain("command", command);
    }

    fn message_cells(
        &mut self,
        direction: Direction,
        protocol: &'static str,
        motor: &Motor,
        command: &'static str,
    ) {
        self.cell(MOTOR_WIDTH, |line| {
            line.extend_from_slice(protocol.as_bytes());
            line.push(b' ');
            match motor {
                Motor::Node(node) => push_integer(line, i64::from(*node)),
                Motor::All => line.extend_from_slice(b"all"),
            }
        });
        self.cell(DIRECTION_WIDTH, |line| line.extend_from_slice(direction.name().as_bytes()));
        self.cell(COMMAND_WIDTH, |line| line.extend_from_slice(command.as_bytes()));
    }

    pub fn integer(&mut self, name: &str, value: i64) {
        self.key(name);
        push_integer(&mut self.line, value);
    }

    /// A quantity in the unit of its name.
    pub fn physical(&mut self, name: &str, value: f64) {
        self.key(name);
        push_physical(&mut self.line, value);
    }

    pub fn boolean(&mut self, name: &str, value: bool) {
        self.key(name);
        self.line.extend_from_slice(if value { b"true" } else { b"false" });
    }

    /// A bit mask: the names of the bits that have one, and the word as `NAME_raw`.
    pub fn flags(&mut self, name: &str, raw: u32, names: fn(u32, &mut dyn FnMut(&'static str))) {
        self.key(name);
        let (json, line) = (self.json, &mut self.line);
        let (quote, between): (&[u8], &[u8]) = if json { (b"\"", b",") } else { (b"", b"|") };
        let mut first = true;
        line.extend_from_slice(if json { b"[" } else { b"" });
        names(raw, &mut |name| {
            line.extend_from_slice(if first { b"" } else { between });
            line.extend_from_slice(quote);
            line.extend_from_slice(name.as_bytes());
            line.extend_from_slice(quote);
            first = false;
        });
        if json {
            line.push(b']');
            self.suffixed_key(name, b"_raw");
            push_integer(&mut self.line, i64::from(raw));
        } else {
            line.extend_from_slice(if first { b"none(0x" } else { b"(0x" });
            push_hex(line, raw.to_be_bytes().get(2..).unwrap_or_default());
            line.push(b')');
        }
    }

    /// Text from a wire.
    pub fn text(&mut self, name: &str, text: &str) {
        self.key(name);
        if self.json {
            push_json_string(&mut self.line, text)
        } else {
            self.line.extend_from_slice(text.as_bytes())
        }
    }

    /// Bytes without further meaning, in hexadecimal.
    pub fn bytes(&mut self, name: &str, bytes: &[u8]) {
        self.key(name);
        self.quote();
        push_hex(&mut self.line, bytes);
        self.quote();
    }

    /// The protocol of a frame that its codec cannot decode.
    pub fn protocol(&mut self, protocol: &'static str) {
        if self.json {
            self.plain("protocol", protocol);
        } else {
            self.cell(MOTOR_WIDTH, |line| line.extend_from_slice(protocol.as_bytes()));
        }
    }

    /// Why a frame has no meaning: a stable name, and a text for people.
    pub fn error(&mut self, name: &'static str, message: &dyn Display) {
        self.failed += 1;
        if self.json {
            self.plain("error", name);
            self.key("message");
            push_json_string(&mut self.line, &message.to_string());
        } else {
            self.cell(0, |line| {
                // Writing to a vector does not fail.
                let _ = write!(line, "error: {name} ({message})");
            });
        }
    }

    /// The manual does not list this command: its bytes are all there is to say, and which dialects
    /// of the protocol have it, if any.
    pub fn unknown_command(&mut self, dialects: &[&str]) {
        if !self.json {
            self.line.push(b' ');
        }
        match dialects {
            [] => self.error("unknown_command", &"the manual does not list it"),
            _ => {
                let dialects = dialects.join(" or ");
                let message = format!("not in this dialect; try --dialect {dialects}");
                self.error("unknown_command", &message);
            }
        }
    }

    /// Ends the line.
    pub fn end(&mut self) -> io::Result<()> {
        self.total += 1;
        if self.json {
            self.line.push(b'}');
        } else {
            let used = self.line.trim_ascii_end().len();
            self.line.truncate(used);
        }
        let line = String::from_utf8_lossy(&self.line);
        self.out.write_all(printable(&line).as_bytes())?;
        self.out.write_all(b"\n")
    }

    /// The line by itself, without its end.
    pub fn into_line(mut self) -> String {
        if self.json {
            self.line.push(b'}');
        }
        String::from_utf8_lossy(&self.line).trim_end().to_owned()
    }

    /// What the lines were written to.
    pub fn into_written(self) -> W {
        self.out
    }

    /// How many lines have an error, and how many there are.
    pub fn failed(&self) -> (u64, u64) {
        (self.failed, self.total)
    }

    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Seconds as they stand in the capture; anything else that stood there as text.
    fn time(&mut self, time: &[u8]) {
        if self.json {
            if let Some(number) = json_number(time) {
                self.key("time_s");
                return self.line.extend_from_slice(number);
            }
            if let Some(number) = unusual_number(time) {
                self.key("time_s");
                return self.line.extend_from_slice(number.as_bytes());
            }
        }
        self.string_or_cell("time", time, 0);
    }

    fn string_or_cell(&mut self, name: &str, bytes: &[u8], width: usize) {
        let text = String::from_utf8_lossy(bytes);
        if self.json {
            self.key(name);
            push_json_string(&mut self.line, &text);
        } else {
            self.cell(width, |line| line.extend_from_slice(text.as_bytes()));
        }
    }

    fn hex_or_cell(&mut self, push: impl Fn(&mut Vec<u8>)) {
        if self.json {
            self.key("frame");
            self.quote();
            push(&mut self.line);
            self.quote();
        } else {
            self.cell(FRAME_WIDTH, push);
        }
    }

    /// Text that needs no escapes.
    fn plain(&mut self, name: &str, text: &'static str) {
        self.key(name);
        self.quote();
        self.line.extend_from_slice(text.as_bytes());
        self.quote();
    }

    /// `"name":` with the comma before it, or `name=`.
    fn key(&mut self, name: &str) {
        self.suffixed_key(name, b"");
    }

    fn suffixed_key(&mut self, name: &str, suffix: &[u8]) {
        if self.json && self.line.last() != Some(&b'{') {
            self.line.push(b',');
        } else if !self.json && self.line.last().is_some_and(|last| *last != b' ') {
            self.line.push(b' ');
        }
        self.quote();
        self.line.extend_from_slice(name.as_bytes());
        self.line.extend_from_slice(suffix);
        self.quote();
        self.line.push(if self.json { b':' } else { b'=' });
    }

    fn quote(&mut self) {
        if self.json {
            self.line.push(b'"');
        }
    }

    fn cell(&mut self, width: usize, push: impl Fn(&mut Vec<u8>)) {
        let start = self.line.len();
        push(&mut self.line);
        let used = self.line.len().saturating_sub(start);
        self.line.resize(start + used.max(width) + GAP, b' ');
    }
}

fn push_can(line: &mut Vec<u8>, frame: &CanFrame) {
    match Frame::id(frame) {
        Id::Standard(id) => push_id(line, u32::from(id.as_raw()), STANDARD_DIGITS),
        Id::Extended(id) => push_id(line, id.as_raw(), EXTENDED_DIGITS),
    }
    line.push(b'#');
    if frame.is_remote_frame() {
        line.push(b'R');
        push_integer(line, i64::try_from(frame.dlc()).unwrap_or_default());
    } else {
        push_hex(line, frame.data());
    }
}

/// The digits of a decimal number as JSON has it: without zeros in front.
fn json_number(text: &[u8]) -> Option<&[u8]> {
    let mut parts = text.split(|byte| *byte == b'.');
    let is_number = |part: &[u8]| !part.is_empty() && part.iter().all(u8::is_ascii_digit);
    let (whole, fraction, rest) = (parts.next()?, parts.next(), parts.next());
    if !is_number(whole) || !fraction.is_none_or(is_number) || rest.is_some() {
        return None;
    }
    let zeros = whole.iter().take(whole.len() - 1).take_while(|byte| **byte == b'0').count();
    text.get(zeros..)
}

/// A number in another form than JSON has it: `-5`, `+5`, `.5`, `1.`, `1e9`, with all its digits.
fn unusual_number(text: &[u8]) -> Option<String> {
    let text = std::str::from_utf8(text).ok()?;
    text.parse::<f64>().ok().filter(|value| value.is_finite())?;
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, format!("e{exponent}")),
        None => (text, String::new()),
    };
    let (sign, digits) = match mantissa.strip_prefix('-') {
        Some(digits) => ("-", digits),
        None => ("", mantissa.trim_start_matches('+')),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let whole =
        Some(whole.trim_start_matches('0')).filter(|whole| !whole.is_empty()).unwrap_or("0");
    let point = if fraction.is_empty() { "" } else { "." };
    Some(format!("{sign}{whole}{point}{fraction}{exponent}"))
}

fn push_json_string(line: &mut Vec<u8>, text: &str) {
    line.push(b'"');
    for byte in text.bytes() {
        match byte {
            b'"' | b'\\' => line.extend_from_slice(&[b'\\', byte]),
            0..=0x1F | 0x7F => {
                line.extend_from_slice(b"\\u00");
                push_hex(line, &[byte]);
            }
            _ => line.push(byte),
        }
    }
    line.push(b'"');
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(raw: u32, visit: &mut dyn FnMut(&'static str)) {
        [(1, "low"), (2, "high")]
            .iter()
            .filter(|(bit, _)| raw & bit != 0)
            .for_each(|(_, name)| visit(name));
    }

    fn line(json: bool) -> String {
        let mut out = Vec::new();
        let mut record = Record::new(&mut out, json);
        let origin = Origin { time: Some(b"000.250"), interface: Some(b"can\"0") };
        record.begin("frame", &origin, Raw::Can(&CanFrame::standard(0x141, &[0x9A, 0]).unwrap()));
        record.message(Direction::Reply, "rmd", &Motor::Node(1), "read");
        record.physical("current_a", -0.5);
        record.flags("faults", 0x8003, names);
        record.flags("none", 0, names);
        record.bytes("data", &[0xAB]);
        record.text("model", "a\\\u{1}");
        record.boolean("on", true);
        record.end().unwrap();
        drop(record);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn json() {
        assert_eq!(
            line(true),
            concat!(
                r#"{"event":"frame","time_s":0.250,"interface":"can\"0","frame":"141#9A00","direction":"reply","#,
                r#""protocol":"rmd","node":1,"command":"read","current_a":-0.5,"#,
                r#""faults":["low","high"],"faults_raw":32771,"none":[],"none_raw":0,"#,
                r#""data":"AB","model":"a\\\u0001","on":true}"#,
                "\n"
            )
        );
    }

    #[test]
    fn text() {
        assert_eq!(
            line(false),
            "000.250  can\"0  141#9A00                    rmd 1         reply    read\
             \x20                      current_a=-0.5 faults=low|high(0x8003) none=none(0x0000) \
             data=AB model=a\\\\u0001 on=true\n"
        );
    }

    #[test]
    fn times() {
        for (text, number) in [
            ("1700000000.000000", Some("1700000000.000000")),
            ("000.5", Some("0.5")),
            ("7", Some("7")),
            ("1.", None),
            (".5", None),
            ("1.2.3", None),
            ("2024-01-01 10:00:00.5", None),
            ("", None),
        ] {
            assert_eq!(json_number(text.as_bytes()), number.map(str::as_bytes), "{text}");
        }
        for (text, number) in [
            ("-5", Some("-5")),
            ("+05.50", Some("5.50")),
            (".5", Some("0.5")),
            ("-.5", Some("-0.5")),
            ("1700000000.", Some("1700000000")),
            ("1.7e9", Some("1.7e9")),
            (".", None),
            ("inf", None),
            ("nan", None),
            ("1.2.3", None),
            ("2024-01-01", None),
            ("", None),
        ] {
            assert_eq!(unusual_number(text.as_bytes()).as_deref(), number, "{text}");
        }
    }
}
