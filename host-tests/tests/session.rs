//! The session that PROTOCOL.md shows in hexadecimal: it is one with the simulator, byte for byte.
//!
//! Where the two differ the test prints what has to stand there.

use std::fmt::{Debug, Write};
use std::time::Duration;

use host_protocol::replies::{Armed, Pong};
use host_protocol::{
    AxisParameter, BusConfig, Change, Deframer, EventMessage, Kind, MAX_FRAME, Protocol,
    ProtocolSet, Reply, Request, Setpoint, StopTarget, Value, Vec as List, requests,
};
use mgw_sim::{BOARD, Wiring, World};

const REFERENCE: &str = include_str!("../../PROTOCOL.md");
const LINK: u8 = 0;
/// What is said of a frame fits behind it, or is left out but for the name.
const COLUMNS: usize = 100;
const BYTES_IN_A_LINE: usize = 32;
/// How far ahead a setpoint of the session expires.
const AHEAD_US: u32 = 50_000;

/// A host that writes down what passes.
struct Host {
    world: World,
    deframer: Deframer,
    sequence: u16,
    shown: String,
}

impl Host {
    /// Sends a request, and takes what comes until its reply is there and for `span` longer.
    fn ask(&mut self, request: Request, span: Duration) -> Reply {
        self.sequence += 1;
        let mut out = [0; MAX_FRAME];
        let length = request.encode_frame(self.sequence, &mut out).unwrap();
        self.show('>', &format!("request {}", self.sequence), &words(&request), &out[..length]);
        self.world.host_send(LINK, &out[..length]);
        let mut reply = None;
        for _ in 0..1_000 {
            self.world.run_for(Duration::from_millis(1));
            reply = reply.or(self.take());
            if reply.is_some() {
                break;
            }
        }
        self.world.run_for(span);
        assert!(self.take().is_none(), "one reply to one request");
        reply.expect("a reply")
    }

    /// Writes down all that has arrived, and returns the reply among it.
    fn take(&mut self) -> Option<Reply> {
        let (mut reply, mut raw) = (None, vec![0]);
        for byte in self.world.host_receive(LINK) {
            raw.push(byte);
            let frame = self.deframer.push(byte).map(|frame| {
                let frame = frame.expect("a good frame");
                let (kind, what) = match frame.kind {
                    Kind::Event => {
                        let event = EventMessage::decode(frame.number, frame.body).unwrap();
                        ("event", words(&event.event))
                    }
                    Kind::Reply => {
                        let answer = Reply::decode(frame.number, frame.body).unwrap();
                        let what = words(&answer);
                        reply = Some(answer);
                        ("reply", what)
                    }
                    kind => panic!("{kind:?} {:#06x}", frame.number),
                };
                (format!("{kind} {}", frame.sequence), what)
            });
            if let Some((kind, what)) = frame {
                // The delimiter that begins a frame may be the one that ended the frame before.
                let start = raw.iter().rposition(|byte| *byte != 0).unwrap();
                let start = raw[..start].iter().rposition(|byte| *byte == 0).unwrap();
                let bytes = raw.split_off(start);
                self.show('<', &kind, &what, &bytes);
                raw = vec![0];
            }
        }
        assert!(raw.iter().all(|byte| *byte == 0), "half a frame");
        reply
    }

    fn show(&mut self, direction: char, kind: &str, what: &str, bytes: &[u8]) {
        let line = format!("{direction} {kind} {what}");
        let is_short = line.len() <= COLUMNS;
        let name = what.split([' ', '{']).next().unwrap();
        let line = if is_short { line } else { format!("{direction} {kind} {name} …") };
        writeln!(self.shown, "{line}").unwrap();
        for part in bytes.chunks(BYTES_IN_A_LINE) {
            let part: Vec<String> = part.iter().map(|byte| format!("{byte:02X}")).collect();
            writeln!(self.shown, "  {}", part.join(" ")).unwrap();
        }
    }
}

/// `Ping(Ping)` as `Ping`, and without the name of the newtype that each message is in.
fn words(message: &impl Debug) -> String {
    let text = format!("{message:?}");
    let inner = text.split_once('(').and_then(|(_, inner)| inner.strip_suffix(')'));
    let is_request = text.split('(').next().is_some_and(|name| !name.contains(' '));
    match inner.filter(|_| is_request) {
        Some("Done") => text.replace("(Done)", ": Done"),
        Some(inner) => inner.to_owned(),
        None => text,
    }
}

fn axis_change(parameter: AxisParameter, value: Value) -> Change {
    Change::Axis { axis: 0, parameter: parameter.number(), value: Some(value) }
}

/// What passes, step by step: a block for each step.
fn session() -> Vec<String> {
    let world = World::new(Wiring::on(&BOARD).with(0, Protocol::Thruster, 11));
    let mut host = Host { world, deframer: Deframer::new(), sequence: 0, shown: String::new() };
    host.world.run_for(Duration::from_millis(200));
    let mut blocks = Vec::new();
    let mut step = |host: &mut Host| blocks.push(std::mem::take(&mut host.shown));
    let soon = Duration::from_millis(1);

    let (protocol_major, protocol_minor) =
        (host_protocol::PROTOCOL_MAJOR, host_protocol::PROTOCOL_MINOR);
    let hello = requests::Hello { protocol_major, protocol_minor, session: 0x1234_5678 };
    host.ask(Request::Hello(hello), soon);
    step(&mut host);

    host.ask(Request::BeginChanges(requests::BeginChanges {}), soon);
    let unsigned = Value::Unsigned;
    let bus = BusConfig {
        bitrate: 1_000_000,
        protocols: ProtocolSet::NONE.with(Protocol::Thruster),
        exclusive: false,
        reply_window_us: 1_000,
    };
    let changes = [
        Change::Bus { bus: 0, config: Some(bus) },
        axis_change(AxisParameter::Bus, unsigned(0)),
        axis_change(AxisParameter::Protocol, unsigned(2)),
        axis_change(AxisParameter::Node, unsigned(11)),
        axis_change(AxisParameter::StopAction, unsigned(1)),
    ];
    let changes = List::from_iter(changes);
    host.ask(Request::AddChanges(requests::AddChanges { changes }), soon);
    host.ask(Request::ApplyChanges(requests::ApplyChanges {}), soon);
    let timeout = requests::ProvisionMotorTimeout { axis: 0, timeout_ms: 300 };
    host.ask(Request::ProvisionMotorTimeout(timeout), soon);
    step(&mut host);

    let Reply::Arm(Armed { epoch, .. }) = host.ask(Request::Arm(requests::Arm { axis: 0 }), soon)
    else {
        panic!("armed")
    };
    step(&mut host);

    let Reply::Ping(Pong { time_us }) = host.ask(Request::Ping(requests::Ping {}), soon) else {
        panic!("a pong")
    };
    let expires_at_us = u32::try_from(time_us).unwrap() + AHEAD_US;
    let setpoint = Setpoint::Signal { fraction: 0.25 };
    let setpoint = requests::Setpoint { axis: 0, epoch, expires_at_us, setpoint };
    host.ask(Request::Setpoint(setpoint), soon);
    step(&mut host);

    host.ask(Request::ReadState(requests::ReadState { axis: 0 }), soon);
    step(&mut host);

    let stop = requests::Stop { target: StopTarget::Axis(0) };
    host.ask(Request::Stop(stop), Duration::from_millis(20));
    step(&mut host);

    host.ask(Request::ReleaseAuthority(requests::ReleaseAuthority {}), soon);
    step(&mut host);
    blocks
}

#[test]
fn the_session_of_the_reference_is_one_with_the_simulator() {
    let (_, section) = REFERENCE.split_once("\n## A whole session\n").expect("the section");
    let section = section.split("\n## ").next().unwrap();
    let shown: Vec<String> = section.split("```\n").skip(1).step_by(2).map(str::to_owned).collect();
    let passed = session();
    let whole = passed.iter().fold(String::new(), |all, block| all + "```\n" + block + "```\n\n");
    assert!(shown == passed, "PROTOCOL.md has another session than this one:\n\n{whole}");
}
