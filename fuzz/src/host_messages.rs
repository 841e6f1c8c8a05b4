//! The bodies of host messages, the checksum being right.

use host_protocol::{
    Deframer, EncodeError, Error, EventMessage, Frame, Kind, MAX_BODY, MAX_FRAME, Reply, Request,
    encode_body,
};

use crate::take::Take;

pub fn check(bytes: &[u8]) {
    let mut take = Take(bytes);
    let (kind, number) = (take.byte(), take.word());
    let body = take.bytes(MAX_BODY);
    let bytes = frame(kind % 5 + 1, 1, number, body);
    deframed(&bytes, |frame| {
        assert_eq!((frame.number, frame.body), (number, body));
        let once = again(&frame);
        if let Some(once) = once {
            // Numbers that are not numbers compare by their bytes.
            assert_eq!(deframed(&once, |frame| again(&frame)).as_ref(), Some(&once));
        }
    });
}

/// The frame of what the message means; `None` where it means nothing.
fn again(frame: &Frame<'_>) -> Option<Vec<u8>> {
    let mut out = [0; MAX_FRAME];
    let Frame { kind, sequence, number, body, .. } = *frame;
    let length: Result<usize, EncodeError> = match kind {
        Kind::Request => Request::decode(number, body).ok()?.encode_frame(sequence, &mut out),
        Kind::WatcherRequest => encode_body(kind, sequence, number, body, &mut out),
        Kind::Reply => Reply::decode(number, body).ok()?.encode_frame(sequence, &mut out),
        Kind::Error => {
            let error = Error::decode(number, body).ok()?;
            _ = error.to_string();
            error.encode_frame(sequence, &mut out)
        }
        Kind::Event => {
            let EventMessage { dropped, time_us, event } =
                EventMessage::decode(number, body).ok()?;
            event.encode_frame(sequence, dropped, time_us, &mut out)
        }
    };
    let length = length.expect("what was received fits");
    Some(out[..length].to_vec())
}

/// What `use_it` makes of the one frame in these bytes.
fn deframed<T>(bytes: &[u8], use_it: impl Fn(Frame<'_>) -> T) -> T {
    let mut deframer = Deframer::new();
    let (end, start) = bytes.split_last().expect("a frame");
    assert!(start.iter().all(|byte| deframer.push(*byte).is_none()));
    use_it(deframer.push(*end).expect("a delimiter").expect("a frame"))
}

/// A whole frame, its kind 1..=5.
pub fn frame(kind: u8, sequence: u16, number: u16, body: &[u8]) -> Vec<u8> {
    let kind = Kind::from_number(kind).expect("1..=5");
    let mut out = [0; MAX_FRAME];
    let length = encode_body(kind, sequence, number, body, &mut out).expect("fits");
    out[..length].to_vec()
}
