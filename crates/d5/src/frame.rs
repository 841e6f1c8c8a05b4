//! The eight-byte frame: header, id, the five bytes of a [`Payload`], checksum.

use crate::error::{DecodeError, EncodeError};
use crate::field::{FRAME_LEN, REPLY_HEADER, REQUEST_HEADER};
use crate::node::{Address, Node};
use crate::payload::Payload;
use crate::reply::Reply;
use crate::request::Request;

/// What a frame of either direction carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// To a motor, or to all.
    Request(Address, Request),
    /// From a motor.
    Reply(Node, Reply),
}

/// The message of a frame; its header says which way it goes.
pub fn decode_frame(frame: &[u8; FRAME_LEN]) -> Result<Message, DecodeError> {
    let [header, ..] = *frame;
    if header == REPLY_HEADER {
        return decode_reply_frame(frame).map(|(node, reply)| Message::Reply(node, reply));
    }
    decode_request_frame(frame).map(|(address, request)| Message::Request(address, request))
}

/// Whether a frame, whatever its header, has the right checksum.
pub(crate) fn has_right_checksum(frame: &[u8; FRAME_LEN]) -> bool {
    let [header, ..] = *frame;
    disassemble(header, frame).is_ok()
}

/// The frame of a request. A broadcast is refused unless it is a query, an execute or a reset.
pub fn request_frame(address: Address, request: &Request) -> Result<[u8; FRAME_LEN], EncodeError> {
    let payload = request.encode()?;
    if address == Address::Broadcast && !may_be_broadcast(request) {
        let reason = "only a query, an execute or a reset can be broadcast";
        return Err(EncodeError::Forbidden {
            field: "node",
            value: i64::from(address.id()),
            reason,
        });
    }
    Ok(assemble(REQUEST_HEADER, address.id(), payload))
}

/// The addressee and the request of a frame. A broadcast of any command is decoded: motors may obey
/// it (D5 manual, table row 1, calls 0xFE the broadcast id in general).
pub fn decode_request_frame(frame: &[u8; FRAME_LEN]) -> Result<(Address, Request), DecodeError> {
    let (id, payload) = disassemble(REQUEST_HEADER, frame)?;
    let request = Request::decode(&payload)?;
    Ok((Address::new(id).map_err(|_| DecodeError::Node { node: id })?, request))
}

/// The frame of a reply.
pub fn reply_frame(node: Node, reply: &Reply) -> Result<[u8; FRAME_LEN], EncodeError> {
    Ok(assemble(REPLY_HEADER, node.get(), reply.encode()?))
}

/// The sender and the reply of a frame.
pub fn decode_reply_frame(frame: &[u8; FRAME_LEN]) -> Result<(Node, Reply), DecodeError> {
    let (id, payload) = disassemble(REPLY_HEADER, frame)?;
    Ok((Node::received(id)?, Reply::decode(&payload)?))
}

fn may_be_broadcast(request: &Request) -> bool {
    matches!(request, Request::QueryId | Request::Execute | Request::Reset)
}

fn assemble(header: u8, id: u8, payload: Payload) -> [u8; FRAME_LEN] {
    let Payload([length, command, address, low, high]) = payload;
    [header, id, length, command, address, low, high, checksum(id, payload)]
}

fn disassemble(header: u8, frame: &[u8; FRAME_LEN]) -> Result<(u8, Payload), DecodeError> {
    let [got, id, length, command, address, low, high, sum] = *frame;
    if got != header {
        return Err(DecodeError::Header { got, expected: header });
    }
    let payload = Payload([length, command, address, low, high]);
    let expected = checksum(id, payload);
    if sum != expected {
        return Err(DecodeError::Checksum { got: sum, expected });
    }
    Ok((id, payload))
}

/// Low byte of the sum of everything but the header (D5 manual, frame format).
fn checksum(id: u8, Payload(bytes): Payload) -> u8 {
    bytes.into_iter().fold(id, u8::wrapping_add)
}
