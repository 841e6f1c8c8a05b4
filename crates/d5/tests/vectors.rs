//! Runs the golden vectors of `host-tests/vectors/d5*.txt`.

use codec::testing::{CanFrame, Vector, vectors};
use d5::serial::Deframer;
use d5::{BuildError, COMMANDS, DecodeError, REGISTERS, Reply, Request, can, decode_frame};
use embedded_can::Id;

const VECTORS: &str = include_str!("../../../host-tests/vectors/d5.txt");
const MISPRINTS: &str = include_str!("../../../host-tests/vectors/d5-misprints.txt");
/// Changes with every vector added or removed, so that none goes missing unseen.
const COUNT: usize = 122;
const MISPRINT_COUNT: usize = 6;

#[test]
fn every_vector_decodes_to_its_meaning_and_back() {
    let vectors = vectors(VECTORS);
    for vector in &vectors {
        match vector.direction {
            "request" => {
                let decoded = can::decode_request(&vector.frame());
                let address = decoded.map(|(address, _)| address);
                vector.check(decoded.map(|(_, request)| request), |request| {
                    can::request::<CanFrame>(
                        Id::Standard(vector.id),
                        address.expect("decoded"),
                        request,
                    )
                });
            }
            "reply" | "event" => {
                let decoded = can::decode_reply(&vector.frame());
                let node = decoded.map(|(node, _)| node);
                vector.check(decoded.map(|(_, reply)| reply), |reply| {
                    can::reply::<CanFrame>(Id::Standard(vector.id), node.expect("decoded"), reply)
                });
            }
            other => panic!("{}: direction {other}", vector.label),
        }
    }
    assert_eq!(vectors.len(), COUNT);
}

/// The CAN frame and the frame on a serial line are the same bytes: whatever has the right checksum
/// is found.
#[test]
fn every_vector_is_found_on_a_serial_line() {
    for vector in vectors(VECTORS) {
        let bytes: [u8; 8] = vector.data.as_slice().try_into().expect("eight bytes");
        let is_whole = !vector.meaning.starts_with("Err(Checksum")
            && !vector.meaning.starts_with("Err(Length");
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
            "request" => {
                can::decode_request(&vector.frame()).map(|(_, request)| format!("{request:?}"))
            }
            _ => can::decode_reply(&vector.frame()).map(|(_, reply)| format!("{reply:?}")),
        };
        let shown = shown.unwrap_or_else(|error: DecodeError| format!("Err({error:?})"));
        assert_eq!(shown, vector.meaning, "{}", vector.label);
    }
    assert_eq!(misprints.len(), MISPRINT_COUNT);
}

#[test]
fn every_command_has_a_request_and_a_reply() {
    let vectors = vectors(VECTORS);
    let request =
        |vector: &Vector| can::decode_request(&vector.frame()).ok().map(|(_, request)| request);
    let reply = |vector: &Vector| can::decode_reply(&vector.frame()).ok().map(|(_, reply)| reply);
    let requests: Vec<Request> =
        vectors.iter().filter(|vector| vector.direction == "request").filter_map(request).collect();
    let replies: Vec<Reply> =
        vectors.iter().filter(|vector| vector.direction != "request").filter_map(reply).collect();
    for info in COMMANDS {
        let fields = |field: &str| Some(if field == "bytes" { 1.0 } else { 16.0 });
        assert_ne!(
            Request::build(info.name, &fields),
            Err(BuildError::UnknownCommand),
            "{}",
            info.name
        );
        assert!(
            requests.iter().any(|request| request.name() == info.name),
            "no request {}",
            info.name
        );
        assert!(replies.iter().any(|reply| reply.name() == info.name), "no reply {}", info.name);
    }
    for name in ["id", "command", "checksum"] {
        let is_it =
            |reply: &Reply| matches!(reply, Reply::Error { error, .. } if error.name() == name);
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
        let read = |vector: &&Vector| match can::decode_reply(&vector.frame()) {
            Ok((_, Reply::Read { register, value })) => {
                register == info.register && info.decode(value).is_some()
            }
            _ => false,
        };
        assert!(vectors.iter().any(|vector| read(&vector)), "{}", info.name);
    }
}
