//! CAN frames: the eight bytes, nothing added (D5 manual, point 4).
//!
//! The manual gives neither ids nor frame type, so both are the caller's, and any id is accepted
//! when decoding.

use embedded_can::{Frame, Id, StandardId};

use crate::error::{DecodeError, EncodeError};
use crate::field::FRAME_LEN;
use crate::frame::{decode_reply_frame, decode_request_frame, reply_frame, request_frame};
use crate::node::{Address, Node};
use crate::reply::Reply;
use crate::request::Request;

/// The lowest and the highest bitrate at which motors run, bit/s (D5 manual, point 3).
pub const BITRATES: (u32, u32) = (200_001, 222_222);

/// The id of requests to this motor where nothing else is configured: its own number. An
/// assumption.
pub fn default_request_id(node: Node) -> StandardId {
    // A node has eight bits, so the fallback, the id of lowest priority, is never used.
    StandardId::new(u16::from(node.get())).unwrap_or(StandardId::MAX)
}

/// The frame, with this id, that carries this request.
pub fn request<F: Frame>(
    id: impl Into<Id>,
    address: Address,
    request: &Request,
) -> Result<F, EncodeError> {
    F::new(id, &request_frame(address, request)?).ok_or(EncodeError::Frame)
}

/// The addressee and the request of a frame sent to a motor.
pub fn decode_request<F: Frame>(frame: &F) -> Result<(Address, Request), DecodeError> {
    decode_request_frame(&bytes_of(frame)?)
}

/// The frame, with this id, that carries this reply.
pub fn reply<F: Frame>(id: impl Into<Id>, node: Node, reply: &Reply) -> Result<F, EncodeError> {
    F::new(id, &reply_frame(node, reply)?).ok_or(EncodeError::Frame)
}

/// The sender and the reply of a frame sent by a motor.
pub fn decode_reply<F: Frame>(frame: &F) -> Result<(Node, Reply), DecodeError> {
    decode_reply_frame(&bytes_of(frame)?)
}

fn bytes_of<F: Frame>(frame: &F) -> Result<[u8; FRAME_LEN], DecodeError> {
    if frame.is_remote_frame() {
        return Err(DecodeError::RemoteFrame);
    }
    let data = frame.data();
    data.try_into().map_err(|_| DecodeError::Length { got: data.len(), expected: FRAME_LEN })
}
