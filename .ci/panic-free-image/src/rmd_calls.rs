//! Everything public of `rmd`.

use host_protocol::CanFrame;
use rmd::rs485::{self, Deframer, Scan};
use rmd::{
    BaudCode, Dialect, Faults, Function, Gain, GainValue, Model, MotionRanges, Node, Ramp,
    RawNotice, Reply, Request, RunMode, Target, answer, answer_on_line, can,
};

use crate::{any, array, used};

pub fn all(input: &[u8]) {
    let Ok(node) = Node::new(any(1)) else { return };
    let node = any(node);
    decoded_requests(node);
    decoded_replies(input, node);
    can_frames(input);
    serial(input);
    small_types(input);
}

fn decoded_requests(node: Node) {
    let request = any(Request::decode(&array()));
    used(request.encode());
    let dialect = any(Dialect::V4_4);
    used((request.check_in(dialect), request.encode_in(dialect)));
    used((request.dialects(), request.is_stored_only_off(dialect)));
    used((Request::decode_in(dialect, &array()), Request::dialects_of(&array())));
    used((Reply::decode_in(dialect, &array::<8>()), request.dialects().iter().count()));
    used((request.command(), request.is_answered(), request.name(), request.info()));
    used(request.answering_node(node));
    used(can::request::<CanFrame>(node, &request));
    used(can::broadcast::<CanFrame>(&request));
    used(rs485::request(node, &request));
    used(rs485::broadcast(&request));
    request.visit_fields(&mut |name, value| used((name, value)));
    request.visit_fields_in(&any(MotionRanges::DEFAULT), &mut |name, value| used((name, value)));
    let fields = |name: &str| any((!name.is_empty()).then_some(1.0));
    used(Request::build(any("stop"), &fields));
    used(Request::build_in(&any(MotionRanges::DEFAULT), any("stop"), &fields));
}

fn decoded_replies(input: &[u8], node: Node) {
    let Ok(reply) = any(Reply::decode(input)) else { return };
    let request = any(Request::Stop);
    used(reply.encode());
    used((reply.command(), reply.is_event(), reply.name(), reply.info()));
    used(answer(&request, &reply));
    used(answer_on_line(&request, &reply, any(true)));
    used(can::reply::<CanFrame>(node, &reply));
    used(rs485::reply(node, &reply));
    reply.visit_fields(&mut |name, value| used((name, value)));
    reply.visit_fields_in(&any(MotionRanges::DEFAULT), &mut |name, value| used((name, value)));
}

fn can_frames(input: &[u8]) {
    let Some(frame) = CanFrame::standard(any(0), input) else { return };
    let frame = any(frame);
    used(can::decode_request(&frame));
    used(can::decode_any_request(&frame));
    used(can::decode_reply(&frame));
    used(can::decode_reply_in(any(Dialect::V4_4), &frame));
    used(can::node_of_reply_id(frame.id()));
    if let Ok((Target::Node(node), _)) = can::decode_any_request(&frame) {
        used((can::request_id(node), can::reply_id(node)));
        used((can::motion_request_id(node), can::motion_reply_id(node)));
    }
}

fn serial(input: &[u8]) {
    used(rs485::decode_request(&array()));
    used(rs485::decode_any_request(&array()));
    used(rs485::decode_reply(&array()));
    let mut deframer = any(Deframer::new());
    used(deframer.push(any(0)));
    deframer.push_slice(input).for_each(used);
    used((deframer.pending(), deframer.rejected()));
    deframer.reset();
    used(deframer);
    let mut scan = any(Scan::new(input));
    scan.by_ref().for_each(used);
    used(scan.rest());
}

fn small_types(input: &[u8]) {
    let dialect = any(Dialect::V4_4);
    used((BaudCode::for_can(dialect, any(0)), BaudCode::for_rs485(dialect, any(0))));
    used((any(BaudCode(0)).can(dialect), any(BaudCode(0)).rs485(dialect)));
    used((Dialect::from_number(any(0)), dialect.name(), dialect.has_torque_cap()));
    used((Gain(any(1)).name(), GainValue::new(Gain(any(1)), any(1.0)).value()));
    let faults = any(Faults::from_bits_retain(0));
    faults.infos().for_each(used);
    used(faults.level());
    let function = any(Function::ClearMultiTurn);
    used((function.index(), function.value()));
    used((any(Ramp(0)).name(), any(RunMode::from_code(any(0))).name()));
    used(any(Model(array())).as_str().map(str::len));
    used(RawNotice::new(input).map(|notice| any(notice).payload().len()));
    let ranges = any(MotionRanges::DEFAULT);
    if let Request::MotionMode { command } = any(Request::Stop) {
        let target = any(ranges.target(&command));
        used(ranges.command(&target));
    }
    if let Ok(Reply::MotionMode { feedback }) = any(Reply::decode(input)) {
        used(ranges.state(&feedback));
    }
}
