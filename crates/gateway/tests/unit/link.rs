//! The session of a host link, seen from the host: bytes in, bytes out.

extern crate std;

use std::vec::Vec;

use host_protocol::{
    BootReason, Bytes, CanFrame, Event, EventMessage, RawFrame, StopTarget, Text,
    replies::{Done, HelloReply, Pong},
    requests::{Arm, Disarm, EStop, Hello, Ping, RawSend, Stop},
};

use super::ring::RING;
use super::*;
use crate::log::LogEntry;

/// Ping with sequence 1; its derivation is in host-tests/vectors/host-protocol.txt.
const PING: [u8; 12] = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];

fn bytes(request: impl Into<Request>, sequence: u16) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = request.into().encode_frame(sequence, &mut out).unwrap();
    out[..length].to_vec()
}

/// A link, and what happens.
struct Port {
    link: Link,
    ring: Ring,
}

impl Port {
    fn new() -> Self {
        Self { link: Link::blank(), ring: Ring::new() }
    }

    fn event(&mut self, now_us: u64, event: &Event) {
        self.ring.push(now_us, LogEntry::Event(*event));
    }
}

/// A request that is to be executed.
#[derive(Debug, PartialEq)]
struct Incoming {
    request: Result<Request, Error>,
    slot: Option<Slot>,
}

fn feed(Port { link, ring }: &mut Port, now_us: u64, mut bytes: &[u8]) -> Option<Incoming> {
    let mut incoming = None;
    while !bytes.is_empty() {
        let Some(frame) = link.receive(now_us, &mut bytes) else { continue };
        let identity = Identity::of(&frame);
        let watches = frame.kind == Kind::WatcherRequest;
        let request = Request::decode(frame.number, frame.body);
        if let Some(slot) = link.admit(now_us, identity, watches, &request, ring.end()) {
            assert_eq!(incoming.replace(Incoming { request, slot }), None);
        }
    }
    incoming
}

/// Feeds a request that is new and returns its slot.
fn request(link: &mut Port, request: impl Into<Request>, sequence: u16) -> Slot {
    let request = request.into();
    let incoming = feed(link, 0, &bytes(request.clone(), sequence)).unwrap();
    assert_eq!(incoming.request, Ok(request));
    incoming.slot.unwrap()
}

fn hello(session: u32) -> Hello {
    Hello { protocol_major: PROTOCOL_MAJOR, protocol_minor: 0, session }
}

/// A link whose host has said hello and has read the reply.
fn greeted() -> Port {
    let mut link = Port::new();
    let slot = request(&mut link, hello(1), 0);
    link.link.reply(slot, Ok(&Reply::Stop(Done {})));
    sent(&mut link).unwrap();
    link
}

fn sent(Port { link, ring }: &mut Port) -> Option<Vec<u8>> {
    let mut out = [0; MAX_FRAME];
    let had_output = link.has_output(ring);
    let length = link.poll_transmit(ring, &mut out);
    assert_eq!(length.is_some(), had_output);
    length.map(|length| out[..length].to_vec())
}

fn sent_event(link: &mut Port) -> Option<(u16, EventMessage)> {
    let bytes = sent(link)?;
    let mut deframer = Deframer::new();
    for byte in bytes {
        if let Some(frame) = deframer.push(byte) {
            let frame = frame.unwrap();
            assert_eq!(frame.kind, Kind::Event);
            return Some((frame.sequence, EventMessage::decode(frame.number, frame.body).unwrap()));
        }
    }
    None
}

fn pong(time_us: u64) -> Reply {
    Reply::Ping(Pong { time_us })
}

const RESET: Event = Event::EStopCleared {};

#[test]
fn a_request_comes_out_and_its_reply_goes_back() {
    let mut link = Port::new();
    assert_eq!(link.link.last_valid_us, 0);
    let incoming = feed(&mut link, 77, &PING).unwrap();
    assert_eq!(incoming.request, Ok(Request::Ping(Ping {})));
    assert_eq!(link.link.last_valid_us, 77);
    assert_eq!(sent(&mut link), None);

    link.link.reply(incoming.slot.unwrap(), Ok(&pong(5)));
    // Kind 2, sequence 1, number 2, time 5, CRC-32C CE29F5F4 from an independent computation.
    let reply = [0x00, 0x03, 0x02, 0x01, 0x02, 0x02, 0x06, 0x05, 0xF4, 0xF5, 0x29, 0xCE, 0x00];
    assert_eq!(sent(&mut link).unwrap(), reply);
    assert_eq!(sent(&mut link), None);
}

#[test]
fn a_repeated_request_gets_the_same_bytes_and_is_not_executed() {
    let mut link = Port::new();
    let slot = request(&mut link, Ping {}, 1);
    assert_eq!(feed(&mut link, 1, &PING), None, "while it is executed");
    assert_eq!(sent(&mut link), None);
    link.link.reply(slot, Ok(&pong(9)));
    assert_eq!(feed(&mut link, 2, &PING), None, "while its reply waits");
    let first = sent(&mut link).unwrap();
    assert_eq!(sent(&mut link), None, "one reply for all of them");

    assert_eq!(feed(&mut link, 3, &PING), None);
    assert_eq!(sent(&mut link).unwrap(), first);
    assert_eq!(link.link.last_valid_us, 3, "it still shows that the host is there");
}

#[test]
fn what_stops_is_executed_each_time_and_its_result_repeated() {
    for stop in [
        Request::from(Stop { target: StopTarget::All }),
        Request::from(EStop {}),
        Request::from(Disarm { axis: 2 }),
    ] {
        let mut link = Port::new();
        let slot = request(&mut link, stop.clone(), 1);
        let again = Some(Incoming { request: Ok(stop.clone()), slot: None });
        assert_eq!(feed(&mut link, 1, &bytes(stop.clone(), 1)), again, "while it is executed");
        link.link.reply(slot, Ok(&pong(9)));
        let first = sent(&mut link).unwrap();
        assert_eq!(feed(&mut link, 2, &bytes(stop, 1)), again);
        assert_eq!(sent(&mut link).unwrap(), first);
    }
}

#[test]
fn the_same_sequence_with_another_request_is_executed() {
    let mut link = Port::new();
    request(&mut link, Arm { axis: 1 }, 5);
    request(&mut link, Arm { axis: 2 }, 5);
    request(&mut link, Disarm { axis: 1 }, 5);
    request(&mut link, Arm { axis: 1 }, 6);
}

#[test]
fn errors_are_results_and_are_repeated_too() {
    let mut link = Port::new();
    let slot = request(&mut link, Arm { axis: 9 }, 3);
    link.link.reply(slot, Err(Error::UnknownAxis { axis: 9, max_axes: 4 }));
    let first = sent(&mut link).unwrap();
    assert_eq!(first[2], 3, "the kind of an error");
    assert_eq!(feed(&mut link, 0, &bytes(Arm { axis: 9 }, 3)), None);
    assert_eq!(sent(&mut link).unwrap(), first);
}

#[test]
fn what_cannot_be_read_comes_out_as_the_error_it_is() {
    let mut link = Port::new();
    let mut out = [0; MAX_FRAME];
    let length = host_protocol::encode(Kind::Request, 8, 0x7777, &(), &mut out).unwrap();
    let incoming = feed(&mut link, 0, &out[..length]).unwrap();
    assert_eq!(incoming.request, Err(Error::UnknownRequest { number: 0x7777 }));
    assert!(incoming.slot.is_some());
}

#[test]
fn the_last_eight_requests_are_remembered() {
    let mut link = Port::new();
    for sequence in 1..=9 {
        let slot = request(&mut link, Ping {}, sequence);
        link.link.reply(slot, Ok(&pong(u64::from(sequence))));
        sent(&mut link).unwrap();
    }
    // A repeated request does not make the others older.
    assert_eq!(feed(&mut link, 0, &bytes(Ping {}, 2)), None);
    sent(&mut link).unwrap();
    for sequence in 2..=9 {
        assert_eq!(feed(&mut link, 0, &bytes(Ping {}, sequence)), None, "{sequence}");
        sent(&mut link).unwrap();
    }
    assert!(feed(&mut link, 0, &bytes(Ping {}, 1)).is_some());
}

#[test]
fn replies_leave_in_the_order_of_their_results() {
    let mut link = Port::new();
    let slots: Vec<_> = (1..=3).map(|sequence| request(&mut link, Ping {}, sequence)).collect();
    for index in [2, 0, 1] {
        link.link.reply(slots[index], Ok(&pong(0)));
    }
    for sequence in [3, 1, 2] {
        assert_eq!(sent(&mut link).unwrap()[3], sequence);
    }
}

#[test]
fn a_repeated_request_is_not_executed_even_if_its_reply_had_to_make_room() {
    let mut link = greeted();
    for sequence in 1..=4 {
        request(&mut link, Arm { axis: 1 }, sequence); // owed all the time
    }
    for sequence in 5..=9 {
        let slot = request(&mut link, Ping {}, sequence);
        link.link.reply(slot, Ok(&pong(0)));
        sent(&mut link).unwrap();
    }
    // Of the last 8 requests the fifth still has its place: four are owed.
    assert_eq!(feed(&mut link, 50, &bytes(Ping {}, 6)), None);
    assert!(sent(&mut link).is_some());
    assert_eq!(feed(&mut link, 50, &bytes(Ping {}, 5)), None);
    let (_, message) = sent_event(&mut link).unwrap();
    assert_eq!(
        message,
        EventMessage { dropped: 0, time_us: 50, event: Event::RequestDropped { count: 1 } }
    );
}

#[test]
fn without_a_slot_only_a_stop_is_executed() {
    let mut link = greeted();
    let slots: Vec<_> = (1..=8).map(|sequence| request(&mut link, Ping {}, sequence)).collect();
    assert_eq!(feed(&mut link, 50, &bytes(Ping {}, 9)), None);
    let stops: [Request; 3] =
        [Stop { target: StopTarget::All }.into(), EStop {}.into(), Disarm { axis: 1 }.into()];
    for stop in stops {
        let incoming = feed(&mut link, 60, &bytes(stop.clone(), 10)).unwrap();
        assert_eq!(incoming, Incoming { request: Ok(stop), slot: None });
    }
    let (_, message) = sent_event(&mut link).unwrap();
    assert_eq!(
        message,
        EventMessage { dropped: 0, time_us: 60, event: Event::RequestDropped { count: 4 } }
    );

    // A reply that waits still holds its slot; one that was handed out does not.
    link.link.reply(slots[4], Ok(&pong(0)));
    assert_eq!(feed(&mut link, 70, &bytes(Ping {}, 9)), None);
    sent(&mut link).unwrap();
    assert!(feed(&mut link, 80, &bytes(Ping {}, 9)).is_some());
}

#[test]
fn a_new_hello_forgets_the_requests_before_it() {
    let mut link = greeted();
    let orphan = request(&mut link, Arm { axis: 1 }, 1);
    let waiting = request(&mut link, Ping {}, 2);
    link.link.reply(waiting, Ok(&pong(0)));

    let slot = request(&mut link, hello(2), 0);
    assert_eq!(sent(&mut link), None, "the reply of the session before");
    link.link.reply(orphan, Ok(&pong(0)));
    assert_eq!(sent(&mut link), None, "a result of the session before");
    let again = request(&mut link, Arm { axis: 1 }, 1);
    link.link.reply(orphan, Ok(&pong(0)));
    assert_eq!(sent(&mut link), None, "nor does it take the place of another one");
    link.link.reply(again, Ok(&pong(0)));
    link.link.reply(slot, Ok(&pong(0)));
    assert!(sent(&mut link).is_some() && sent(&mut link).is_some());
}

#[test]
fn a_repeated_hello_begins_nothing_new() {
    let mut link = Port::new();
    let slot = request(&mut link, hello(1), 0);
    request(&mut link, Ping {}, 1);
    assert_eq!(feed(&mut link, 0, &bytes(hello(1), 0)), None);
    link.link.reply(slot, Ok(&pong(0)));
    assert!(sent(&mut link).is_some());
    assert_eq!(feed(&mut link, 0, &PING), None, "still remembered");
}

#[test]
fn events_wait_for_a_hello_of_our_version() {
    let mut link = Port::new();
    link.event(1, &RESET);
    assert_eq!(sent(&mut link), None);
    request(
        &mut link,
        Hello { protocol_major: PROTOCOL_MAJOR + 1, protocol_minor: 0, session: 1 },
        0,
    );
    link.event(2, &RESET);
    assert_eq!(sent(&mut link), None);
    request(&mut link, hello(2), 0);
    link.event(3, &RESET);
    let message = EventMessage { dropped: 0, time_us: 3, event: RESET };
    assert_eq!(sent_event(&mut link), Some((0, message)));
    assert_eq!(sent(&mut link), None);
}

#[test]
fn replies_go_before_events() {
    let mut link = greeted();
    link.event(1, &RESET);
    let slot = request(&mut link, Ping {}, 1);
    link.link.reply(slot, Ok(&pong(0)));
    assert_eq!(sent(&mut link).unwrap()[2], 2, "a reply");
    assert!(sent_event(&mut link).is_some());
}

#[test]
fn events_that_lose_their_places_are_counted_in_the_next() {
    let mut link = greeted();
    let latest = RING as u64 + 2;
    for time in 0..=latest {
        link.event(time, &RESET);
        // The log's own entries are no events.
        link.ring.push(time, LogEntry::NoRandomNumber);
    }
    let first = latest + 1 - RING as u64 / 2;
    for (sequence, time_us) in (0..).zip(first..=latest) {
        let dropped = if sequence == 0 { u32::try_from(first).unwrap() } else { 0 };
        let message = EventMessage { dropped, time_us, event: RESET };
        assert_eq!(sent_event(&mut link), Some((sequence, message)));
    }
    assert_eq!(sent(&mut link), None);
    (0..RING).for_each(|_| link.ring.push(90, LogEntry::NoRandomNumber));
    link.event(91, &RESET);
    let message = EventMessage { dropped: 0, time_us: 91, event: RESET };
    assert_eq!(sent_event(&mut link), Some((u16::try_from(RING / 2).unwrap(), message)));
}

#[test]
fn frames_that_cannot_be_read_are_reported_once_for_each_reason() {
    let mut link = greeted();
    let mut corrupted = PING;
    corrupted[7] ^= 0x01;
    for now_us in [10, 20, 30] {
        assert_eq!(feed(&mut link, now_us, &corrupted), None);
    }
    let mut too_long = [0x55; 700];
    too_long[699] = 0;
    assert_eq!(feed(&mut link, 40, &too_long), None);
    assert_eq!(link.link.last_valid_us, 0, "none of them shows that the host is there");

    let mut rejected =
        || sent_event(&mut link).map(|(_, message)| (message.time_us, message.event));
    assert_eq!(rejected(), Some((40, Event::FrameRejected { reason: 1, count: 1 })));
    assert_eq!(rejected(), Some((30, Event::FrameRejected { reason: 4, count: 3 })));
    assert_eq!(rejected(), None);
    assert!(feed(&mut link, 50, &PING).is_some());
}

#[test]
fn our_own_frames_coming_back_stay_unanswered() {
    let mut link = greeted();
    link.event(1, &RESET);
    let echo = sent(&mut link).unwrap();
    assert_eq!(feed(&mut link, 2, &echo), None);
    assert_eq!((sent(&mut link), link.link.last_valid_us), (None, 0));
}

#[test]
fn the_longest_messages_pass() {
    let mut link = Port::new();
    let frame = RawFrame::Serial(Bytes::from_slice(&[0xAA; 64]).unwrap());
    request(&mut link, RawSend { bus: 0, frame }, 1);
    let frame = RawFrame::Can(CanFrame::extended(0x1FFF_FFFF, &[0xFF; 8]).unwrap());
    request(&mut link, RawSend { bus: 0, frame }, 2);

    let slot = request(&mut link, hello(1), 3);
    let reply = HelloReply {
        protocol_major: u16::MAX,
        protocol_minor: u16::MAX,
        firmware: Text::try_from("f".repeat(24).as_str()).unwrap(),
        build_id: Text::try_from("b".repeat(40).as_str()).unwrap(),
        board: Text::try_from("n".repeat(24).as_str()).unwrap(),
        boot: BootReason::Simulated,
        has_crash_report: true,
        trips_recorded: u16::MAX,
        max_axes: u8::MAX,
        max_message: u16::MAX,
        buses: (0..8)
            .map(|_| host_protocol::BusCapability {
                kind: host_protocol::BusKind::Rs485,
                bitrates: [u32::MAX; 8].into_iter().collect(),
                protocols: host_protocol::ProtocolSet::from_bits(u8::MAX),
            })
            .collect(),
        time_us: u64::MAX,
    };
    link.link.reply(slot, Ok(&Reply::Hello(reply)));
    assert!(sent(&mut link).unwrap().len() > 470);
}

#[test]
fn a_snapshot_whose_next_place_is_none_gives_every_place_away() {
    // Eight replies of no bytes that are sent, no request remembered, and the highest number.
    let mut snapshot = [3, 0, 0].repeat(8);
    snapshot.extend([0; 16 + 1]);
    snapshot.extend([0xFF; 9]);
    snapshot.extend([1, 0]);
    let mut replies: Replies = postcard::from_bytes(&snapshot).unwrap();
    let mut deframer = host_protocol::Deframer::new();
    for sequence in 1..=9 {
        let given = bytes(Ping {}, sequence);
        let frame = deframer.take(&mut &given[..]).unwrap().unwrap();
        let is_slot = matches!(replies.reserve(Identity::of(&frame)), Reserved::Slot(_));
        assert_eq!(is_slot, sequence <= 8, "{sequence}");
    }
}
