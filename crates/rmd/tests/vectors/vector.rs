//! Lines of vector files, and what the codec makes of them.

use std::fmt::Debug;

use embedded_can::{Frame, Id, StandardId};
use rmd::{DecodeError, EncodeError, Reply, Request, Target, can, rs485};

use codec::testing::CanFrame;

/// One line: `label | kind | bus | hex | meaning | section`.
pub struct Vector<'a> {
    pub label: &'a str,
    pub kind: &'a str,
    pub bus: &'a str,
    pub hex: &'a str,
    pub meaning: &'a str,
    pub section: &'a str,
}

/// A decoded frame: its Debug text, the command's name, and the frame it is encoded to.
pub struct Decoded {
    pub debug: String,
    pub name: &'static str,
    pub encoded: Result<String, EncodeError>,
}

/// The vectors of a file.
pub fn vectors(file: &str) -> impl Iterator<Item = Vector<'_>> {
    let lines = file.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| parse(line).unwrap_or_else(|| panic!("six columns expected: {line}")))
}

/// The meaning may itself hold `|`, so it is what the five other columns leave.
fn parse(line: &str) -> Option<Vector<'_>> {
    let mut columns = line.splitn(5, " | ");
    let (label, kind, bus, hex) =
        (columns.next()?, columns.next()?, columns.next()?, columns.next()?);
    let (meaning, section) = columns.next()?.rsplit_once(" | ")?;
    Some(Vector { label, kind, bus, hex, meaning, section })
}

impl Vector<'_> {
    /// Decodes in the stated direction and encodes again. On RS485 the bytes hold exactly one
    /// frame.
    pub fn decode(&self) -> Result<Decoded, DecodeError> {
        match (self.bus, self.kind) {
            ("can", "request") => {
                can::decode_any_request(&candump(self.hex)).map(|(target, request)| {
                    let frame = match target {
                        Target::Node(node) => can::request(node, &request),
                        Target::All => can::broadcast(&request),
                    };
                    Decoded::request(&request, frame.map(|frame| to_candump(&frame)))
                })
            }
            ("can", "reply" | "event") => {
                can::decode_reply(&candump(self.hex)).map(|(node, reply)| {
                    self.check_kind(&reply);
                    Decoded::reply(&reply, can::reply(node, &reply).map(|frame| to_candump(&frame)))
                })
            }
            ("rs485", "request") => {
                rs485::decode_any_request(&self.frame()).map(|(target, request)| {
                    let frame = match target {
                        Target::Node(node) => rs485::request(node, &request),
                        Target::All => rs485::broadcast(&request),
                    };
                    Decoded::request(&request, frame.map(|frame| hex(&frame)))
                })
            }
            ("rs485", "reply" | "event") => {
                rs485::decode_reply(&self.frame()).map(|(node, reply)| {
                    self.check_kind(&reply);
                    Decoded::reply(&reply, rs485::reply(node, &reply).map(|frame| hex(&frame)))
                })
            }
            (bus, kind) => panic!("{}: no {kind} on {bus}", self.label),
        }
    }

    /// The RS485 frames that the deframer finds, which are also those of the scan.
    pub fn frames(&self) -> Vec<[u8; rs485::FRAME_LEN]> {
        let received = bytes(self.hex);
        let frames: Vec<_> = rs485::Deframer::new().push_slice(&received).collect();
        let scanned = rs485::Scan::new(&received).filter_map(|piece| match piece {
            rs485::Piece::Frame(frame) => Some(*frame),
            rs485::Piece::Garbage(_) => None,
        });
        assert!(scanned.eq(frames.iter().copied()), "{}", self.label);
        frames
    }

    fn frame(&self) -> [u8; rs485::FRAME_LEN] {
        let frames = self.frames();
        assert_eq!((frames.len(), self.hex.len()), (1, 2 * rs485::FRAME_LEN), "{}", self.label);
        frames[0]
    }

    fn check_kind(&self, reply: &Reply) {
        assert_eq!(reply.is_event(), self.kind == "event", "{}", self.label);
    }
}

impl Decoded {
    fn request(request: &Request, encoded: Result<String, EncodeError>) -> Decoded {
        Decoded::of(request, request.name(), encoded)
    }

    fn reply(reply: &Reply, encoded: Result<String, EncodeError>) -> Decoded {
        Decoded::of(reply, reply.name(), encoded)
    }

    fn of(value: &dyn Debug, name: &'static str, encoded: Result<String, EncodeError>) -> Decoded {
        Decoded { debug: format!("{value:?}"), name, encoded }
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    assert!(hex.len().is_multiple_of(2), "{hex}: half a byte");
    (0..hex.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex"))
        .collect()
}

fn candump(hex: &str) -> CanFrame {
    let (id, data) = hex.split_once('#').expect("id#data");
    let id = StandardId::new(u16::from_str_radix(id, 16).expect("hex")).expect("11 bits");
    CanFrame::new(id, &bytes(data)).expect("at most 8 bytes")
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn to_candump(frame: &CanFrame) -> String {
    let Id::Standard(id) = frame.id() else { panic!("extended id") };
    format!("{:03X}#{}", id.as_raw(), hex(frame.data()))
}
