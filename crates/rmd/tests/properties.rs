//! What holds for every value and every byte string.

mod frame;

use embedded_can::{Frame, StandardId};
use frame::CanFrame;
use proptest::prelude::*;
use rmd::rs485::{self, Deframer, FRAME_LEN};
use rmd::{
    Celsius, Centiamps, Centidegrees, CentidegreesPerSecond, Decivolts, DecodeError, Degrees,
    DegreesPerSecond, Faults, Milliseconds, Motion, Node, RawNotice, Reply, Request, SpeedLimit, answer, can,
};

fn node() -> impl Strategy<Value = Node> {
    (Node::MIN..=Node::MAX).prop_map(|node| Node::new(node).expect("1..=32"))
}

/// Eight bytes whose command has no variant.
fn unknown() -> impl Strategy<Value = [u8; 8]> {
    let commands =
        prop::sample::select(vec![0x00, 0x20, 0x60, 0x70, 0x76, 0x79, 0x9D, 0xA3, 0xA5, 0xA8, 0xB4, 0xFF]);
    (commands, any::<[u8; 7]>())
        .prop_map(|(command, [b1, b2, b3, b4, b5, b6, b7])| [command, b1, b2, b3, b4, b5, b6, b7])
}

fn request() -> impl Strategy<Value = Request> {
    prop_oneof![
        prop::sample::select(vec![
            Request::ReadMultiTurnAngle,
            Request::ReadStatus1,
            Request::ReadStatus2,
            Request::Shutdown,
            Request::Stop,
            Request::ReleaseBrake,
            Request::LockBrake,
        ]),
        any::<i16>().prop_map(|raw| Request::TorqueCurrent { current: Centiamps(raw) }),
        any::<i32>().prop_map(|raw| Request::Velocity { speed: CentidegreesPerSecond(raw) }),
        any::<(u16, i32)>().prop_map(|(max_speed, angle)| Request::AbsolutePosition {
            max_speed: SpeedLimit(max_speed),
            angle: Centidegrees(angle),
        }),
        any::<u32>().prop_map(|raw| Request::SetCommunicationTimeout { timeout: Milliseconds(raw) }),
        unknown().prop_map(|data| Request::Unknown { data }),
    ]
}

fn motion() -> impl Strategy<Value = Motion> {
    (any::<i8>(), any::<i16>(), any::<i16>(), -32767..=32767_i16).prop_map(
        |(temperature, current, speed, angle)| Motion {
            temperature: Celsius(temperature),
            current: Centiamps(current),
            speed: DegreesPerSecond(speed),
            angle: Degrees(angle),
        },
    )
}

fn reply() -> impl Strategy<Value = Reply> {
    prop_oneof![
        prop::sample::select(vec![Reply::Shutdown, Reply::Stop, Reply::BrakeReleased, Reply::BrakeLocked]),
        any::<i32>().prop_map(|raw| Reply::MultiTurnAngle { angle: Centidegrees(raw) }),
        any::<(i8, bool, u16, u16)>().prop_map(|(temperature, brake_released, voltage, faults)| {
            Reply::Status1 {
                temperature: Celsius(temperature),
                brake_released,
                voltage: Decivolts(voltage),
                faults: Faults::from_bits_retain(faults),
            }
        }),
        motion().prop_map(|motion| Reply::Status2 { motion }),
        motion().prop_map(|motion| Reply::TorqueCurrent { motion }),
        motion().prop_map(|motion| Reply::Velocity { motion }),
        motion().prop_map(|motion| Reply::AbsolutePosition { motion }),
        any::<u32>().prop_map(|raw| Reply::CommunicationTimeout { timeout: Milliseconds(raw) }),
        // On RS485 a notice always has eight bytes; shorter ones are covered beside the CAN code.
        any::<[u8; 7]>()
            .prop_map(|payload| Reply::TimeoutNotice { raw: RawNotice::new(&payload).expect("7 bytes") }),
        unknown().prop_map(|data| Reply::Unknown { data }),
    ]
}

/// Bytes as a disturbed line carries them: frames, cut frames and bytes that look like the start of one.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        (node(), request())
            .prop_map(|(node, value)| rs485::request(node, &value).expect("encodable").to_vec()),
        (node(), reply(), 0..FRAME_LEN).prop_map(|(node, value, len)| {
            rs485::reply(node, &value).expect("encodable")[..len].to_vec()
        }),
        prop::collection::vec(prop::sample::select(vec![0x3E, 0x01, 0x08, 0x00, 0x9C]), 0..8),
        prop::collection::vec(any::<u8>(), 0..8),
    ];
    prop::collection::vec(piece, 0..8).prop_map(|pieces| pieces.concat())
}

/// The frames of a whole recording, found by trying every position.
fn frames_of(mut line: &[u8]) -> Vec<[u8; FRAME_LEN]> {
    let mut frames = Vec::new();
    while let Some(frame) = line.first_chunk::<FRAME_LEN>() {
        let valid = matches!(rs485::decode_reply(frame), Ok(_) | Err(DecodeError::Node { .. }));
        if valid {
            frames.push(*frame);
        }
        line = &line[if valid { FRAME_LEN } else { 1 }..];
    }
    frames
}

proptest! {
    #[test]
    fn values_survive(node in node(), request in request(), reply in reply()) {
        prop_assert_eq!(Request::decode(&request.encode().expect("encodable")), request);
        prop_assert_eq!(Reply::decode(&reply.encode().expect("encodable")), Ok(reply));

        let frame: CanFrame = can::request(node, &request).expect("encodable");
        prop_assert_eq!(can::decode_request(&frame), Ok((node, request)));
        let frame: CanFrame = can::reply(node, &reply).expect("encodable");
        prop_assert_eq!(can::decode_reply(&frame), Ok((node, reply)));

        let frame = rs485::request(node, &request).expect("encodable");
        prop_assert_eq!(rs485::decode_request(&frame), Ok((node, request)));
        let frame = rs485::reply(node, &reply).expect("encodable");
        prop_assert_eq!(rs485::decode_reply(&frame), Ok((node, reply)));
    }

    #[test]
    fn no_bytes_panic(
        id in 0..0x800_u16,
        data in prop::collection::vec(any::<u8>(), 0..=8),
        sent in any::<[u8; 8]>(),
        frame in any::<[u8; FRAME_LEN]>(),
    ) {
        let request = Request::decode(&sent);
        prop_assert_eq!(Request::decode(&request.encode().expect("decoded requests can be sent")), request);
        if let Ok(reply) = Reply::decode(&data) {
            let _ = (reply.encode(), answer(&request, &reply));
        }
        let can_frame = CanFrame::new(StandardId::new(id).expect("11 bits"), &data).expect("at most 8 bytes");
        let _ = (can::decode_request(&can_frame), can::decode_reply(&can_frame));
        let _ = (rs485::decode_request(&frame), rs485::decode_reply(&frame));
    }

    #[test]
    fn the_deframer_finds_what_a_search_finds(line in line()) {
        let mut deframer = Deframer::new();
        let frames: Vec<_> = deframer.push_slice(&line).collect();
        prop_assert_eq!(&frames, &frames_of(&line));
        let dropped = usize::try_from(deframer.rejected()).expect("small");
        prop_assert!(deframer.pending() < FRAME_LEN);
        prop_assert_eq!(frames.len() * FRAME_LEN + dropped + deframer.pending(), line.len());
    }
}
