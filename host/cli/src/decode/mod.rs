//! `mgw decode`: captured frames in words, line by line.

mod bus;
mod d5;
mod line;
mod native;
mod number;
mod reader;
mod record;
mod rmd;
mod serial;
mod thruster;

use std::io::{self, BufReader, BufWriter, Read, Write};

use codec::{FieldValue, Visit};
use embedded_can::{Frame, Id};
use host_protocol::CanFrame;

use crate::args::{BusKind, DecodeArgs, ProtocolChoice};
use crate::failure::Failure;
use crate::given;
pub use native::reply;

use bus::Buses;
use line::{Content, Line, Origin, Unreadable};
use reader::Lines;
use record::{Raw, Record};
use serial::{Piece, Scanner};

/// Of standard input and of standard output: large enough that calls to the system cost nothing.
const BUFFER: usize = 1 << 16;
/// With which some editors and shells begin a file in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// Decodes files, or standard input to its end.
pub fn run(args: &DecodeArgs, json: bool) -> Result<(), Failure> {
    if (args.protocol, args.bus) == (ProtocolChoice::Thruster, Some(BusKind::Rs485)) {
        return Err(Failure::Usage(
            "thrusters have no serial line: leave `--bus rs485` away".to_owned(),
        ));
    }
    let output = BufWriter::with_capacity(BUFFER, io::stdout().lock());
    let mut decoder = Decoder::new(args, Record::new(output, json));
    let read = read_all(&mut decoder, args);
    Failure::first([read, decoder.end()])
}

fn read_all<W: Write>(decoder: &mut Decoder<'_, W>, args: &DecodeArgs) -> Result<(), Failure> {
    if args.files.is_empty() {
        decoder.read("standard input", io::stdin().lock())?;
    }
    for path in &args.files {
        if path.as_os_str() == "-" {
            decoder.read("standard input", io::stdin().lock())?;
            continue;
        }
        decoder.read(&path.to_string_lossy(), given::open(path)?)?;
    }
    Ok(())
}

/// Decodes a text as a file, into lines of JSON.
pub fn text(args: &DecodeArgs, text: &str) -> Result<String, Failure> {
    let mut decoder = Decoder::new(args, Record::new(Vec::new(), true));
    decoder.read("the text", text.as_bytes())?;
    decoder.record.flush().map_err(Failure::Output)?;
    Ok(String::from_utf8_lossy(&decoder.record.into_written()).into_owned())
}

/// The fields of a message for people: `current_a=1 speed_dps=500`.
pub fn fields(visit: impl FnOnce(&mut Visit<'_>)) -> String {
    let mut record = Record::new(Vec::new(), false);
    visit(&mut put(&mut record));
    record.into_line()
}

/// Takes the fields of a message into a record.
fn put<W: Write>(record: &mut Record<W>) -> impl FnMut(&'static str, FieldValue<'_>) {
    |name, value| match value {
        FieldValue::Integer(value) => record.integer(name, value),
        FieldValue::Physical(value) => record.physical(name, value),
        FieldValue::Bool(value) => record.boolean(name, value),
        FieldValue::Flags { raw, names } => record.flags(name, raw, names),
        FieldValue::Text(text) => record.text(name, text),
        FieldValue::Bytes(bytes) => record.bytes(name, bytes),
    }
}

/// Puts a message with its fields into a record; one that the manual does not list says
/// so, and which dialects have it.
macro_rules! put_message {
    ($record:ident, $direction:ident, $motor:expr, $message:ident, $is_known:expr, $dialects:expr) => {
        $record.message(Direction::$direction, NAME, &$motor, $message.name());
        $message.visit_fields(&mut put($record));
        if !$is_known {
            $record.unknown_command($dialects);
        }
    };
}
use put_message;

struct Decoder<'a, W: Write> {
    args: &'a DecodeArgs,
    record: Record<W>,
    scanner: Scanner,
    buses: Buses,
}

impl<'a, W: Write> Decoder<'a, W> {
    fn new(args: &'a DecodeArgs, record: Record<W>) -> Self {
        Self {
            args,
            record,
            scanner: Scanner::new(args.protocol),
            buses: Buses::new(args.headerless, args.dialect),
        }
    }

    /// Decodes the lines of one capture.
    fn read(&mut self, name: &str, input: impl Read) -> Result<(), Failure> {
        let mut lines = Lines::new(BufReader::with_capacity(BUFFER, input));
        let mut mark: &[u8] = BYTE_ORDER_MARK;
        loop {
            if lines.would_wait() {
                // A reader of a live capture sees each frame when it has come.
                self.record.flush().map_err(Failure::Output)?;
            }
            let Some(text) = lines.next().map_err(|source| given::unread(name, source))? else {
                break;
            };
            let text = text.strip_prefix(std::mem::take(&mut mark)).unwrap_or(text);
            self.line(&Line::parse(text)).map_err(Failure::Output)?;
        }
        self.end_of_serial(&Origin::default()).map_err(Failure::Output)
    }

    /// Whether all could be decoded.
    fn end(mut self) -> Result<(), Failure> {
        let printed = self.record.flush().map_err(Failure::Output);
        match self.record.failed() {
            (0, _) => printed,
            (failed, total) => Err(Failure::Undecoded { failed, total }),
        }
    }

    fn line(&mut self, line: &Line<'_>) -> io::Result<()> {
        let origin = &line.origin;
        let content = match (&line.content, self.args.bus) {
            (Content::Can(_), Some(BusKind::Rs485)) => &Content::Unreadable(Unreadable::OTHER_BUS),
            (Content::Serial(_), Some(BusKind::Can)) => &Content::Unreadable(Unreadable::OTHER_BUS),
            (Content::Serial(_), None) if self.args.protocol == ProtocolChoice::Thruster => {
                &Content::Unreadable(Unreadable::OTHER_BUS)
            }
            (content, _) => content,
        };
        if let Content::Serial(bytes) = content {
            return self.serial(origin, *bytes);
        }
        self.end_of_serial(origin)?;
        match content {
            Content::Nothing | Content::Serial(_) => Ok(()),
            Content::Can(frame) => self.can(origin, frame),
            Content::Unreadable(why) => {
                self.record.begin("frame", origin, Raw::Text(line.text));
                self.record.error(why.name, &why.message);
                self.record.end()
            }
        }
    }

    fn can(&mut self, origin: &Origin<'_>, frame: &CanFrame) -> io::Result<()> {
        let (record, direction) = (&mut self.record, self.args.direction);
        let bus = self.buses.of(origin.interface);
        record.begin("frame", origin, Raw::Can(frame));
        match protocol_of(self.args.protocol, frame) {
            Some(Protocol::Rmd) => rmd::write(bus.rmd_can.can(frame, direction), record),
            Some(Protocol::Thruster) => thruster::write(bus.thruster.can(frame), record),
            Some(Protocol::D5) => d5::write(d5::can(frame), record),
            None => {
                record.error("wrong_id", &"no protocol has this id, and the data begin no D5 frame")
            }
        }
        record.end()
    }

    fn serial(&mut self, origin: &Origin<'_>, bytes: impl Iterator<Item = u8>) -> io::Result<()> {
        self.scanner.push(bytes);
        self.pieces(origin)
    }

    /// What may still have become a frame no longer can.
    fn end_of_serial(&mut self, origin: &Origin<'_>) -> io::Result<()> {
        if self.scanner.is_empty() {
            return Ok(());
        }
        self.scanner.end();
        self.pieces(origin)
    }

    fn pieces(&mut self, origin: &Origin<'_>) -> io::Result<()> {
        let (record, direction) = (&mut self.record, self.args.direction);
        let bus = self.buses.of(origin.interface);
        while let Some(piece) = self.scanner.next() {
            record.begin("frame", origin, Raw::Bytes(piece.bytes()));
            match piece {
                Piece::Rmd(frame) => rmd::write(bus.rmd_rs485.rs485(frame, direction), record),
                Piece::D5(frame) => d5::write(::d5::decode_frame(frame), record),
                Piece::Broken { why, .. } => record.error(why.name(), &why),
            }
            record.end()?;
        }
        self.scanner.forget();
        Ok(())
    }
}

#[derive(Clone, Copy)]
enum Protocol {
    Rmd,
    Thruster,
    D5,
}

/// The protocol whose codec reads a CAN frame: the chosen one, else the one that has its id, else
/// D5 if the data begin like one of its frames, whose ids are not given.
fn protocol_of(choice: ProtocolChoice, frame: &CanFrame) -> Option<Protocol> {
    match choice {
        ProtocolChoice::Rmd => Some(Protocol::Rmd),
        ProtocolChoice::Thruster => Some(Protocol::Thruster),
        ProtocolChoice::D5 => Some(Protocol::D5),
        ProtocolChoice::Auto => {
            let by_id = match Frame::id(frame) {
                id @ Id::Standard(standard) => rmd::has_id(standard.as_raw())
                    .then_some(Protocol::Rmd)
                    .or_else(|| thruster::has_id(id).then_some(Protocol::Thruster)),
                Id::Extended(_) => None,
            };
            by_id.or_else(|| d5::begins(frame.data()).then_some(Protocol::D5))
        }
    }
}
