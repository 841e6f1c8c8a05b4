//! The bounds of the sizes are reached by the largest values: none of them lies too low or too
//! high.

extern crate std;
use std::vec::Vec as StdVec;

use embedded_can::{ExtendedId, Id};

use crate::text::{Text, Vec};
use crate::*;

/// The value of a type that takes the most bytes in a body.
pub(crate) trait Largest {
    fn largest() -> Self;
}

/// The bytes of an enum's variant, and how it is made.
type Variant<T> = (usize, fn() -> T);

/// The largest of an enum's variants.
pub(crate) fn of_variants<T>(variants: &[Variant<T>]) -> T {
    variants.iter().max_by_key(|(size, _)| *size).expect("a variant").1()
}

macro_rules! largest {
    ($($type:ty: $value:expr),+ $(,)?) => {
        $(impl Largest for $type { fn largest() -> Self { $value } })+
    };
}

largest! {
    bool: true,
    u8: u8::MAX,
    u16: u16::MAX,
    u32: u32::MAX,
    u64: u64::MAX,
    i32: i32::MIN,
    f32: f32::MAX,
    FixedU32: FixedU32(u32::MAX),
    Protocol: Protocol::D5,
    ProtocolSet: ProtocolSet::from_bits(u8::MAX),
    StateFields: StateFields::from_bits(u8::MAX),
    CanId: CanId(Id::Extended(ExtendedId::MAX)),
    CanFrame: CanFrame::data_frame(Id::Extended(ExtendedId::MAX), &[0xFF; MAX_CAN_DATA]).unwrap(),
}

impl<T: Largest> Largest for Option<T> {
    fn largest() -> Self {
        Some(T::largest())
    }
}

impl<T: Largest + Copy, const N: usize> Largest for [T; N] {
    fn largest() -> Self {
        [T::largest(); N]
    }
}

impl<T: Largest, const N: usize> Largest for Vec<T, N> {
    fn largest() -> Self {
        (0..N).map(|_| T::largest()).collect()
    }
}

impl<const N: usize> Largest for Text<N> {
    fn largest() -> Self {
        core::iter::repeat_n('x', N).collect()
    }
}

/// Bytes of the body of the frame that `encode` writes.
fn body_length(encode: impl FnOnce(&mut [u8]) -> Result<usize, EncodeError>) -> usize {
    let mut out = [0; MAX_FRAME];
    let length = encode(&mut out).unwrap();
    let mut deframer = Deframer::new();
    let mut lengths = StdVec::new();
    for byte in &out[..length] {
        lengths.extend(deframer.push(*byte).map(|frame| frame.unwrap().body.len()));
    }
    let [length] = lengths[..] else { panic!("one frame") };
    length
}

#[test]
fn every_message_reaches_its_bound() {
    for ((request, request_bound), (reply, reply_bound)) in messages::largest_ones() {
        let length = body_length(|out| request.encode_frame(u16::MAX, out));
        assert_eq!(length, request_bound, "{}", request.name());
        let length = body_length(|out| reply.encode_frame(u16::MAX, out));
        assert_eq!(length, reply_bound, "reply to {}", reply.name());
    }
    for (error, bound) in Error::largest_ones() {
        assert_eq!(body_length(|out| error.encode_frame(u16::MAX, out)), bound, "{}", error.name());
    }
    for (event, bound) in Event::largest_ones() {
        let bound = bound + u32::MAX_SIZE + u64::MAX_SIZE;
        let length = body_length(|out| event.encode_frame(u16::MAX, u32::MAX, u64::MAX, out));
        assert_eq!(length, bound, "{}", event.name());
    }
}

#[test]
fn the_other_raw_frame_and_the_other_values_are_no_longer() {
    let (bus, frame) = (u8::MAX, RawFrame::Can(Largest::largest()));
    let raw = Request::from(requests::RawSend { bus, frame });
    let bound = requests::RawSend::MAX_SIZE;
    assert!(body_length(|out| raw.encode_frame(u16::MAX, out)) <= bound);
    for value in [Value::Unsigned(u32::MAX), Value::Float(f32::MAX), Value::Bool(true)] {
        let (axis, parameter) = (u8::MAX, u16::MAX);
        let request = Request::from(requests::ConfigureAxis { axis, parameter, value });
        let bound = requests::ConfigureAxis::MAX_SIZE;
        assert!(body_length(|out| request.encode_frame(u16::MAX, out)) <= bound, "{value}");
    }
}

/// Counted by hand.
#[test]
fn some_bounds_are_known() {
    let bound_of_error =
        |number: u16| Error::largest_ones().find(|(error, _)| error.number() == number).unwrap().1;
    // Axis 1, reason 1 + quantity 1 + parameter 3 + two floats.
    assert_eq!(bound_of_error(13), 14);
    // Bus 1, bitrate 5, eight of them 40.
    assert_eq!(bound_of_error(65), 46);
    let bound_of_event =
        |number: u16| Event::largest_ones().find(|(event, _)| event.number() == number).unwrap().1;
    // Axis 1, reason 13, time 10, three optional floats 15, unreachable 1.
    assert_eq!(bound_of_event(0x8001), 40);
    // Axis 1, state 2, six readings of 10, fault word 12.
    assert_eq!(bound_of_event(0x800C), 75);
}
