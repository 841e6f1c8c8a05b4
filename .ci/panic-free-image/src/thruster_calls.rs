//! Everything public of `thruster`.

use host_protocol::CanFrame;
use thruster::{Faults, Headerless, Kilobits, Node, Payload, Reply, Request, answer, can};

use crate::{any, used};

pub fn all(input: &[u8]) {
    let Ok(node) = Node::new(any(1)) else { return };
    let node = any(node);
    used((can::request_id(node), can::reply_id(node)));
    decoded_requests(input, node);
    decoded_replies(input, node);
    can_frames(input, node);
    small_types(input);
}

fn decoded_requests(input: &[u8], node: Node) {
    let fields = |name: &str| any((!name.is_empty()).then_some(1.0));
    used(Request::build(any("signal"), &fields));
    let Ok(request) = any(Request::decode(input)) else { return };
    used(request.encode());
    used((request.command(), request.name(), request.info()));
    used(can::request::<CanFrame>(node, &request));
    request.visit_fields(&mut |name, value| used((name, value)));
}

fn decoded_replies(input: &[u8], node: Node) {
    let Ok(reply) = any(Reply::decode(input)) else { return };
    let request = any(Request::EmergencyStop);
    used(reply.encode());
    used((reply.command(), reply.is_event(), reply.name(), reply.info()));
    used(answer(&request, &reply));
    used(can::reply::<CanFrame>(node, &reply));
    reply.visit_fields(&mut |name, value| used((name, value)));
    if let Reply::Returned(returned) = reply {
        used((returned.header(), returned.frame.number(), returned.frame.absolute_position()));
    }
}

fn can_frames(input: &[u8], node: Node) {
    if let Ok(values) = any(Headerless::decode(input)) {
        used(values.encode());
        used(can::headerless::<CanFrame>(node, &values));
        values.visit_fields(&mut |name, value| used((name, value)));
    }
    let Some(frame) = CanFrame::standard(any(0), input) else { return };
    let frame = any(frame);
    used(can::decode_request(&frame));
    used(can::decode_reply(&frame));
    used(can::decode_headerless(&frame));
    used((can::node_of_request_id(frame.id()), can::node_of_reply_id(frame.id())));
}

fn small_types(input: &[u8]) {
    any(Faults::from_bits_retain(0)).infos().for_each(used);
    used(any(Kilobits(0)).info());
    if let Ok(payload) = any(Payload::try_from(input)) {
        used((payload.command(), payload.as_slice().len()));
    }
}
