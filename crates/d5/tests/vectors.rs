//! Runs the golden vectors of `host-tests/vectors/d5*.txt`.

use codec::testing::CanFrame;
use d5::serial::Deframer;
use d5::{BuildError, COMMANDS, DecodeError, REGISTERS, Reply, Request, can, decode_frame};
use embedded_can::{Frame, StandardId};

const VECTORS: &str = include_str!("../../../host-tests/vectors/d5.txt");
const MISPRINTS: &str = include_str!("../../../host-tests/vectors/d5-misprints.txt");
/// Changes with every vector added or removed, so that none goes missing unseen.
const COUNT: usize = 86;
const MISPRINT_COUNT: usize = 6;
/// In the source column: accepted, but not the form that is sent.
const DECODE_ONLY: &str = "decode only";

struct Vector<'a> {
    label: &'a str,
    direction: &'a str,
    frame: CanFrame,
    meaning: &'a str,
    source: &'a str,
}

/// A column may hold ` | ` only in the meaning, so the outer columns are split off first.
fn parse(line: &str) -> Vector<'_> {
    let mut columns = line.splitn(5, " | ");
    let mut column = || columns.next().unwrap_or_else(|| panic!("too few columns: {line}"));
    let (label, direction, transport, hex, rest) = (column(), column(), column(), column(), column());
    assert_eq!(transport, "can", "{label}");
    let (meaning, source) = rest.rsplit_once(" | ").unwrap_or_else(|| panic!("too few columns: {line}"));
    Vector { label, direction, frame: candump(hex), meaning, source }
}

fn candump(text: &str) -> CanFrame {
    let (id, data) = text.split_once('#').expect("id#data");
    let id = StandardId::new(u16::from_str_radix(id, 16).expect("hex id")).expect("standard id");
    assert!(data.is_ascii() && data.len() % 2 == 0, "{text}");
    let bytes: Vec<u8> = (0..data.len())
        .step_by(2)
        .map(|start| u8::from_str_radix(&data[start..start + 2], 16).expect("hex data"))
        .collect();
    CanFrame::new(id, &bytes).expect("at most eight bytes")
}

fn vectors(text: &str) -> Vec<Vector<'_>> {
    text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).map(parse).collect()
}

/// Compares the decoded value with the meaning and, if it is one that is sent, the bytes with its encoding.
fn check<T: core::fmt::Debug, D: core::fmt::Debug, E: core::fmt::Debug>(
    vector: &Vector,
    decoded: Result<T, D>,
    encode: impl FnOnce(&T) -> Result<CanFrame, E>,
) {
    let label = vector.label;
    let value = match decoded {
        Ok(value) => value,
        Err(error) => return assert_eq!(format!("Err({error:?})"), vector.meaning, "{label}"),
    };
    assert_eq!(format!("{value:?}"), vector.meaning, "{label}");
    let encoded = encode(&value);
    let is_sent_form = matches!(&encoded, Ok(frame) if *frame == vector.frame);
    assert_eq!(is_sent_form, !vector.source.contains(DECODE_ONLY), "{label}: encoded to {encoded:?}");
}

#[test]
fn every_vector_decodes_to_its_meaning_and_back() {
    let vectors = vectors(VECTORS);
    for vector in &vectors {
        match vector.direction {
            "request" => {
                let decoded = can::decode_request(&vector.frame);
                let address = decoded.map(|(address, _)| address);
                check(vector, decoded.map(|(_, request)| request), |request| {
                    can::request::<CanFrame>(vector.frame.id(), address.expect("decoded"), request)
                });
            }
            "reply" | "event" => {
                let decoded = can::decode_reply(&vector.frame);
                let node = decoded.map(|(node, _)| node);
                check(vector, decoded.map(|(_, reply)| reply), |reply| {
                    can::reply::<CanFrame>(vector.frame.id(), node.expect("decoded"), reply)
                });
            }
            other => panic!("{}: direction {other}", vector.label),
        }
    }
    assert_eq!(vectors.len(), COUNT);
}

/// The CAN frame and the frame on a serial line are the same bytes: whatever has the right checksum is found.
#[test]
fn every_vector_is_found_on_a_serial_line() {
    for vector in vectors(VECTORS) {
        let bytes: [u8; 8] = vector.frame.data().try_into().expect("eight bytes");
        let is_whole =
            !vector.meaning.starts_with("Err(Checksum") && !vector.meaning.starts_with("Err(Length");
        let mut deframer = Deframer::new();
        let line = [&[0x5D, 0xD5, 0x05][..], &bytes].concat();
        let found: Vec<_> = deframer.push_slice(&line).collect();
        assert_eq!(found, if is_whole { vec![bytes] } else { vec![] }, "{}", vector.label);
        if is_whole && !vector.meaning.starts_with("Err") {
            assert!(decode_frame(&bytes).is_ok(), "{}", vector.label);
        }
    }
}

#[test]
fn misprints_decode_to_what_holds() {
    let misprints = vectors(MISPRINTS);
    for vector in &misprints {
        let shown = match vector.direction {
            "request" => can::decode_request(&vector.frame).map(|(_, request)| format!("{request:?}")),
            _ => can::decode_reply(&vector.frame).map(|(_, reply)| format!("{reply:?}")),
        };
        let shown = shown.unwrap_or_else(|error: DecodeError| format!("Err({error:?})"));
        assert_eq!(shown, vector.meaning, "{}", vector.label);
    }
    assert_eq!(misprints.len(), MISPRINT_COUNT);
}

#[test]
fn every_command_has_a_request_and_a_reply() {
    let vectors = vectors(VECTORS);
    let request = |vector: &Vector| can::decode_request(&vector.frame).ok().map(|(_, request)| request);
    let reply = |vector: &Vector| can::decode_reply(&vector.frame).ok().map(|(_, reply)| reply);
    let requests: Vec<Request> =
        vectors.iter().filter(|vector| vector.direction == "request").filter_map(request).collect();
    let replies: Vec<Reply> =
        vectors.iter().filter(|vector| vector.direction != "request").filter_map(reply).collect();
    for info in COMMANDS {
        let fields = |field: &str| Some(if field == "bytes" { 1.0 } else { 16.0 });
        assert_ne!(Request::build(info.name, &fields), Err(BuildError::UnknownCommand), "{}", info.name);
        assert!(requests.iter().any(|request| request.name() == info.name), "no request {}", info.name);
        assert!(replies.iter().any(|reply| reply.name() == info.name), "no reply {}", info.name);
    }
    for name in ["id", "command", "checksum"] {
        let is_it = |reply: &Reply| matches!(reply, Reply::Error { error, .. } if error.name() == name);
        assert!(replies.iter().any(is_it), "no {name} error");
    }
    assert!(requests.iter().any(|request| request.name() == "unknown"));
    assert!(replies.iter().any(|reply| reply.name() == "unknown"));
}

/// Every kind of register value is read or written by a vector.
#[test]
fn every_coded_register_has_a_vector() {
    let vectors = vectors(VECTORS);
    for info in REGISTERS.iter().filter(|info| info.field != info.name) {
        let read = |vector: &&Vector| match can::decode_reply(&vector.frame) {
            Ok((_, Reply::Read { register, value })) => {
                register == info.register && info.decode(value).is_some()
            }
            _ => false,
        };
        assert!(vectors.iter().any(|vector| read(&vector)), "{}", info.name);
    }
}
