//! Runs the vectors of `host-tests/vectors/rmd*.txt`. A kind may begin with a dialect.

use std::collections::BTreeSet;

use codec_testing::{Codec, Decoded, Vector, Wire, check, found_on_line, vectors};
use rmd::rs485::{FRAME_LEN, Piece, Rs485Framing, Scan};
use rmd::{
    Answer, COMMANDS, CommandInfo, Dialect, Node, Reply, Request, Target, answer, answer_on_line,
    can, rs485,
};

/// The frames that the manual prints, and those of its tables.
const GOLDEN: &str = include_str!("../../../host-tests/vectors/rmd.txt");
/// Misprints, edges, refusals, answers, and what tools build and show.
const CASES: &str = include_str!("../../../host-tests/vectors/rmd-cases.txt");

/// What newer dialects have in another form, and what a dialect refuses.
const DIALECTS: &str = include_str!("../../../host-tests/vectors/rmd-dialects.txt");

const DIALECT_LINES: usize = 240;

/// The rows of bytes that the manual prints for CAN: 90 of §2 to §4 and the two frames of §5.4.
const PRINTED: usize = 92;

struct Rmd;

/// The dialect that a kind begins with.
fn dialect(kind: &str) -> Option<Dialect> {
    Dialect::ALL.into_iter().find(|dialect| Some(dialect.name()) == kind.split(' ').next())
}

fn received(kind: &str, frame: &Wire) -> Result<(Node, Reply), String> {
    match (frame, dialect(kind)) {
        (Wire::Can(frame), None) => can::decode_reply(frame),
        (Wire::Can(frame), Some(dialect)) => can::decode_reply_in(dialect, frame),
        (Wire::TooLong(data), _) => return Err(format!("{:?}", Reply::decode(data).unwrap_err())),
        (frame, None) => rs485::decode_reply(frame.serial()),
        (frame, Some(dialect)) => rs485::decode_reply_in(dialect, frame.serial()),
    }
    .map_err(|error| format!("{error:?}"))
}

/// What is for a single motor is decoded as that, too.
fn sent(frame: &Wire) -> Result<(Target, Request), String> {
    let (any, single) = match frame {
        Wire::Can(frame) => (can::decode_any_request(frame), can::decode_request(frame)),
        frame => {
            let frame = frame.serial();
            (rs485::decode_any_request(frame), rs485::decode_request(frame))
        }
    };
    match any {
        Ok((Target::Node(node), request)) => assert_eq!(single, Ok((node, request))),
        _ => assert!(single.is_err(), "{single:?}"),
    }
    any.map_err(|error| format!("{error:?}"))
}

/// Whether its CAN id, not its data, tells it.
fn is_under_own_id(request: &Request) -> bool {
    matches!(request, Request::MotionMode { .. } | Request::ReadCanId | Request::SetCanId { .. })
}

fn to_serial(frame: [u8; FRAME_LEN]) -> Wire {
    Wire::Serial(frame.into())
}

impl Codec for Rmd {
    fn decode(vector: &Vector<'_>, frame: &Wire) -> Result<Decoded, String> {
        if vector.kind.ends_with("request") {
            let (target, mut request) = sent(frame)?;
            if let Some(dialect) = dialect(vector.kind) {
                if let (Wire::Can(frame), false) = (frame, is_under_own_id(&request)) {
                    let data = frame.data().try_into().expect("eight bytes");
                    request = Request::decode_in(dialect, data);
                }
                request.encode_in(dialect).map_err(|error| format!("{error:?}"))?;
            }
            let encoded = match (vector.bus, target) {
                ("can", Target::Node(node)) => can::request(node, &request).map(Wire::Can),
                ("can", Target::All) => can::broadcast(&request).map(Wire::Can),
                (_, Target::Node(node)) => rs485::request(node, &request).map(to_serial),
                (_, Target::All) => rs485::broadcast(&request).map(to_serial),
            };
            return Ok(Decoded::new(&request, encoded, request.name(), &|visit| {
                request.visit_fields(visit);
            }));
        }
        let (node, reply) = received(vector.kind, frame)?;
        assert_eq!(reply.is_event(), vector.kind == "event", "{vector:?}");
        let encoded = match vector.bus {
            "can" => can::reply(node, &reply).map(Wire::Can),
            _ => rs485::reply(node, &reply).map(to_serial),
        };
        Ok(Decoded::new(&reply, encoded, reply.name(), &|visit| reply.visit_fields(visit)))
    }

    fn answer(request: &Wire, reply: &Wire, echo_due: bool) -> String {
        let ((target, request), (from, reply)) =
            (sent(request).expect("a request"), received("", reply).expect("a reply"));
        if let Target::Node(node) = target {
            assert_eq!(request.answering_node(node), Some(from), "{request:?}");
        }
        let outcome = answer_on_line(&request, &reply, echo_due);
        assert!(echo_due || outcome == answer(&request, &reply));
        match outcome {
            Answer::Reply(answer) if answer == reply => "Reply".into(),
            outcome => format!("{outcome:?}"),
        }
    }

    fn build(bus: &str, name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Wire, String> {
        let node = Node::new(1).expect("1..=32");
        let request = Request::build(name, fields).map_err(|error| format!("{error:?}"))?;
        assert_eq!(request.name(), name);
        match bus {
            "can" => can::request(node, &request).map(Wire::Can),
            _ => rs485::request(node, &request).map(to_serial),
        }
        .map_err(|error| format!("{error:?}"))
    }

    /// The scan finds the same frames and garbage.
    fn line(pieces: &[Vec<u8>]) -> String {
        let found = found_on_line::<Rs485Framing, FRAME_LEN>(pieces);
        let bytes = pieces.concat();
        let mut scan = Scan::new(&bytes);
        let (mut scanned, mut garbage) = (String::new(), 0);
        for piece in scan.by_ref() {
            match piece {
                Piece::Frame(frame) => scanned += &format!("{} ", to_serial(*frame)),
                Piece::Garbage(bytes) => garbage += bytes.len(),
            }
        }
        assert_eq!(found, format!("{scanned}rejected {garbage} pending {}", scan.rest().len()));
        found
    }
}

#[test]
fn golden_vectors() {
    check::<Rmd>(GOLDEN, 283);
    let is_printed = |vector: &Vector<'_>| {
        assert!(vector.source.contains("RMD V3.6") || vector.source.contains("observed"));
        vector.bus == "can" && !vector.source.starts_with("derived")
    };
    assert_eq!(vectors(GOLDEN).filter(is_printed).count(), PRINTED);
}

#[test]
fn cases() {
    check::<Rmd>(CASES, 236);
}

#[test]
fn dialects() {
    check::<Rmd>(DIALECTS, DIALECT_LINES);
}

/// Where a command can be sent, and whether a reply belongs to it.
fn expected(info: &CommandInfo) -> Vec<(&'static str, &'static str)> {
    let buses: &[&str] = match info.name {
        "read_can_id" | "set_can_id" | "motion_mode" => &["can"],
        "read_rs485_id" | "set_rs485_id" => &["rs485"],
        // Beside V3.6 one bus will do: the data are the same.
        _ if !info.section.starts_with("RMD V3.6") && !info.section.starts_with("not") => &["can"],
        _ => &["can", "rs485"],
    };
    let kinds: &[&str] = match info.name {
        "timeout_notice" => &["event"],
        // Velocity has the reply.
        "reset" | "set_active_reply" | "capped_velocity" => &["request"],
        _ => &["request", "reply"],
    };
    kinds.iter().flat_map(|kind| buses.iter().map(|bus| (*kind, *bus))).collect()
}

#[test]
fn no_command_lacks_a_vector() {
    let of = |vector: Vector<'_>| {
        let name = vector.decode::<Rmd>().expect(vector.label).name;
        let kind = vector.kind.rsplit(' ').next().unwrap_or_default();
        (name, kind.to_owned(), vector.bus.to_owned())
    };
    let allowed = |vector: &Vector<'_>| !vector.outcome.starts_with("Err");
    let seen: BTreeSet<_> =
        vectors(GOLDEN).chain(vectors(DIALECTS)).filter(allowed).map(of).collect();
    for info in COMMANDS {
        for (kind, bus) in expected(info) {
            let wanted = (info.name, kind.to_owned(), bus.to_owned());
            assert!(seen.contains(&wanted), "{wanted:?}");
        }
    }
}
