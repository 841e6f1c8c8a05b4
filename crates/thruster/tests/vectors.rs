//! Runs the vectors of `host-tests/vectors/thruster*.txt`.

use std::collections::BTreeSet;

use codec_testing::{Codec, Decoded, Vector, Wire, check, vectors};
use thruster::{
    Answer, BuildError, COMMANDS, Headerless, Node, Payload, Reply, Request, answer, can,
};

/// The frames that the manual prints, and those of its tables.
const GOLDEN: &str = include_str!("../../../host-tests/vectors/thruster.txt");
/// Misprints, edges, refusals, answers, and what tools build and show.
const CASES: &str = include_str!("../../../host-tests/vectors/thruster-cases.txt");

struct Thruster;

fn received(frame: &Wire) -> Result<(Node, Reply), String> {
    match frame {
        Wire::Can(frame) => can::decode_reply(frame).map_err(|error| format!("{error:?}")),
        Wire::TooLong(data) | Wire::Serial(data) => {
            Err(format!("{:?}", Reply::decode(data).unwrap_err()))
        }
    }
}

fn sent(frame: &Wire) -> Result<(Node, Request), String> {
    match frame {
        Wire::Can(frame) => can::decode_request(frame).map_err(|error| format!("{error:?}")),
        Wire::TooLong(data) | Wire::Serial(data) => {
            Err(format!("{:?}", Request::decode(data).unwrap_err()))
        }
    }
}

impl Codec for Thruster {
    fn decode(vector: &Vector<'_>, frame: &Wire) -> Result<Decoded, String> {
        if vector.kind == "headerless" {
            let decoded = can::decode_headerless(frame.can());
            let (node, values) = decoded.map_err(|error| format!("{error:?}"))?;
            let encoded = can::headerless(node, &values).map(Wire::Can);
            return Ok(Decoded::new(&values, encoded, Headerless::NAME, &|visit| {
                values.visit_fields(visit);
            }));
        }
        if vector.kind.ends_with("request") {
            let (node, request) = sent(frame)?;
            let encoded = can::request(node, &request).map(Wire::Can);
            return Ok(Decoded::new(&request, encoded, request.name(), &|visit| {
                request.visit_fields(visit);
            }));
        }
        let (node, reply) = received(frame)?;
        let encoded = can::reply(node, &reply).map(Wire::Can);
        Ok(Decoded::new(&reply, encoded, reply.name(), &|visit| reply.visit_fields(visit)))
    }

    fn answer(request: &Wire, reply: &Wire, _: bool) -> String {
        let (_, request) = sent(request).expect("a request");
        let (_, reply) = received(reply).expect("a reply");
        match answer(&request, &reply) {
            Answer::Reply(answer) if answer == reply => "Reply".into(),
            outcome => format!("{outcome:?}"),
        }
    }

    fn build(_: &str, name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Wire, String> {
        let node = Node::new(0x0B).expect("1..=127");
        let request = Request::build(name, fields).map_err(|error| format!("{error:?}"))?;
        assert_eq!(request.name(), name);
        can::request(node, &request).map(Wire::Can).map_err(|error| format!("{error:?}"))
    }
}

#[test]
fn golden_vectors() {
    check::<Thruster>(GOLDEN, 118);
    let sections = vectors(GOLDEN).map(|vector| vector.source);
    assert!(sections.into_iter().all(|source| source.contains("Thruster manual §")));
}

#[test]
fn cases() {
    check::<Thruster>(CASES, 179);
}

/// A command that only devices send is one that cannot be built.
#[test]
fn no_command_lacks_a_vector() {
    let of = |vector: Vector<'_>| {
        let decoded = vector.decode::<Thruster>().ok()?;
        Some((decoded.name, vector.kind == "request"))
    };
    let seen: BTreeSet<_> = vectors(GOLDEN).filter_map(of).collect();
    for info in COMMANDS {
        let is_sent = Request::build(info.name, &|_| None) != Err(BuildError::UnknownCommand);
        assert_eq!(seen.contains(&(info.name, true)), is_sent, "request {}", info.name);
        assert!(seen.contains(&(info.name, false)), "no reply {}", info.name);
    }
    assert!(seen.contains(&("unknown", true)) && seen.contains(&("unknown", false)));
}

/// Thruster manual §1.3: every set command can be refused; queries cannot.
#[test]
fn refusals_have_the_name_of_what_they_refuse() {
    for info in COMMANDS {
        let built = [10.0, 0.0, 1.0].map(|value| Request::build(info.name, &|_| Some(value)));
        let Some(request) = built.into_iter().find_map(Result::ok) else { continue };
        let payload = request.encode().expect(info.name);
        let mut bytes = [0, 0, 0, 0, 0x00, 0x00, 0xEE, 0xEE];
        bytes[..4].copy_from_slice(&payload.as_slice()[..4]);
        let reply = Reply::decode(&bytes).expect(info.name);
        let is_query = info.name.starts_with("read_");
        assert_eq!(matches!(reply, Reply::Refused { .. }), !is_query, "{}", info.name);
        assert_eq!(reply.name(), info.name);
        assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
    }
}
