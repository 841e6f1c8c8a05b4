//! The golden vectors, read and written.

use std::collections::BTreeSet;

use host_protocol::{
    Deframer, ERRORS, EVENTS, Error, EventMessage, Frame, Kind, MAX_FRAME, REQUESTS, Reply,
    Request, encode_body,
};

const VECTORS: &str = include_str!("../../../host-tests/vectors/host-protocol.txt");

/// A golden frame decoded, named, printed and encoded again.
struct Read {
    kind: Kind,
    number: u16,
    name: &'static str,
    debug: String,
    frame: Vec<u8>,
}

fn lines() -> impl Iterator<Item = [&'static str; 3]> {
    VECTORS.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).map(|line| {
        let columns: Vec<_> = line.splitn(3, '|').map(str::trim).collect();
        columns.try_into().unwrap_or_else(|_| panic!("three columns: {line}"))
    })
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().chunks(2);
    digits.map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

fn read(frame: &Frame<'_>) -> Read {
    let Frame { kind, sequence, number, body, .. } = *frame;
    let mut out = [0; MAX_FRAME];
    let (name, debug, length) = match kind {
        Kind::Request => {
            let request = Request::decode(number, body).unwrap();
            (request.name(), format!("{request:?}"), request.encode_frame(sequence, &mut out))
        }
        Kind::WatcherRequest => {
            let request = Request::decode(number, body).unwrap();
            let length = encode_body(kind, sequence, number, body, &mut out);
            (request.name(), format!("for a watcher: {request:?}"), length)
        }
        Kind::Reply => {
            let reply = Reply::decode(number, body).unwrap();
            (reply.name(), format!("{reply:?}"), reply.encode_frame(sequence, &mut out))
        }
        Kind::Error => {
            let error = Error::decode(number, body).unwrap();
            (error.name(), format!("{error:?}"), error.encode_frame(sequence, &mut out))
        }
        Kind::Event => {
            let message = EventMessage::decode(number, body).unwrap();
            let EventMessage { dropped, time_us, event } = message;
            let length = event.encode_frame(sequence, dropped, time_us, &mut out);
            (event.name(), format!("{message:?}"), length)
        }
    };
    Read { kind, number, name, debug, frame: out[..length.unwrap()].to_vec() }
}

fn read_line([label, hex, _]: [&str; 3]) -> Read {
    let mut deframer = Deframer::new();
    let frames: Vec<_> = bytes(hex)
        .into_iter()
        .filter_map(|byte| {
            deframer
                .push(byte)
                .map(|frame| read(&frame.unwrap_or_else(|error| panic!("{label}: {error}"))))
        })
        .collect();
    let [frame] = frames.try_into().unwrap_or_else(|_| panic!("{label}: one frame"));
    frame
}

#[test]
fn every_line_is_read_and_written_as_it_stands() {
    for line in lines() {
        let [label, hex, debug] = line;
        let read = read_line(line);
        assert_eq!(read.debug, debug, "{label}");
        assert_eq!(read.frame, bytes(hex), "{label}");
        assert_eq!(label.split(':').next(), Some(read.name), "{label}");
    }
}

#[test]
fn every_message_has_a_line() {
    let lines: BTreeSet<_> =
        lines().map(read_line).map(|line| (line.kind as u8, line.number, line.name)).collect();
    let tables = [
        (Kind::Request, REQUESTS),
        (Kind::Reply, REQUESTS),
        (Kind::Error, ERRORS),
        (Kind::Event, EVENTS),
    ];
    for (kind, table) in tables {
        for info in table {
            assert!(
                lines.contains(&(kind as u8, info.number, info.name)),
                "no line for {kind:?} {}",
                info.name
            );
        }
    }
}
