//! A gateway whose texts are commands of a terminal.

use std::io::{Read, Write};
use std::net::TcpListener;

use host_protocol::{
    BootReason, Deframer, MAX_FRAME, PROTOCOL_MAJOR, PROTOCOL_MINOR, Reply, Request, Text, Vec,
    replies,
};
use serde_json::Value;

use crate::support::mgw;

/// What a gateway calls itself must not command the terminal of who asks.
#[test]
fn what_a_gateway_says_is_shown_and_obeyed_by_no_terminal() {
    let port = hostile_gateway();
    let text = mgw(&["--port", &port, "trips"]).success();
    assert!(text.contains(r"before this start: \u001b[2Jgone\u009b31m"), "{text:?}");
    assert!(
        !text.contains(|character: char| character.is_control() && character != '\n'),
        "{text:?}"
    );
    let port = hostile_gateway();
    let line = mgw(&["--json", "--port", &port, "trips"]).success();
    assert!(!line.trim_end().contains(char::is_control), "{line:?}");
    let value: Value = serde_json::from_str(&line).unwrap();
    assert_eq!(value["crash_report"], "\u{1b}[2Jgone\u{9b}31m");
}

/// A gateway for one session, whose texts are commands of a terminal.
fn hostile_gateway() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut deframer = Deframer::new();
        let mut bytes = [0; 512];
        while let Ok(length @ 1..) = stream.read(&mut bytes) {
            for byte in &bytes[..length] {
                let Some(Ok(frame)) = deframer.push(*byte) else { continue };
                let Ok(request) = Request::decode(frame.number, frame.body) else { continue };
                let mut out = [0; MAX_FRAME];
                let length =
                    hostile_reply(&request).encode_frame(frame.sequence, &mut out).unwrap();
                stream.write_all(&out[..length]).unwrap();
            }
        }
    });
    port
}

fn hostile_reply(request: &Request) -> Reply {
    match request {
        Request::Hello(_) => Reply::Hello(replies::HelloReply {
            protocol_major: PROTOCOL_MAJOR,
            protocol_minor: PROTOCOL_MINOR,
            firmware: "\u{1b}]0;x\u{7}".parse().unwrap(),
            build_id: Text::default(),
            board: Text::default(),
            boot: BootReason::PowerOn,
            has_crash_report: true,
            trips_recorded: 0,
            max_axes: 32,
            max_message: 512,
            buses: Vec::default(),
            time_us: 0,
        }),
        Request::ReadCrashReport(_) => Reply::ReadCrashReport(replies::CrashReport {
            text: "\u{1b}[2Jgone\u{9b}31m".parse().unwrap(),
        }),
        Request::ReadIncidents(_) => {
            Reply::ReadIncidents(replies::IncidentPage { incidents: Vec::default(), next: None })
        }
        _ => Reply::Ping(replies::Pong { time_us: 0 }),
    }
}
