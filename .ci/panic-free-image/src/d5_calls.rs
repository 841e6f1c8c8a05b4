//! Everything public of `d5`.

use d5::serial::Deframer;
use d5::{
    AckLevel, Address, Celsius, Degrees, DegreesPerSecond, Faults, Node, Payload, Register, Reply,
    Request, Value, answer, can,
};
use host_protocol::CanFrame;

use crate::{any, array, used};

pub fn all(input: &[u8]) {
    let Ok(node) = Node::new(any(1)) else { return };
    let node = any(node);
    decoded_requests(node);
    decoded_replies(node);
    frames(input);
    serial(input);
    small_types();
}

fn decoded_requests(node: Node) {
    let fields = |name: &str| any((!name.is_empty()).then_some(1.0));
    used(Request::build(any("query_id"), &fields));
    let Ok(request) = any(Request::decode(&Payload(array()))) else { return };
    let Ok(address) = any(Address::new(any(0))) else { return };
    used(request.encode());
    used((request.command(), request.name(), request.info(), request.answering_node(node)));
    used(d5::request_frame(address, &request));
    used((can::default_request_id(node), address.id()));
    used(can::request::<CanFrame>(can::default_request_id(node), address, &request));
    used(AckLevel::of(any(0)).answers(address, &request));
    used(any(AckLevel::Reads).raw());
    request.visit_fields(&mut |name, value| used((name, value)));
}

fn decoded_replies(node: Node) {
    let Ok(reply) = any(Reply::decode(&Payload(array()))) else { return };
    let request = any(Request::Execute);
    used(reply.encode());
    used((reply.command(), reply.name(), reply.info()));
    used(answer(&request, node, any(node), &reply));
    used(d5::reply_frame(node, &reply));
    used(can::reply::<CanFrame>(can::default_request_id(node), node, &reply));
    reply.visit_fields(&mut |name, value| used((name, value)));
    if let Reply::Error { error, .. } = reply {
        used(error.name());
    }
}

fn frames(input: &[u8]) {
    used(d5::decode_frame(&array()));
    used(d5::decode_request_frame(&array()));
    used(d5::decode_reply_frame(&array()));
    let Some(frame) = CanFrame::standard(any(0), input) else { return };
    let frame = any(frame);
    used(frame.id());
    used(can::decode_request(&frame));
    used(can::decode_reply(&frame));
}

fn serial(input: &[u8]) {
    let mut deframer = any(Deframer::new());
    used(deframer.push(any(0)));
    deframer.push_slice(input).for_each(used);
    used((deframer.pending(), deframer.rejected()));
    deframer.reset();
    used(deframer);
}

fn small_types() {
    any(Faults::from_bits_retain(0)).infos().for_each(used);
    used((d5::encode_speed(any(DegreesPerSecond(0))), d5::decode_speed(any(0))));
    used((d5::encode_angle(any(Degrees(0))), d5::decode_angle(any(0))));
    used((d5::encode_temperature(any(Celsius(0))), d5::decode_temperature(any(0))));
    if let Some(info) = any(any(Register(0)).info()) {
        used((info.decode(any(Value::Byte(0))), info.encode(any(0)), info.value_range()));
    }
}
