//! Thruster frames.

use codec_testing::numbers_of;
use host_protocol::CanFrame;
use thruster::{Answer, Headerless, Node, Payload, Reply, Request, answer, can};

use crate::frames::Input;

pub fn check(bytes: &[u8]) {
    let Some(input) = Input::of(bytes) else { return };
    match can::decode_request(&input.frame) {
        Ok((node, request)) => check_request(node, &request),
        Err(error) => _ = error.to_string(),
    }
    match can::decode_reply(&input.frame) {
        Ok((node, reply)) => {
            check_reply(node, &reply);
            let pending = if input.pending_is_short { &input.pending[..4] } else { &input.pending };
            if let Ok(pending) = Request::decode(pending) {
                check_answer(&pending, &reply);
            }
        }
        Err(error) => _ = error.to_string(),
    }
    if let Ok((node, values)) = can::decode_headerless(&input.frame) {
        let frame: CanFrame = can::headerless(node, &values).expect("always encodable");
        assert_eq!(can::decode_headerless(&frame), Ok((node, values)));
        assert_eq!(Headerless::decode(&input.data), Ok(values));
        values.visit_fields(&mut |_, _| ());
    }
}

fn check_request(node: Node, request: &Request) {
    let fields = numbers_of(|visit| request.visit_fields(visit));
    match can::request::<CanFrame>(node, request) {
        Ok(frame) => assert_eq!(can::decode_request(&frame), Ok((node, *request))),
        Err(error) => {
            _ = error.to_string();
            return;
        }
    }
    if !matches!(request, Request::Unknown { .. }) {
        let built = Request::build(request.name(), &|name| fields.get(name).copied());
        assert_eq!(built, Ok(*request));
    }
}

fn check_reply(node: Node, reply: &Reply) {
    match can::reply::<CanFrame>(node, reply) {
        Ok(frame) => assert_eq!(can::decode_reply(&frame), Ok((node, *reply))),
        Err(error) => _ = error.to_string(),
    }
    _ = reply.name();
    _ = numbers_of(|visit| reply.visit_fields(visit));
}

fn check_answer(request: &Request, reply: &Reply) {
    match answer(request, reply) {
        Answer::Reply(answer) => {
            assert_eq!(answer, *reply);
            assert!(!matches!(reply, Reply::Refused { .. }));
        }
        Answer::Refused => {
            let is_refusal =
                |payload: &Payload| payload.as_slice().get(4..) == Some(&[0, 0, 0xEE, 0xEE]);
            let refuses = match reply {
                Reply::Refused { .. } => true,
                Reply::Unknown { payload } => is_refusal(payload),
                _ => false,
            };
            assert!(refuses);
            assert_eq!(request.command(), reply.command());
        }
        Answer::Unsolicited | Answer::Unrelated => {}
    }
}
