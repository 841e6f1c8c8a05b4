//! Whoever copies what is said to have changed has a copy of all: looked at again and again in every
//! test of this folder.

use crate::rig::Rig;
use gateway::{Event, Gateway, Instant, MAX_AXES, MAX_BUSES, MAX_LINKS, MAX_SNAPSHOT, Part};
use host_protocol::{MAX_FRAME, Request, requests};
use std::ops::Range;

/// The parts of a snapshot that are copied one by one.
fn copied_alone() -> impl Iterator<Item = usize> {
    let links = 1 + MAX_AXES + 1 + MAX_BUSES + 1;
    (1..=MAX_AXES).chain(links..links + MAX_LINKS)
}

fn encoded(gateway: &Gateway, part: usize) -> Vec<u8> {
    let mut bytes = [0; MAX_SNAPSHOT];
    let part = Part::of(gateway, part).expect("there is one");
    postcard::to_slice(&part, &mut bytes).expect("it fits").to_vec()
}

/// Copies of the axes and links of one gateway.
pub struct Copy {
    parts: Vec<(usize, Range<usize>, Vec<u8>)>,
}

impl Copy {
    pub fn begin(gateway: &mut Gateway) -> Self {
        gateway.begin_copy();
        let part = |part| {
            let bytes = gateway.next_to_copy().expect("nothing has been copied");
            (part, bytes, encoded(gateway, part))
        };
        let parts: Vec<_> = copied_alone().map(part).collect();
        assert_eq!(gateway.next_to_copy(), None);
        // Each byte is in one of them.
        let alone = parts.iter().map(|(_, bytes, _)| bytes.clone());
        let mut all: Vec<_> = alone.chain(gateway.rest_to_copy()).collect();
        all.sort_by_key(|bytes| bytes.start);
        let end = all.iter().fold(0, |end, bytes| {
            assert_eq!(bytes.start, end);
            bytes.end
        });
        assert_eq!(end, size_of::<Gateway>());
        Self { parts }
    }

    /// Copies what has changed; then it is as the gateway is.
    pub fn go_on(&mut self, gateway: &mut Gateway) {
        while let Some(bytes) = gateway.next_to_copy() {
            let mut parts = self.parts.iter_mut();
            let (part, _, copy) = parts.find(|(_, of, _)| *of == bytes).expect("one of them");
            *copy = encoded(gateway, *part);
        }
        assert!(!gateway.has_more_to_copy());
        for (part, _, copy) in &self.parts {
            assert!(encoded(gateway, *part) == *copy, "part {part} has changed, and was not told");
        }
    }
}

#[test]
fn what_a_call_does_not_touch_is_not_copied_again() {
    let Rig { mut gateway, now_us, .. } = Rig::new();
    let now = Instant::from_micros(now_us);
    let copied = |gateway: &mut Gateway| std::iter::from_fn(|| gateway.next_to_copy()).count();
    gateway.begin_copy();
    assert_eq!(copied(&mut gateway), MAX_AXES + MAX_LINKS);
    gateway.handle(now, Event::Tick, &mut |_, _| {});
    assert_eq!(copied(&mut gateway), 0);
    let hello = requests::Hello { protocol_major: 1, protocol_minor: 0, session: 7 };
    let mut frame = [0; MAX_FRAME];
    let length = Request::Hello(hello).encode_frame(1, &mut frame).unwrap();
    let bytes = &frame[..length];
    gateway.handle(now, Event::HostBytes { link: 1, bytes }, &mut |_, _| {});
    assert_eq!(copied(&mut gateway), 1);
    assert!(gateway.poll_host(1, &mut [0; MAX_FRAME], &mut |_, _| {}).is_some());
    assert_eq!(copied(&mut gateway), 1);
}
