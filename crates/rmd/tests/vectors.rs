//! Runs the golden vectors of `host-tests/vectors/rmd.txt`: decode, compare, encode, compare.

mod frame;

use std::collections::BTreeSet;

use embedded_can::{Frame, Id, StandardId};
use frame::CanFrame;
use rmd::{Reply, Request, can, command, rs485};

const VECTORS: &str = include_str!("../../../host-tests/vectors/rmd.txt");
/// Changes with every vector added or removed, so that none goes missing unseen.
const COUNT: usize = 69;
/// Commands with a variant of their own; each needs a request and a reply.
const COMMANDS: [u8; 11] = [
    command::READ_MULTI_TURN_ANGLE,
    command::READ_STATUS_1,
    command::READ_STATUS_2,
    command::SHUTDOWN,
    command::STOP,
    command::TORQUE_CURRENT,
    command::VELOCITY,
    command::ABSOLUTE_POSITION,
    command::RELEASE_BRAKE,
    command::LOCK_BRAKE,
    command::SET_COMMUNICATION_TIMEOUT,
];

struct Vector<'a> {
    label: &'a str,
    kind: &'a str,
    bus: &'a str,
    hex: &'a str,
    meaning: &'a str,
    section: &'a str,
}

/// The meaning may itself hold `|`, so it is what the five other columns leave.
fn parse(line: &str) -> Option<Vector<'_>> {
    let mut columns = line.splitn(5, " | ");
    let (label, kind, bus, hex) = (columns.next()?, columns.next()?, columns.next()?, columns.next()?);
    let (meaning, section) = columns.next()?.rsplit_once(" | ")?;
    Some(Vector { label, kind, bus, hex, meaning, section })
}

fn bytes(hex: &str) -> Vec<u8> {
    assert!(hex.len().is_multiple_of(2), "{hex}: half a byte");
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex")).collect()
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

/// Decodes in the stated direction: Debug of the value, the bytes encoded from it, its command.
fn run(vector: &Vector) -> (String, String, u8) {
    let shown = |value: &dyn core::fmt::Debug| format!("{value:?}");
    let request = |value: &Request| (shown(value), value.command());
    let reply = |value: &Reply| (shown(value), value.command());
    let ((debug, command), encoded) = match (vector.bus, vector.kind) {
        ("can", "request") => {
            let (node, value) = can::decode_request(&candump(vector.hex)).expect(vector.label);
            (request(&value), to_candump(&can::request(node, &value).expect(vector.label)))
        }
        ("can", "reply" | "event") => {
            let (node, value) = can::decode_reply(&candump(vector.hex)).expect(vector.label);
            (reply(&value), to_candump(&can::reply(node, &value).expect(vector.label)))
        }
        ("rs485", kind @ ("request" | "reply" | "event")) => {
            let received = bytes(vector.hex);
            let mut deframer = rs485::Deframer::new();
            let frames: Vec<_> = deframer.push_slice(&received).collect();
            assert_eq!(
                (frames.len(), deframer.rejected(), deframer.pending()),
                (1, 0, 0),
                "{}",
                vector.label
            );
            if kind == "request" {
                let (node, value) = rs485::decode_request(&frames[0]).expect(vector.label);
                (request(&value), hex(&rs485::request(node, &value).expect(vector.label)))
            } else {
                let (node, value) = rs485::decode_reply(&frames[0]).expect(vector.label);
                (reply(&value), hex(&rs485::reply(node, &value).expect(vector.label)))
            }
        }
        (bus, kind) => panic!("{}: no {kind} on {bus}", vector.label),
    };
    (debug, encoded, command)
}

#[test]
fn golden_vectors() {
    let mut count = 0;
    let mut seen = BTreeSet::new();
    for line in VECTORS.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let vector = parse(line).unwrap_or_else(|| panic!("six columns expected: {line}"));
        let (debug, encoded, command) = run(&vector);
        assert_eq!(debug, vector.meaning, "{}", vector.label);
        assert_eq!(encoded, vector.hex, "{}", vector.label);
        assert!(!vector.section.is_empty(), "{}: no source", vector.label);
        seen.insert((vector.kind, vector.bus, command));
        count += 1;
    }
    assert_eq!(count, COUNT);
    for command in COMMANDS {
        for kind in ["request", "reply"] {
            for bus in ["can", "rs485"] {
                assert!(seen.contains(&(kind, bus, command)), "no {kind} of {command:#04x} on {bus}");
            }
        }
    }
    assert!(seen.contains(&("event", "can", command::TIMEOUT_NOTICE)));
}
