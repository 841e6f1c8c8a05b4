//! Runs the golden vectors of `host-tests/vectors/thruster*.txt`.

use codec::testing::{CanFrame, Vector, vectors};
use thruster::{BuildError, COMMANDS, Payload, Reply, Request, can};

const VECTORS: &str = include_str!("../../../host-tests/vectors/thruster.txt");
const MISPRINTS: &str = include_str!("../../../host-tests/vectors/thruster-misprints.txt");
const HEADERLESS: &str = include_str!("../../../host-tests/vectors/thruster-headerless.txt");
/// Changes with every vector added or removed, so that none goes missing unseen.
const COUNT: usize = 118;
const MISPRINT_COUNT: usize = 10;
const HEADERLESS_COUNT: usize = 3;

#[test]
fn every_vector_decodes_to_its_meaning_and_back() {
    let vectors = vectors(VECTORS);
    for vector in &vectors {
        match vector.direction {
            "request" => {
                let decoded = can::decode_request(&vector.frame());
                let node = decoded.map(|(node, _)| node);
                vector.check(decoded.map(|(_, request)| request), |request| {
                    can::request::<CanFrame>(node.expect("decoded"), request)
                });
            }
            "reply" | "event" => {
                let decoded = can::decode_reply(&vector.frame());
                let node = decoded.map(|(node, _)| node);
                vector.check(decoded.map(|(_, reply)| reply), |reply| {
                    can::reply::<CanFrame>(node.expect("decoded"), reply)
                });
            }
            other => panic!("{}: direction {other}", vector.label),
        }
    }
    assert_eq!(vectors.len(), COUNT);
}

#[test]
fn frames_without_a_header_decode_when_asked_and_back() {
    let vectors = vectors(HEADERLESS);
    for vector in &vectors {
        let (node, values) = can::decode_headerless(&vector.frame()).expect(vector.label);
        vector.check(Ok::<_, ()>(values), |values| can::headerless::<CanFrame>(node, values));
    }
    assert_eq!(vectors.len(), HEADERLESS_COUNT);
}

/// Printed nine-byte rows fit no frame, so the data alone are decoded.
#[test]
fn misprints_decode_to_what_holds() {
    let misprints = vectors(MISPRINTS);
    for vector in &misprints {
        let shown = match vector.direction {
            "request" => Request::decode(&vector.data).map(|request| format!("{request:?}")),
            _ => Reply::decode(&vector.data).map(|reply| format!("{reply:?}")),
        };
        let shown = shown.unwrap_or_else(|error| format!("Err({error:?})"));
        assert_eq!(shown, vector.meaning, "{}", vector.label);
    }
    assert_eq!(misprints.len(), MISPRINT_COUNT);
}

/// A command that only devices send is one that cannot be built.
#[test]
fn every_command_has_a_request_and_a_reply() {
    let vectors = vectors(VECTORS);
    let names =
        |direction: fn(&str) -> bool, name: fn(&Vector) -> &'static str| -> Vec<&'static str> {
            vectors.iter().filter(|vector| direction(vector.direction)).map(name).collect()
        };
    let requests = names(
        |direction| direction == "request",
        |vector| Request::decode(&vector.data).map_or("", |request| request.name()),
    );
    let replies = names(
        |direction| direction != "request",
        |vector| Reply::decode(&vector.data).map_or("", |reply| reply.name()),
    );
    for info in COMMANDS {
        let is_sent = Request::build(info.name, &|_| None) != Err(BuildError::UnknownCommand);
        assert_eq!(is_sent, requests.contains(&info.name), "request {}", info.name);
        assert!(replies.contains(&info.name), "no reply {}", info.name);
    }
    assert!(requests.contains(&"unknown") && replies.contains(&"unknown"));
}

/// Thruster manual §1.3: every set command can be refused; queries cannot.
#[test]
fn refusals_have_the_name_of_what_they_refuse() {
    for info in COMMANDS {
        let Ok(request) = Request::build(info.name, &|field| {
            Some(if field == "bitrate_kbps" { 10.0 } else { 0.0 })
        })
        .or_else(|_| Request::build(info.name, &|_| Some(1.0))) else {
            continue;
        };
        let mut bytes = [0; 8];
        let payload = request.encode().expect(info.name);
        bytes[..4].copy_from_slice(&payload.as_slice()[..4]);
        bytes[4..].copy_from_slice(&[0x00, 0x00, 0xEE, 0xEE]);
        let reply = Reply::decode(&bytes).expect(info.name);
        let is_query = info.name.starts_with("read_");
        assert_eq!(matches!(reply, Reply::Refused { .. }), !is_query, "{}", info.name);
        assert_eq!(reply.name(), info.name);
        assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
    }
}
