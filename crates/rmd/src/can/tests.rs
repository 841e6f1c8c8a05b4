use codec::testing::CanFrame;
use embedded_can::ExtendedId;

use super::*;
use crate::baud::BaudCode;
use crate::notice::RawNotice;
use crate::units::{Centiamps, EncoderPulses};

fn node(node: u8) -> Node {
    Node::new(node).expect("1..=32")
}

fn standard(id: u16, data: &[u8]) -> CanFrame {
    CanFrame::new(StandardId::new(id).expect("11 bits"), data).expect("at most 8 bytes")
}

/// RMD V3.6 §1.1.2. Ids from 0x280 up belong to broadcast, configuration and other protocols.
#[test]
fn ids_of_the_first_and_last_motor() {
    assert_eq!(request_id(node(1)).as_raw(), 0x141);
    assert_eq!(request_id(node(32)).as_raw(), 0x160);
    assert_eq!(reply_id(node(1)).as_raw(), 0x241);
    assert_eq!(reply_id(node(32)).as_raw(), 0x260);
    assert_eq!(motion_request_id(node(1)).as_raw(), 0x401);
    assert_eq!(motion_request_id(node(32)).as_raw(), 0x420);
    assert_eq!(motion_reply_id(node(1)).as_raw(), 0x501);
    assert_eq!(motion_reply_id(node(32)).as_raw(), 0x520);
}

#[test]
fn only_reply_ids_name_a_node() {
    let of = |id| node_of_reply_id(Id::Standard(StandardId::new(id).expect("11 bits")));
    assert_eq!(of(0x241), Some(node(1)));
    assert_eq!(of(0x260), Some(node(32)));
    assert_eq!(of(0x501), Some(node(1)));
    assert_eq!(of(0x520), Some(node(32)));
    for id in [0x000, 0x141, 0x240, 0x261, 0x280, 0x281, 0x300, 0x341, 0x401, 0x500, 0x521, 0x7FF] {
        assert_eq!(of(id), None, "{id:#05x}");
    }
    assert_eq!(node_of_reply_id(Id::Extended(ExtendedId::new(0x241).expect("29 bits"))), None);
}

/// RMD V3.6 §2.17.4: 1 A to node 1, and the reply.
#[test]
fn torque_current_to_node_1() {
    let sent = standard(0x141, &[0xA1, 0x00, 0x00, 0x00, 0x64, 0x00, 0x00, 0x00]);
    let torque = Request::TorqueCurrent { current: Centiamps(100) };
    assert_eq!(request(node(1), &torque), Ok(sent));
    assert_eq!(decode_request(&sent), Ok((node(1), torque)));

    let received = standard(0x241, &[0xA1, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00]);
    let (from, decoded) = decode_reply(&received).expect("a reply");
    assert_eq!(from, node(1));
    assert_eq!(reply(from, &decoded), Ok(received));
}

#[test]
fn a_short_notice_stays_short() {
    for payload in [&[][..], &[0x00], &[1, 2, 3, 4, 5, 6, 7]] {
        let notice =
            Reply::TimeoutNotice { raw: RawNotice::new(payload).expect("at most 7 bytes") };
        let frame: CanFrame = reply(node(2), &notice).expect("a frame");
        assert_eq!(frame.dlc(), 1 + payload.len());
        assert_eq!(decode_reply(&frame), Ok((node(2), notice)));
    }
    assert_eq!(
        reply(node(2), &Reply::TimeoutNotice { raw: RawNotice::default() }),
        Ok(standard(0x242, &[0xF1]))
    );
}

#[test]
fn frames_of_others_are_refused() {
    let stop = [0x81, 0, 0, 0, 0, 0, 0, 0];
    for id in [0x140, 0x161, 0x241, 0x280, 0x300, 0x400, 0x421, 0x501] {
        assert_eq!(decode_request(&standard(id, &stop)), Err(DecodeError::WrongId { id }));
    }
    for id in [0x141, 0x240, 0x261, 0x281, 0x300, 0x401, 0x500, 0x521] {
        assert_eq!(decode_reply(&standard(id, &stop)), Err(DecodeError::WrongId { id }));
    }
    let extended = CanFrame::new(ExtendedId::new(0x241).expect("29 bits"), &stop).expect("a frame");
    assert_eq!(decode_reply(&extended), Err(DecodeError::ExtendedId { id: 0x241 }));
    let remote =
        CanFrame::new_remote(StandardId::new(0x241).expect("11 bits"), 8).expect("a frame");
    assert_eq!(decode_reply(&remote), Err(DecodeError::RemoteFrame));
}

#[test]
fn short_frames_are_refused() {
    assert_eq!(
        decode_request(&standard(0x141, &[0x81])),
        Err(DecodeError::Length { got: 1, expected: 8 })
    );
    assert_eq!(
        decode_request(&standard(0x141, &[])),
        Err(DecodeError::Length { got: 0, expected: 8 })
    );
    assert_eq!(
        decode_reply(&standard(0x241, &[0x81])),
        Err(DecodeError::Length { got: 1, expected: 8 })
    );
}

/// RMD V3.6 §3.2: one request, an answer from every motor.
#[test]
fn every_motor_at_once() {
    let sent = standard(0x280, &[0x60, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(broadcast(&Request::ReadEncoderPosition), Ok(sent));
    assert_eq!(decode_any_request(&sent), Ok((Target::All, Request::ReadEncoderPosition)));
    assert_eq!(decode_request(&sent), Err(DecodeError::WrongId { id: 0x280 }));
    let answer = standard(0x244, &[0x60, 0, 0, 0, 0x40, 0x9C, 0, 0]);
    let position = EncoderPulses(40_000);
    assert_eq!(decode_reply(&answer), Ok((node(4), Reply::EncoderPosition { position })));
}

/// RMD V3.6 §4.4, both examples. Request and echo of a write are the same frame.
#[test]
fn the_can_id() {
    let write = standard(0x300, &[0x79, 0, 0x00, 0, 0, 0, 0, 0x02]);
    assert_eq!(request(node(1), &Request::SetCanId { id: 2 }), Ok(write));
    assert_eq!(broadcast(&Request::SetCanId { id: 2 }), Ok(write));
    assert_eq!(decode_any_request(&write), Ok((Target::All, Request::SetCanId { id: 2 })));
    assert_eq!(decode_reply(&write), Ok((node(2), Reply::CanIdSet { id: node(2) })));
    assert_eq!(reply(node(2), &Reply::CanIdSet { id: node(2) }), Ok(write));

    let read = standard(0x300, &[0x79, 0, 0x01, 0, 0, 0, 0, 0]);
    assert_eq!(request(node(1), &Request::ReadCanId), Ok(read));
    assert_eq!(decode_any_request(&read), Ok((Target::All, Request::ReadCanId)));
    let answer = standard(0x300, &[0x79, 0, 0x01, 0, 0, 0, 0x42, 0x02]);
    assert_eq!(decode_reply(&answer), Ok((node(2), Reply::CanId { id: node(2) })));
    assert_eq!(reply(node(2), &Reply::CanId { id: node(2) }), Ok(answer));

    assert_eq!(decode_request(&read), Err(DecodeError::WrongId { id: 0x300 }));
    assert_eq!(decode_reply(&read), Err(DecodeError::BusId { word: 0 }));
    let beyond = standard(0x300, &[0x79, 0, 0x00, 0, 0, 0, 0, 0x21]);
    assert_eq!(decode_any_request(&beyond), Ok((Target::All, Request::SetCanId { id: 33 })));
    assert_eq!(decode_reply(&beyond), Err(DecodeError::BusId { word: 33 }));
}

/// RMD V3.6 §5.4: the printed request and reply.
#[test]
fn motion_mode() {
    let sent = standard(0x401, &[0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55]);
    let command =
        MotionCommand { position: 0xE666, velocity: 0x82E, kp: 0x052, kd: 0x333, torque: 0xB55 };
    assert_eq!(request(node(1), &Request::MotionMode { command }), Ok(sent));
    assert_eq!(decode_request(&sent), Ok((node(1), Request::MotionMode { command })));

    let received = standard(0x501, &[0x01, 0xE6, 0x65, 0x82, 0xEB, 0x55, 0x00, 0x00]);
    let feedback = MotionFeedback { id: 1, position: 0xE665, velocity: 0x82E, torque: 0xB55 };
    assert_eq!(decode_reply(&received), Ok((node(1), Reply::MotionMode { feedback })));
    assert_eq!(reply(node(1), &Reply::MotionMode { feedback }), Ok(received));

    let refused = broadcast::<CanFrame>(&Request::MotionMode { command });
    assert!(matches!(refused, Err(EncodeError::Forbidden { field: "command", .. })));
}

/// RMD V3.6 §2.31.1: code 2 and above set nothing on CAN; §7: the RS485 id is not read over CAN.
#[test]
fn what_is_for_rs485_is_refused() {
    let set = |code| request::<CanFrame>(node(1), &Request::SetBaudRate { code: BaudCode(code) });
    assert_eq!(set(1), Ok(standard(0x141, &[0xB4, 0, 0, 0, 0, 0, 0, 0x01])));
    assert_eq!(
        set(2),
        Err(EncodeError::OutOfRange { field: "baud_code", value: 2, min: 0, max: 1 })
    );
    let refused = Err(EncodeError::Forbidden {
        field: "command",
        value: 0x79,
        reason: "this command is for RS485",
    });
    assert_eq!(request::<CanFrame>(node(1), &Request::ReadRs485Id), refused);
    assert_eq!(broadcast::<CanFrame>(&Request::SetRs485Id { id: 2 }), refused);
    assert_eq!(reply::<CanFrame>(node(1), &Reply::Rs485Id { id: node(1) }), refused);
}

/// Thruster nodes 1 to 127 have the ids 0x281..=0x2FF and 0x301..=0x37F on the same bus: none of
/// them is ours, and none of ours lies among them.
#[test]
fn thruster_ids_are_not_ours() {
    for id in (0x281..=0x2FF).chain(0x301..=0x37F) {
        let frame = standard(id, &[0x79, 0, 1, 0, 0, 0, 0x42, 0x02]);
        assert_eq!(decode_any_request(&frame), Err(DecodeError::WrongId { id }));
        assert_eq!(decode_reply(&frame), Err(DecodeError::WrongId { id }));
    }
}
