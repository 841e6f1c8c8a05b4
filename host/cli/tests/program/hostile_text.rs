//! A gateway whose texts are commands of a terminal.

use host_protocol::{
    BootReason, PROTOCOL_MAJOR, PROTOCOL_MINOR, Reply, Request, Text, Vec, replies,
};
use serde_json::Value;

use crate::support::{mgw, scripted_gateway};

/// What a gateway calls itself must not command the terminal of who asks.
#[test]
fn what_a_gateway_says_is_shown_and_obeyed_by_no_terminal() {
    let port = scripted_gateway(hostile_reply);
    let text = mgw(&["--port", &port, "trips"]).success();
    assert!(text.contains(r"before this start: \u001b[2Jgone\u009b31m"), "{text:?}");
    assert!(
        !text.contains(|character: char| character.is_control() && character != '\n'),
        "{text:?}"
    );
    let port = scripted_gateway(hostile_reply);
    let line = mgw(&["--json", "--port", &port, "trips"]).success();
    assert!(!line.trim_end().contains(char::is_control), "{line:?}");
    let value: Value = serde_json::from_str(&line).unwrap();
    assert_eq!(value["crash_report"], "\u{1b}[2Jgone\u{9b}31m");
}

/// What such a gateway says of itself, and of anything else the time.
pub fn hostile_reply(request: &Request) -> Reply {
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
