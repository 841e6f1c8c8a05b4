use super::*;
use crate::motion::Motion;
use crate::motion_mode::MotionCommand;
use crate::units::{Celsius, Centiamps, Degrees, DegreesPerSecond};

const REQUEST: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
const REPLY: [u8; 13] =
    [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];

fn node(node: u8) -> Node {
    Node::new(node).expect("1..=32")
}

/// Proven frame; layout RMD V3.6 §2.13.4.
#[test]
fn request_frame() {
    assert_eq!(request(node(1), &Request::ReadStatus2), Ok(REQUEST));
    assert_eq!(decode_request(&REQUEST), Ok((node(1), Request::ReadStatus2)));
}

/// Proven frame; layout RMD V3.6 §2.13.4.
#[test]
fn reply_frame() {
    let status = Reply::Status2 {
        motion: Motion {
            temperature: Celsius(25),
            current: Centiamps(0x1234),
            speed: DegreesPerSecond(-100),
            angle: Degrees(0x5678),
        },
    };
    assert_eq!(reply(node(1), &status), Ok(REPLY));
    assert_eq!(decode_reply(&REPLY), Ok((node(1), status)));
}

#[test]
fn wrong_header_length_and_checksum() {
    let mut frame = REQUEST;
    frame[0] = 0x3D;
    assert_eq!(decode_request(&frame), Err(DecodeError::Header { got: 0x3D, expected: 0x3E }));
    let mut frame = REQUEST;
    frame[2] = 0x07;
    assert_eq!(decode_request(&frame), Err(DecodeError::Length { got: 7, expected: 8 }));
    let mut frame = REQUEST;
    frame[11] = 0xF3;
    assert_eq!(decode_reply(&frame), Err(DecodeError::Checksum { got: 0x30F3, expected: 0x30F2 }));
}

/// High byte first is not the protocol's order (RMD V3.6 §1.2.2).
#[test]
fn the_checksum_has_its_low_byte_first() {
    let frame = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0x30, 0xF2];
    assert_eq!(
        decode_request(&frame),
        Err(DecodeError::Checksum { got: 0xF230, expected: 0x30F2 })
    );
}

/// Broadcast and out-of-range ids with a valid checksum (computed apart from this crate) name no
/// single motor.
#[test]
fn ids_outside_1_to_32() {
    let broadcast = [0x3E, 0xCD, 0x08, 0x80, 0, 0, 0, 0, 0, 0, 0, 0x36, 0x6A];
    assert_eq!(decode_reply(&broadcast), Err(DecodeError::Node { node: 0xCD }));
    let zero = [0x3E, 0x00, 0x08, 0x80, 0, 0, 0, 0, 0, 0, 0, 0xA2, 0xAC];
    assert_eq!(decode_request(&zero), Err(DecodeError::Node { node: 0 }));
    let above = [0x3E, 0x21, 0x08, 0x80, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x03];
    assert_eq!(decode_request(&above), Err(DecodeError::Node { node: 33 }));
}

/// RMD V3.6 §6.2 example 1; checksum computed apart from this crate.
#[test]
fn every_motor_at_once() {
    let frame = [0x3E, 0xCD, 0x08, 0x80, 0, 0, 0, 0, 0, 0, 0, 0x36, 0x6A];
    assert_eq!(broadcast(&Request::Shutdown), Ok(frame));
    assert_eq!(decode_any_request(&frame), Ok((Target::All, Request::Shutdown)));
    assert_eq!(decode_request(&frame), Err(DecodeError::Node { node: 0xCD }));
}

/// RMD V3.6 §7.4, both examples: the id byte stays 0xCD. Checksums computed apart from this crate.
#[test]
fn the_rs485_id() {
    let write = [0x3E, 0xCD, 0x08, 0x79, 0, 0, 0, 0, 0, 0, 0x02, 0x78, 0x85];
    assert_eq!(request(node(1), &Request::SetRs485Id { id: 2 }), Ok(write));
    assert_eq!(decode_any_request(&write), Ok((Target::All, Request::SetRs485Id { id: 2 })));
    assert_eq!(decode_reply(&write), Ok((node(2), Reply::Rs485IdSet { id: node(2) })));
    assert_eq!(reply(node(2), &Reply::Rs485IdSet { id: node(2) }), Ok(write));

    let read = [0x3E, 0xCD, 0x08, 0x79, 0, 0x01, 0, 0, 0, 0, 0, 0xF8, 0x95];
    assert_eq!(broadcast(&Request::ReadRs485Id), Ok(read));
    assert_eq!(decode_any_request(&read), Ok((Target::All, Request::ReadRs485Id)));
    assert_eq!(decode_reply(&read), Err(DecodeError::BusId { word: 0 }));
    let answer = [0x3E, 0xCD, 0x08, 0x79, 0, 0x01, 0, 0, 0, 0, 0x02, 0x79, 0x54];
    assert_eq!(decode_reply(&answer), Ok((node(2), Reply::Rs485Id { id: node(2) })));
    assert_eq!(reply(node(2), &Reply::Rs485Id { id: node(2) }), Ok(answer));
}

/// RMD V3.6 §5 and §4 speak of CAN only.
#[test]
fn what_is_for_can_is_refused() {
    let refused = |value| {
        Err(EncodeError::Forbidden { field: "command", value, reason: "this command is for CAN" })
    };
    let motion = Request::MotionMode { command: MotionCommand::NEUTRAL };
    assert_eq!(request(node(1), &motion), refused(0));
    assert_eq!(broadcast(&Request::ReadCanId), refused(0x79));
    assert_eq!(reply(node(1), &Reply::CanIdSet { id: node(1) }), refused(0x79));
}
