//! Runs the golden vectors of `host-tests/vectors/d5.txt`.

mod frame;

use d5::{can, command};
use embedded_can::{Frame, StandardId};
use frame::CanFrame;

const VECTORS: &str = include_str!("../../../host-tests/vectors/d5.txt");
const COUNT: usize = 55;
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

fn vectors() -> Vec<Vector<'static>> {
    VECTORS.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).map(parse).collect()
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
    let vectors = vectors();
    for vector in &vectors {
        match vector.direction {
            "request" => {
                let decoded = can::decode_request(&vector.frame);
                let address = decoded.map(|(address, _)| address);
                check(vector, decoded.map(|(_, request)| request), |request| {
                    can::request::<CanFrame>(vector.frame.id(), address.expect("decoded"), request)
                });
            }
            "reply" => {
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

#[test]
fn every_command_has_a_request_and_a_reply() {
    use command::{ASYNC_WRITE, EXECUTE, QUERY_ID, READ, RESET, RESET_DONE, WRITE};

    let vectors = vectors();
    let commands = |direction: &str| -> Vec<u8> {
        let sent = vectors.iter().filter(|vector| vector.direction == direction);
        sent.filter_map(|vector| match direction {
            "request" => can::decode_request(&vector.frame).ok().map(|(_, request)| request.command()),
            _ => can::decode_reply(&vector.frame).ok().map(|(_, reply)| reply.command()),
        })
        .collect()
    };
    let (requests, replies) = (commands("request"), commands("reply"));
    for (request, reply) in [
        (QUERY_ID, QUERY_ID),
        (READ, READ),
        (WRITE, WRITE),
        (ASYNC_WRITE, ASYNC_WRITE),
        (EXECUTE, EXECUTE),
        (RESET, RESET_DONE),
    ] {
        assert!(requests.contains(&request), "no request {request:#04x}");
        assert!(replies.contains(&reply), "no reply {reply:#04x}");
    }
}
