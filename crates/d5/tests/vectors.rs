//! Runs the vectors of `host-tests/vectors/d5*.txt`.

use std::collections::BTreeSet;

use codec_testing::{Codec, Decoded, Vector, Wire, check, found_on_line, vectors};
use d5::serial::SerialFraming;
use d5::{
    Address, Answer, BuildError, COMMANDS, FRAME_LEN, Node, REGISTERS, Reply, Request, answer, can,
    decode_reply_frame, decode_request_frame,
};

/// The frames that the manual prints, and those of its tables.
const GOLDEN: &str = include_str!("../../../host-tests/vectors/d5.txt");
/// Misprints, edges, refusals, answers, and what tools build and show.
const CASES: &str = include_str!("../../../host-tests/vectors/d5-cases.txt");

struct D5;

fn received(frame: &Wire) -> Result<(Node, Reply), String> {
    can::decode_reply(frame.can()).map_err(|error| format!("{error:?}"))
}

fn sent(frame: &Wire) -> Result<(Address, Request), String> {
    can::decode_request(frame.can()).map_err(|error| format!("{error:?}"))
}

impl Codec for D5 {
    fn decode(vector: &Vector<'_>, frame: &Wire) -> Result<Decoded, String> {
        let id = frame.can().id();
        if vector.kind.ends_with("request") {
            let (address, request) = sent(frame)?;
            let encoded = can::request(id, address, &request).map(Wire::Can);
            return Ok(Decoded::new(&request, encoded, request.name(), &|visit| {
                request.visit_fields(visit);
            }));
        }
        let (node, reply) = received(frame)?;
        let encoded = can::reply(id, node, &reply).map(Wire::Can);
        Ok(Decoded::new(&reply, encoded, reply.name(), &|visit| reply.visit_fields(visit)))
    }

    fn answer(request: &Wire, reply: &Wire, _: bool) -> String {
        let Ok((Address::Node(node), request)) = sent(request) else { panic!("{request}") };
        let (from, reply) = received(reply).expect("a reply");
        match answer(&request, node, from, &reply) {
            Answer::Reply(answer) if answer == reply => "Reply".into(),
            outcome => format!("{outcome:?}"),
        }
    }

    fn build(_: &str, name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Wire, String> {
        let request = Request::build(name, fields).map_err(|error| format!("{error:?}"))?;
        assert_eq!(request.name(), name);
        let frame = can::request(
            can::default_request_id(Node::FACTORY),
            Address::Node(Node::FACTORY),
            &request,
        );
        frame.map(Wire::Can).map_err(|error| format!("{error:?}"))
    }

    fn line(pieces: &[Vec<u8>]) -> String {
        found_on_line::<SerialFraming, FRAME_LEN>(pieces)
    }
}

#[test]
fn golden_vectors() {
    check::<D5>(GOLDEN, 122);
    assert!(vectors(GOLDEN).all(|vector| vector.source.contains("D5 manual, ")));
}

#[test]
fn cases() {
    check::<D5>(CASES, 172);
}

/// The CAN frame and the frame on a serial line are the same bytes: whatever has the right checksum
/// is found.
#[test]
fn every_vector_is_found_on_a_serial_line() {
    for vector in vectors(GOLDEN) {
        let frame: [u8; 8] = Wire::parse(vector.input).can().data().try_into().expect("8 bytes");
        let spoilt = ["Err(Checksum", "Err(Length"].map(|error| vector.outcome.starts_with(error));
        let found = D5::line(&[[&[0x5D, 0xD5, 0x05][..], &frame].concat()]);
        let hex = Wire::Serial(frame.into()).to_string();
        assert_eq!(found.contains(&hex), spoilt == [false; 2], "{vector:?}: {found}");
    }
}

#[test]
fn no_command_lacks_a_vector() {
    let of = |vector: Vector<'_>| {
        let decoded = vector.decode::<D5>().ok()?;
        Some((decoded.name, vector.kind == "request"))
    };
    let seen: BTreeSet<_> = vectors(GOLDEN).filter_map(of).collect();
    for name in COMMANDS.iter().map(|info| info.name).chain(["unknown"]) {
        assert!(seen.contains(&(name, true)) && seen.contains(&(name, false)), "{name}");
    }
    for info in COMMANDS {
        let fields = |field: &str| Some(if field == "bytes" { 1.0 } else { 16.0 });
        assert_ne!(Request::build(info.name, &fields), Err(BuildError::UnknownCommand));
    }
    for error in ["Id", "Command", "Checksum"] {
        let is_it = format!("Error {{ error: {error},");
        assert!(vectors(GOLDEN).any(|vector| vector.outcome.starts_with(&is_it)), "{error}");
    }
}

/// Every kind of register value is read by a vector.
#[test]
fn every_coded_register_has_a_vector() {
    for info in REGISTERS.iter().filter(|info| info.field != info.name) {
        let is_read = |vector: Vector<'_>| match received(&Wire::parse(vector.input)) {
            Ok((_, Reply::Read { register, value })) => {
                register == info.register && info.decode(value).is_some()
            }
            _ => false,
        };
        assert!(vectors(GOLDEN).any(is_read), "{}", info.name);
    }
}

/// The header tells requests from replies.
#[test]
fn a_frame_of_either_direction_is_told_by_its_header() {
    for vector in vectors(GOLDEN) {
        let frame = Wire::parse(vector.input).can().data().try_into().expect("8 bytes");
        let (message, request) = (d5::decode_frame(&frame), decode_request_frame(&frame));
        match decode_reply_frame(&frame) {
            Ok((node, reply)) => assert_eq!(message, Ok(d5::Message::Reply(node, reply))),
            Err(d5::DecodeError::Header { .. }) => {
                let request = request.map(|(to, request)| d5::Message::Request(to, request));
                assert_eq!(message, request);
            }
            Err(error) => assert_eq!(message, Err(error)),
        }
    }
}
