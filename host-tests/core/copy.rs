//! Whoever copies what is said to have changed has a copy of all: looked at again and again in every
//! test of this folder.

use crate::bench;
use crate::rig::Rig;
use gateway::{Event, FlightPage, Gateway, Instant, MAX_AXES, MAX_LINKS, Part};
use host_protocol::replies::MAX_FLIGHT_RECORD_BYTES;
use host_protocol::{AxisParameter, Change, MAX_FRAME, Request, Subject, Text, Value, requests};

/// A reply or half a request of a host, and a little more: each takes its time, and goes in one piece.
const MOST: usize = MAX_FRAME + 16;

fn encoded(gateway: &Gateway, part: usize) -> Vec<u8> {
    let part = Part::of(gateway, part).expect("there is one");
    let mut bytes = [0; MOST];
    postcard::to_slice(&part, &mut bytes).expect("no part takes more").to_vec()
}

/// A copy of a gateway, part by part, without those that each call changes.
pub struct Copy {
    parts: Vec<Vec<u8>>,
}

impl Copy {
    pub fn begin(gateway: &mut Gateway) -> Self {
        gateway.begin_copy();
        let parts = (0..Part::COUNT).map(|part| Part::of_nothing(part).to_vec());
        let mut copy = Self { parts: parts.collect() };
        copy.go_on(gateway);
        copy
    }

    /// Copies what has changed; then it is as the gateway is.
    pub fn go_on(&mut self, gateway: &mut Gateway) {
        gateway.next_deadline();
        while let Some(parts) = gateway.next_to_copy() {
            for part in parts {
                assert!(!Part::LAST.contains(&part), "part {part} is copied at the end");
                self.parts[part] = encoded(gateway, part);
            }
        }
        assert!(!gateway.has_more_to_copy());
        for (part, copy) in self.parts.iter().enumerate() {
            if !Part::LAST.contains(&part) {
                let now = encoded(gateway, part);
                assert!(now == *copy, "part {part} has changed, and was not told");
            }
        }
    }
}

#[test]
fn what_a_call_does_not_touch_is_not_copied_again() {
    let Rig { mut gateway, now_us, .. } = Rig::new();
    let now = Instant::from_micros(now_us);
    let copied = |gateway: &mut Gateway| {
        gateway.next_deadline();
        std::iter::from_fn(|| gateway.next_to_copy()).collect()
    };
    gateway.begin_copy();
    let all: Vec<_> = copied(&mut gateway);
    let links = &all[all.len() - MAX_LINKS..];
    gateway.handle(now, Event::Tick, &mut |_, _| {});
    assert_eq!(copied(&mut gateway), []);
    let hello = requests::Hello { protocol_major: 1, protocol_minor: 0, session: 7 };
    let mut frame = [0; MAX_FRAME];
    let length = Request::Hello(hello).encode_frame(1, &mut frame).unwrap();
    let bytes = &frame[..length];
    gateway.handle(now, Event::HostBytes { link: 1, bytes }, &mut |_, _| {});
    // What the host is told of, and its link.
    let ring = copied(&mut gateway);
    assert_eq!(ring.len(), 2);
    assert_eq!(ring[1], links[1]);
    assert!(gateway.poll_host(1, &mut [0; MAX_FRAME], &mut |_, _| {}).is_some());
    assert_eq!(copied(&mut gateway), [links[1].clone()]);
}

#[test]
fn each_byte_of_a_gateway_is_copied_with_one_part() {
    let rig = Rig::new();
    let parts = (0..Part::COUNT).flat_map(|part| rig.gateway.bytes_of(part));
    let mut all: Vec<_> = parts.filter(|bytes| !bytes.is_empty()).collect();
    all.sort_by_key(|bytes| bytes.start);
    let end = all.iter().fold(0, |end, bytes| {
        assert_eq!(bytes.start, end);
        bytes.end
    });
    assert_eq!(end, size_of::<Gateway>());
    // The rest comes last, in up to three pieces.
    assert!(all.len() <= MAX_AXES + MAX_LINKS + 3, "{}", all.len());
}

/// Names for all, a long list of changes, eight long replies and most of a request: no part has much.
#[test]
fn no_part_of_a_gateway_that_is_full_takes_long() {
    let mut rig = bench::rmd_axes(8);
    let begin = Request::BeginChanges(requests::BeginChanges {});
    let add = |rig: &mut Rig, changes: &[Change]| {
        let changes = changes.iter().cloned().collect();
        rig.ask(Request::AddChanges(requests::AddChanges { changes })).unwrap();
    };
    rig.ask(begin.clone()).unwrap();
    for axis in 0..8 {
        let name = Some(Text::try_from(format!("sixteen_letter_{axis}").as_str()).unwrap());
        add(&mut rig, &[Change::Name { of: Subject::Axis(axis), name }]);
    }
    rig.ask(Request::ApplyChanges(requests::ApplyChanges {})).unwrap();
    rig.ask(begin).unwrap();
    let parameter = AxisParameter::VelocityLimitRadS.number();
    let limit = Change::Axis { axis: 0, parameter, value: Some(Value::Float(1.1)) };
    for _ in 0..88 {
        add(&mut rig, &[0; 4].map(|_| limit.clone()));
    }
    for part in 0..8 {
        let sequence = rig.send(&requests::ReadFlightRecord { part, offset: 0 }.into());
        assert!(rig.gateway.take_flight_read().is_some());
        let bytes = [0xA5; MAX_FLIGHT_RECORD_BYTES];
        let page = FlightPage { id: 7, parts: 9, length: 9_000, bytes: &bytes };
        rig.handle(Event::FlightRecord { result: Ok(page) });
        assert!(matches!(rig.answer(sequence), Some(Ok(_))));
    }
    rig.bytes(&[0x55; MAX_FRAME - 8]);
    let parts = (0..Part::COUNT).map(|part| encoded(&rig.gateway, part).len());
    assert!(parts.filter(|bytes| *bytes > 400).count() > 8, "it is full");
}
