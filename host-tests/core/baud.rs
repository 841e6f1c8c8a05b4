//! The rate of a host link: asked for, kept while the host is heard, given up otherwise.

use crate::bench::{self, VELOCITY, expiry};
use crate::rig::Rig;
use crate::text::{hex, unhex};
use gateway::{Changes, Event};
use host_protocol::{
    AxisState, DEFAULT_BAUD, Error, MAX_FRAME, Reply, Request, StopAction, replies, requests,
};

/// SetBaud 2 000 000 with sequence 0x51, and its reply; made by a program in Python that shares no
/// code with ours, as the other frames here.
const TO_2_MBAUD: &str = "0003015102050880897AE565877700";
const DONE: &str = "00030251020505A414FFF700";
/// SetBaud 57 600 with sequence 0x52; BaudNotOffered 57 600: 921 600, 2 000 000, 3 000 000.
const TO_57600: &str = "0003015202050880C20359324C9000";
const NOT_OFFERED: &str = "0003035202590E80C20380A03880897AC08DB701010101010570BD201A00";
/// What a host at 921 600 baud looks like at 2 Mbaud.
const GARBAGE: [u8; 4] = [0xE6, 0x98, 0xFE, 0];
const RATE: u32 = 2_000_000;

fn tell(rig: &mut Rig, event: Event<'_>) -> Changes {
    let now = rig.now();
    rig.gateway.handle(now, event, &mut |index, word| rig.memory[index] = word)
}

fn bytes(rig: &mut Rig, link: u8, bytes: &[u8]) -> Changes {
    tell(rig, Event::HostBytes { link, bytes })
}

/// The next frame for a host, in hex.
fn said(rig: &mut Rig, link: u8) -> Option<String> {
    let mut frame = [0; MAX_FRAME];
    let length =
        rig.gateway.poll_host(link, &mut frame, &mut |index, word| rig.memory[index] = word)?;
    Some(hex(&frame[..length]))
}

/// A gateway whose host 1 has asked for 2 Mbaud.
fn changed() -> Rig {
    let mut rig = Rig::new();
    bytes(&mut rig, 1, &unhex(TO_2_MBAUD));
    assert_eq!(said(&mut rig, 1).as_deref(), Some(DONE));
    rig
}

fn stop() -> Vec<u8> {
    let mut frame = [0; MAX_FRAME];
    let request = Request::EStop(requests::EStop {});
    let length = request.encode_frame(9, &mut frame).unwrap();
    frame[..length].to_vec()
}

#[test]
fn the_rate_changes_when_the_reply_has_been_taken() {
    let mut rig = Rig::new();
    bytes(&mut rig, 1, &unhex(TO_2_MBAUD));
    assert_eq!(rig.gateway.baud(1), DEFAULT_BAUD);
    assert_eq!(said(&mut rig, 1).as_deref(), Some(DONE));
    assert_eq!([0, 1, 2].map(|link| rig.gateway.baud(link)), [DEFAULT_BAUD, RATE, DEFAULT_BAUD]);
    // A frame at that rate is heard, and back it goes as it came.
    let back = Request::SetBaud(requests::SetBaud { baud: DEFAULT_BAUD });
    assert_eq!(rig.ask_as(1, &back), Ok(Reply::SetBaud(replies::Done {})));
    assert_eq!(rig.gateway.baud(1), DEFAULT_BAUD);
}

#[test]
fn a_rate_that_is_not_offered_is_refused_with_those_that_are() {
    let mut rig = Rig::new();
    bytes(&mut rig, 1, &unhex(TO_57600));
    assert_eq!(said(&mut rig, 1).as_deref(), Some(NOT_OFFERED));
    assert_eq!(rig.gateway.baud(1), DEFAULT_BAUD);
    for baud in [0, 1, DEFAULT_BAUD - 1, u32::MAX] {
        let offered = [921_600, 2_000_000, 3_000_000, 0, 0, 0, 0, 0];
        let request = Request::SetBaud(requests::SetBaud { baud });
        assert_eq!(rig.ask_as(1, &request), Err(Error::BaudNotOffered { baud, offered }));
    }
    let usb = Request::SetBaud(requests::SetBaud { baud: RATE });
    assert_eq!(rig.ask_as(2, &usb), Err(Error::LinkHasNoBaud {}));
    assert_eq!(rig.gateway.baud(2), DEFAULT_BAUD);
}

/// A host that has lost the rate repeats its stop every 25 ms: the fourth is heard.
#[test]
fn three_frames_in_a_row_that_cannot_be_read_bring_the_default_back() {
    for errors in [false, true] {
        let mut rig = changed();
        for count in 1..=3 {
            assert_eq!(rig.gateway.baud(1), RATE);
            rig.now_us += 25_000;
            let changes = if errors {
                // All errors of one frame count once.
                for _ in 0..12 {
                    tell(&mut rig, Event::HostLineError { link: 1 });
                    rig.now_us += 100;
                }
                tell(&mut rig, Event::HostLineError { link: 1 })
            } else {
                bytes(&mut rig, 1, &GARBAGE)
            };
            // The third, of the first 13 errors of which the first one changed it.
            assert_eq!(rig.gateway.baud(1) == DEFAULT_BAUD, count == 3);
            assert!(errors || count < 3 || changes.links.has(1u8));
        }
        rig.now_us += 25_000;
        bytes(&mut rig, 1, &stop());
        assert!(rig.gateway.light() == gateway::Light::EStopped);
    }
}

#[test]
fn frames_that_can_be_read_keep_the_rate_on_a_bad_line() {
    let mut rig = changed();
    for _ in 0..100 {
        for _ in 0..2 {
            rig.now_us += 10_000;
            bytes(&mut rig, 1, &GARBAGE);
            tell(&mut rig, Event::HostLineError { link: 1 });
        }
        rig.ask_as(1, &Request::Ping(requests::Ping {})).unwrap();
    }
    assert_eq!(rig.gateway.baud(1), RATE);
}

#[test]
fn five_seconds_without_a_valid_frame_bring_the_default_back() {
    let mut rig = changed();
    let since = rig.now_us;
    rig.now_us = since + 4_999_999;
    tell(&mut rig, Event::Tick);
    assert_eq!(rig.gateway.baud(1), RATE);
    assert!(rig.gateway.next_deadline().is_some_and(|at| at.as_micros() <= since + 5_000_000));
    rig.now_us = since + 5_000_000;
    assert!(tell(&mut rig, Event::Tick).links.has(1u8));
    assert_eq!(rig.gateway.baud(1), DEFAULT_BAUD);
    // Noise at the default rate changes nothing, and is nothing to do.
    for _ in 0..10 {
        rig.now_us += 10_000;
        assert!(!tell(&mut rig, Event::HostLineError { link: 1 }).links.has(1u8));
    }
}

#[test]
fn a_reset_brings_the_default_back_and_a_new_session_does_not() {
    let mut rig = changed();
    let hello = requests::Hello { protocol_major: 1, protocol_minor: 0, session: 7 };
    rig.ask_as(1, &Request::Hello(hello)).unwrap();
    assert_eq!(rig.gateway.baud(1), RATE);
    rig.reset();
    assert_eq!(rig.gateway.baud(1), DEFAULT_BAUD);
}

/// A session that begins before the reply was taken has never asked.
#[test]
fn a_reply_that_is_forgotten_changes_nothing() {
    let mut rig = Rig::new();
    bytes(&mut rig, 1, &unhex(TO_2_MBAUD));
    let hello = requests::Hello { protocol_major: 1, protocol_minor: 0, session: 7 };
    rig.ask_as(1, &Request::Hello(hello)).unwrap();
    rig.ask_as(1, &Request::Ping(requests::Ping {})).unwrap();
    assert_eq!(rig.gateway.baud(1), DEFAULT_BAUD);
}

/// Safety does not depend on the rate: what moves stops when its setpoints no longer come, whatever
/// arrives in their place.
#[test]
fn a_lost_rate_stops_what_moves() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    let epoch = bench::arm(&mut rig);
    rig.ask(Request::SetBaud(requests::SetBaud { baud: RATE })).unwrap();
    let lives_us = 80_000;
    let request = bench::setpoint(&rig, epoch, lives_us, VELOCITY);
    assert!(expiry(&rig, lives_us) > 0);
    rig.ask(request).unwrap();
    rig.run(10_000);
    assert_eq!(rig.gateway.baud(0), RATE);
    for _ in 0..20 {
        rig.bytes(&GARBAGE);
        rig.handle(Event::HostLineError { link: 0 });
        rig.run(10_000);
    }
    assert_eq!(rig.gateway.baud(0), DEFAULT_BAUD);
    assert!(matches!(bench::listed(&mut rig, 0), AxisState::Tripped { .. }));
}
