//! How calls are kept: literal bytes, made by hand from the table in `call.rs`.

use super::Call;
use embedded_can::{ExtendedId, Id};
use gateway::{Event, Then};
use host_protocol::CanFrame;

fn vectors() -> [(u64, Call<'static>, &'static [u8]); 15] {
    let standard = CanFrame::standard(0x141, &[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]).unwrap();
    let extended = Id::Extended(ExtendedId::new(0x0001_0203).unwrap());
    let remote = CanFrame::remote_frame(extended, 2).unwrap();
    [
        (0, Call::Handle(Event::Tick), &[0x10]),
        (
            258,
            Call::Handle(Event::CanReceived { bus: 1, frame: standard }),
            &[0x21, 2, 1, 0x41, 1, 0, 0, 8, 0xA2, 0, 0, 0, 0x10, 0x27, 0, 0],
        ),
        (
            1,
            Call::Handle(Event::CanReceived { bus: 0, frame: remote }),
            &[0x01, 1, 0, 0x03, 0x02, 0x01, 0xC0, 2, 0, 0],
        ),
        (0, Call::Handle(Event::Transmitted { bus: 3, slot: 1 }), &[0x72, 1]),
        (
            0xFFFE,
            Call::Handle(Event::HostBytes { link: 2, bytes: &[5, 0] }),
            &[0x43, 0xFE, 0xFF, 2, 0, 5, 0],
        ),
        (
            0xFFFF,
            Call::Handle(Event::SerialReceived { bus: 2, bytes: &[0x3E], then: Then::Bytes }),
            &[0x44, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0, 0, 0, 1, 0, 0x3E],
        ),
        (
            0,
            Call::Handle(Event::SerialReceived { bus: 2, bytes: &[0x3E], then: Then::Idle }),
            &[0x58, 1, 0, 0x3E],
        ),
        (
            0,
            Call::Handle(Event::SerialReceived { bus: 2, bytes: &[0x3E], then: Then::Frame }),
            &[0x59, 1, 0, 0x3E],
        ),
        (7, Call::PollCancel { bus: 0 }, &[0x05, 7, 0]),
        (1, Call::TakeSave, &[0x0F, 1, 0, 5]),
        (0, Call::PollCancel { bus: 1 }, &[0x35]),
        (0, Call::PollTransmit { bus: 2 }, &[0x56]),
        (0, Call::PollHost { link: 1 }, &[0x37]),
        // By postcard: the fifth call.
        (0, Call::TakeSave, &[0x1F, 5]),
        // The first call, the tenth event.
        (0, Call::Handle(Event::EStopInput { open: true }), &[0x1F, 0, 8, 1]),
    ]
}

#[test]
fn each_call_is_kept_as_these_bytes_and_read_from_them() {
    for (since_us, call, bytes) in vectors() {
        let mut out = [0xEE; 32];
        let length = call.encode(since_us, &mut out);
        assert_eq!(length.and_then(|length| out.get(..length)), Some(bytes), "{call:?}");
        let behind = [bytes, &[9]].concat();
        assert_eq!(Call::decode(&behind), Some((since_us, call, &[9][..])));
        for short in 0..bytes.len() {
            assert_eq!(call.encode(since_us, &mut out[..short]), None, "{call:?} in {short}");
            assert_eq!(Call::decode(&bytes[..short]), None, "{short} bytes of {call:?}");
        }
    }
}

#[test]
fn what_is_no_call_is_none() {
    for first in (0x0A..0x0F).chain(0x1A..0x1F).chain([0x3A]) {
        assert_eq!(Call::decode(&[first, 0, 0, 0, 0, 0, 0, 0]), None, "{first:#x}");
    }
    // A frame of nine bytes.
    assert_eq!(Call::decode(&[1, 0, 0, 1, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0]), None);
}
