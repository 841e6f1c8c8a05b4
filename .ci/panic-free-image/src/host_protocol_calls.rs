//! Everything of `host_protocol` through which bytes of a link pass.

use host_protocol::{
    CanFrame, Deframer, Error, Event, EventMessage, Frame, MAX_FRAME, Reply, Request,
};

use crate::{any, array, used};

pub fn all(input: &[u8]) {
    let mut deframer = any(Deframer::new());
    for byte in input {
        if let Some(Ok(frame)) = deframer.push(*byte) {
            used(frame.kind);
        }
    }
    if let Ok(frame) = any(Frame::from_message(input)) {
        used((frame.sequence, frame.number, frame.checksum));
    }
    let number = any(0);
    requests(number, input);
    answers(number, input);
    can_frames(input);
}

fn requests(number: u16, body: &[u8]) {
    let mut out = array::<MAX_FRAME>();
    if let Ok(request) = any(Request::decode(number, body)) {
        used((request.number(), request.name()));
        used(request.encode_frame(any(0), &mut out));
        used(out);
    }
}

fn answers(number: u16, body: &[u8]) {
    let mut out = array::<MAX_FRAME>();
    if let Ok(reply) = any(Reply::decode(number, body)) {
        used((reply.number(), reply.name()));
        used(reply.encode_frame(any(0), &mut out));
    }
    if let Ok(error) = any(Error::decode(number, body)) {
        used((error.number(), error.name()));
        used(error.encode_frame(any(0), &mut out));
    }
    if let Ok(message) = any(EventMessage::decode(number, body)) {
        let event: Event = message.event;
        used((event.number(), event.name()));
        used(event.encode_frame(any(0), message.dropped, message.time_us, &mut out));
    }
    used(out);
}

fn can_frames(data: &[u8]) {
    if let Some(frame) = any(CanFrame::standard(any(0), data)) {
        used((frame.id(), frame.data().len()));
    }
    used(CanFrame::extended(any(0), data));
    if let Some(frame) = any(CanFrame::standard(any(0), data)) {
        used(CanFrame::data_frame(frame.id(), data));
        used(CanFrame::remote_frame(frame.id(), any(0)));
    }
}
