//! Requests that a host passes on for who only watches: executed, but no sign of life, no right to
//! command, no session.

use crate::bench::{self, HOLD, VELOCITY, arm, setpoint};
use crate::rig::{Rig, Said};
use host_protocol::{
    AxisState, Error, Event as HostEvent, Kind, MAX_FRAME, Reply, Request, StopAction, TripReason,
    encode_body, requests,
};

/// Kind 5, sequence 1, Ping; the checksums here are from an independent computation.
const PING: &str = "000305010202057F3D266700";
/// Kind 5, sequence 1, Hello of version 1.0, session 7.
const HELLO: &str = "0003050102010201060731F890C500";
/// Kind 5, sequence 2, Stop of all.
const STOP: &str = "00030502023206012CA82F5600";
/// Kind 5, sequence 3, Arm of axis 0.
const ARM: &str = "00030503023001058E163AD300";
/// Kind 5, sequence 4, ReleaseAuthority.
const RELEASE: &str = "0003050402040506F78EA800";

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

fn watch(rig: &mut Rig, hex: &str, sequence: u16) -> Option<Result<Reply, Error>> {
    rig.said.retain(|said| !matches!(said, Said::Reply(..) | Said::Error(..)));
    rig.bytes(&bytes(hex));
    rig.run(50_000);
    rig.answer(sequence)
}

/// The same request for a watcher.
fn watched(request: impl Into<Request>, sequence: u16) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = request.into().encode_frame(sequence, &mut out).unwrap();
    let mut deframer = host_protocol::Deframer::new();
    let frame = deframer.take(&mut &out[..length]).unwrap().unwrap();
    let mut again = [0; MAX_FRAME];
    let length =
        encode_body(Kind::WatcherRequest, frame.sequence, frame.number, frame.body, &mut again);
    again[..length.unwrap()].to_vec()
}

fn has_tripped(rig: &Rig) -> Option<TripReason> {
    rig.said.iter().find_map(|said| match said {
        Said::Event(HostEvent::Tripped { trip, .. }) => Some(trip.reason),
        _ => None,
    })
}

/// Turns at a setpoint that outlives the link's silence.
fn turning() -> (Rig, u32) {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(
        &mut rig,
        0,
        host_protocol::AxisParameter::TtlUs,
        host_protocol::Value::Unsigned(2_000_000),
    );
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 1_900_000, VELOCITY);
    rig.ask(request).unwrap();
    rig.run(1_000);
    (rig, epoch)
}

#[test]
fn what_watchers_ask_keeps_no_silent_host_in_command() {
    let (mut rig, _) = turning();
    let start = rig.now_us;
    let mut sequence = 1_000;
    while has_tripped(&rig).is_none() {
        sequence += 1;
        rig.bytes(&watched(requests::Ping {}, sequence));
        rig.bytes(&watched(requests::ReadState { axis: 0 }, sequence + 30_000));
        rig.run(10_000);
        assert!(rig.now_us < start + 300_000, "the silence lasts 250 ms");
    }
    assert_eq!(has_tripped(&rig), Some(TripReason::HostSilent));
    assert!(rig.now_us >= start + 240_000);
    assert!(rig.sent_since(0, start + 240_000).contains(&HOLD));
}

#[test]
fn a_request_of_the_host_itself_keeps_it() {
    let (mut rig, _) = turning();
    for _ in 0..60 {
        rig.ask(Request::Ping(requests::Ping {})).unwrap();
        rig.run(10_000);
    }
    assert_eq!(has_tripped(&rig), None);
}

#[test]
fn a_watcher_is_answered() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    assert!(matches!(watch(&mut rig, PING, 1), Some(Ok(Reply::Ping(_)))));
}

#[test]
fn a_watcher_commands_nothing_whoever_is_in_command() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.ask(Request::ReleaseAuthority(requests::ReleaseAuthority {})).unwrap();
    assert_eq!(watch(&mut rig, ARM, 3), Some(Err(Error::NobodyInCommand {})));
    // The same link has it for its own program, not for this one.
    rig.ask(Request::TakeAuthority(requests::TakeAuthority {})).unwrap();
    rig.bytes(&watched(requests::Arm { axis: 0 }, 900));
    assert_eq!(rig.answer(900), Some(Err(Error::NotInCommand { holder: 0 })));
    // A native command that moves, too: 0xA2 of an RMD.
    let data = [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0].into_iter().collect();
    let native = requests::Native { axis: 0, epoch: 0, expires_at_us: 0, data };
    rig.bytes(&watched(native, 901));
    assert_eq!(rig.answer(901), Some(Err(Error::NotInCommand { holder: 0 })));
}

#[test]
fn a_watcher_gives_nothing_back_and_opens_no_session() {
    let (mut rig, epoch) = turning();
    assert!(matches!(watch(&mut rig, RELEASE, 4), Some(Ok(Reply::ReleaseAuthority(_)))));
    assert!(matches!(watch(&mut rig, HELLO, 1), Some(Ok(Reply::Hello(_)))));
    // Axis 0 turns on, in the same session and epoch.
    let request = setpoint(&rig, epoch, 80_000, VELOCITY);
    assert!(rig.ask(request).is_ok());
    assert_eq!(has_tripped(&rig), None);
}

#[test]
fn a_watcher_stops_at_once() {
    let (mut rig, _) = turning();
    let start = rig.now_us;
    assert!(matches!(watch(&mut rig, STOP, 2), Some(Ok(Reply::Stop(_)))));
    assert_eq!(rig.sent_since(0, start).first(), Some(&HOLD));
    // Each time it comes.
    let again = rig.now_us;
    rig.bytes(&bytes(STOP));
    rig.run(5_000);
    assert!(rig.sent_since(0, again).contains(&HOLD));
}

#[test]
fn without_a_session_a_watcher_may_only_stop() {
    let mut rig = Rig::new();
    assert_eq!(watch(&mut rig, HELLO, 1), Some(Err(Error::NoSession {})));
    assert_eq!(watch(&mut rig, ARM, 3), Some(Err(Error::NoSession {})));
    assert!(matches!(watch(&mut rig, STOP, 2), Some(Ok(Reply::Stop(_)))));
    // After a reset the session is gone.
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.reset();
    rig.run(200_000);
    rig.bytes(&bytes(HELLO));
    assert_eq!(rig.answer(1), Some(Err(Error::NoSession {})));
}

#[test]
fn a_watcher_keeps_a_subscription() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let fields = host_protocol::StateFields::from_bits(1);
    rig.bytes(&watched(requests::Subscribe { axes: 1, fields, period_us: 500_000 }, 500));
    for sequence in 0..10 {
        rig.bytes(&watched(requests::Ping {}, 600 + sequence));
        rig.run(1_000_000);
    }
    rig.said.clear();
    rig.run(1_000_000);
    let samples = rig.said.iter().filter(|said| {
        matches!(said, Said::Event(HostEvent::Sample { state: AxisState::Idle, .. }))
    });
    assert!(samples.count() >= 1);
}
