//! D5 frames: as received, and with header and checksum set right, so that the rest is looked at.

use codec_testing::numbers_of;
use d5::{
    Address, Answer, FRAME_LEN, Message, Node, Payload, Register, Reply, Request, Value, answer,
    can, decode_frame, reply_frame, request_frame,
};
use host_protocol::CanFrame;

use crate::frames::Input;

pub fn check(bytes: &[u8]) {
    let Some(Input { frame, data, pending, .. }) = Input::of(bytes) else { return };
    if let Err(error) = can::decode_request(&frame) {
        _ = error.to_string();
    }
    if let Err(error) = can::decode_reply(&frame) {
        _ = error.to_string();
    }
    let [_, length, command, address, low, high, ..] = pending;
    let pending = Request::decode(&Payload([length, command, address, low, high]));
    for header in [data[0], d5::REQUEST_HEADER, d5::REPLY_HEADER] {
        match decode_frame(&set_right(header, data)) {
            Ok(Message::Request(address, request)) => check_request(address, &request),
            Ok(Message::Reply(from, reply)) => {
                check_reply(from, &reply);
                if let Ok(pending) = pending {
                    check_answer(&pending, from, &reply);
                }
            }
            Err(error) => _ = error.to_string(),
        }
    }
}

fn check_request(address: Address, request: &Request) {
    let fields = numbers_of(|visit| request.visit_fields(visit));
    match request_frame(address, request) {
        Ok(frame) => assert_eq!(decode_frame(&frame), Ok(Message::Request(address, *request))),
        Err(error) => {
            _ = error.to_string();
            return;
        }
    }
    let frame: CanFrame = can::request(can::default_request_id(Node::FACTORY), address, request)
        .expect("what makes a frame makes a CAN frame");
    assert_eq!(can::decode_request(&frame), Ok((address, *request)));
    if !matches!(request, Request::Unknown { .. }) {
        let built = Request::build(request.name(), &|name| fields.get(name).copied());
        assert_eq!(built.map(one_zero), Ok(one_zero(*request)));
    }
}

/// A speed of zero has a sign on the wire, and none where it is shown.
fn one_zero(request: Request) -> Request {
    const MINUS_ZERO: Value = Value::Word(0x8000);
    match request {
        Request::Write { register: Register::SPEED, value: MINUS_ZERO } => {
            Request::Write { register: Register::SPEED, value: Value::Word(0) }
        }
        Request::AsyncWrite { register: Register::SPEED, value: MINUS_ZERO } => {
            Request::AsyncWrite { register: Register::SPEED, value: Value::Word(0) }
        }
        other => other,
    }
}

fn check_reply(node: Node, reply: &Reply) {
    match reply_frame(node, reply) {
        Ok(frame) => assert_eq!(decode_frame(&frame), Ok(Message::Reply(node, *reply))),
        Err(error) => _ = error.to_string(),
    }
    _ = reply.name();
    _ = numbers_of(|visit| reply.visit_fields(visit));
}

fn check_answer(request: &Request, from: Node, reply: &Reply) {
    match answer(request, Node::FACTORY, from, reply) {
        Answer::Reply(answer) => {
            assert_eq!(answer, *reply);
            assert_eq!(from, request.answering_node(Node::FACTORY));
            // A late reply to an earlier speed must not confirm a stop.
            if let (Request::Write { register, value }, Reply::Written { value: written, .. }) =
                (request, reply)
                && *register != Register::CLEAR_PROTECTION
            {
                assert_eq!(value, written);
            }
        }
        Answer::Refused(error) => {
            assert!(matches!(reply, Reply::Error { error: reported, .. } if *reported == error));
            assert_eq!(from, Node::FACTORY);
        }
        Answer::Unsolicited | Answer::Unrelated => {}
    }
}

/// The frame with this header and the right checksum (D5 manual, frame format).
pub fn set_right(header: u8, mut frame: [u8; FRAME_LEN]) -> [u8; FRAME_LEN] {
    frame[0] = header;
    frame[7] = checksum(&frame);
    frame
}

pub fn checksum(frame: &[u8; FRAME_LEN]) -> u8 {
    frame[1..7].iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}
