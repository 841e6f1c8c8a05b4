//! Runs vector files: lines of `label | kind | bus | input | outcome | source`.
//!
//! | kind | input | outcome |
//! |---|---|---|
//! | `request`, `reply`, `event`, … | a frame | `VALUE`: decodes to it and is encoded to the same frame |
//! | | | `VALUE => FRAME` or `VALUE => Err(…)`: is encoded to another frame, or refused |
//! | | | `Err(…)`: is refused |
//! | `answer`, `answer while an echo is due` | a request and a reply | what the reply is to it |
//! | `build` | a command and `field=value` | the frame, or `Err(…)` |
//! | `show`, `show request` | a frame | the command's name and `field=value` |
//! | `line` | pieces of a serial line | the frames found, bytes rejected and bytes pending |
//!
//! Errors and values are Rust's `Debug` text.

use core::fmt::Debug;

use super::Wire;
use codec::{Deframer, EncodeError, FieldValue, Framing, Visit};

/// In the source: accepted, but not sent like this.
const NOT_SENT: [&str; 2] = ["decode only", "encoding refused"];

/// One line.
#[derive(Debug, Clone, Copy)]
pub struct Vector<'a> {
    /// Its label.
    pub label: &'a str,
    /// What is done with the input.
    pub kind: &'a str,
    /// `can` or `rs485`.
    pub bus: &'a str,
    /// A frame, or what the kind needs.
    pub input: &'a str,
    /// What must come of it.
    pub outcome: &'a str,
    /// The section of the manual, and what is special about the line.
    pub source: &'a str,
}

/// What a codec makes of a frame.
#[derive(Debug)]
pub struct Decoded {
    /// The value's `Debug` text.
    pub value: String,
    /// The frame it is encoded to, or the error's `Debug` text.
    pub encoded: Result<String, String>,
    /// The command's name.
    pub name: &'static str,
    /// Each field with its value.
    pub fields: String,
}

/// What a codec does with the inputs.
pub trait Codec {
    /// Decodes a frame of this kind and encodes it again; the error as text.
    fn decode(vector: &Vector<'_>, frame: &Wire) -> Result<Decoded, String>;

    /// What the reply is to the request: `Debug` text, `Reply` without the reply.
    fn answer(request: &Wire, reply: &Wire, echo_due: bool) -> String;

    /// The frame of a request built from names and numbers, for a motor of the codec's choice.
    fn build(bus: &str, name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Wire, String>;

    /// What the deframer of the serial line finds.
    fn line(pieces: &[Vec<u8>]) -> String {
        panic!("{pieces:?}: this protocol has no serial line")
    }
}

/// The lines of a file.
pub fn vectors(file: &str) -> impl Iterator<Item = Vector<'_>> {
    let lines = file.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| Vector::parse(line).unwrap_or_else(|| panic!("six columns: {line}")))
}

/// Runs a file, which must have this many lines, so that none goes missing unseen.
pub fn check<C: Codec>(file: &str, count: usize) {
    let mut wrong = String::new();
    let mut lines = 0;
    for vector in vectors(file) {
        lines += 1;
        if let Err(found) = vector.check::<C>() {
            wrong += &format!("{vector:?}\n  found: {found}\n");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert_eq!(lines, count);
}

impl<'a> Vector<'a> {
    /// A set of flags is printed with ` | `, so the outcome is what the other columns leave.
    fn parse(line: &'a str) -> Option<Vector<'a>> {
        let mut columns = line.splitn(5, " | ");
        let (label, kind, bus) = (columns.next()?, columns.next()?, columns.next()?);
        let input = columns.next()?;
        let (outcome, source) = columns.next()?.rsplit_once(" | ")?;
        Some(Vector { label, kind, bus, input, outcome, source })
    }

    /// What the codec makes of the line's frame.
    pub fn decode<C: Codec>(&self) -> Result<Decoded, String> {
        C::decode(self, &Wire::parse(self.input))
    }

    fn check<C: Codec>(&self) -> Result<(), String> {
        let found = match self.kind {
            "answer" | "answer while an echo is due" => {
                let (request, reply) = self.input.split_once(' ').expect("a request and a reply");
                C::answer(&Wire::parse(request), &Wire::parse(reply), self.kind != "answer")
            }
            "build" => match self.build::<C>() {
                Ok(frame) => frame.to_string(),
                Err(error) => format!("Err({error})"),
            },
            "line" => C::line(&self.input.split(' ').map(super::hex).collect::<Vec<_>>()),
            "show" | "show request" => {
                let Decoded { name, fields, .. } = self.decode::<C>()?;
                format!("{name}{fields}")
            }
            _ => return self.check_frame::<C>(),
        };
        if found == self.outcome { Ok(()) } else { Err(found) }
    }

    fn check_frame<C: Codec>(&self) -> Result<(), String> {
        let Decoded { value, encoded, .. } = match self.decode::<C>() {
            Ok(decoded) => decoded,
            Err(error) if self.outcome == format!("Err({error})") => return Ok(()),
            Err(error) => return Err(format!("Err({error})")),
        };
        let is_sent = encoded.as_deref() == Ok(self.input);
        let found = match &encoded {
            _ if is_sent => value.clone(),
            Ok(frame) => format!("{value} => {frame}"),
            Err(error) => format!("{value} => Err({error})"),
        };
        let not_sent = !is_sent && NOT_SENT.iter().any(|words| self.source.contains(words));
        if found == self.outcome || (not_sent && value == self.outcome) {
            Ok(())
        } else {
            Err(found)
        }
    }

    fn build<C: Codec>(&self) -> Result<Wire, String> {
        let mut words = self.input.split(' ');
        let name = words.next().expect("a command");
        let given: Vec<(&str, f64)> = words
            .map(|word| word.split_once('=').expect("field=value"))
            .map(|(field, value)| (field, value.parse().expect("a number")))
            .collect();
        C::build(self.bus, name, &|field| {
            given.iter().find(|(name, _)| *name == field).map(|(_, value)| *value)
        })
    }
}

impl Decoded {
    /// Of a value that is encoded to this frame and shows these fields.
    pub fn new(
        value: &dyn Debug,
        encoded: Result<Wire, EncodeError>,
        name: &'static str,
        visit_fields: &dyn Fn(&mut Visit<'_>),
    ) -> Decoded {
        let mut fields = String::new();
        visit_fields(&mut |name, value| fields += &format!(" {name}={}", text(value)));
        let encoded = encoded.map(|frame| frame.to_string()).map_err(|error| format!("{error:?}"));
        Decoded { value: format!("{value:?}"), encoded, name, fields }
    }
}

/// What a deframer finds in the pieces of a line: frames, bytes rejected, bytes pending.
pub fn found_on_line<F: Framing<LEN>, const LEN: usize>(pieces: &[Vec<u8>]) -> String {
    let mut deframer = Deframer::<F, LEN>::new();
    let mut found = String::new();
    for piece in pieces {
        for frame in deframer.push_slice(piece) {
            found += &format!("{} ", Wire::Serial(frame.into()));
        }
    }
    format!("{found}rejected {} pending {}", deframer.rejected(), deframer.pending())
}

/// A field's value as text.
fn text(value: FieldValue<'_>) -> String {
    match value {
        FieldValue::Integer(value) => value.to_string(),
        FieldValue::Physical(value) => value.to_string(),
        FieldValue::Bool(value) => value.to_string(),
        FieldValue::Flags { raw, names } => {
            let mut text = format!("{raw:#06x}");
            names(raw, &mut |name| text += &format!("+{name}"));
            text
        }
        FieldValue::Text(text) => text.into(),
        FieldValue::Bytes(bytes) => Wire::Serial(bytes.into()).to_string(),
    }
}
