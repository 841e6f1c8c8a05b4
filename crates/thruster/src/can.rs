//! CAN frames: standard ids, `0x300 + node` to a device and `0x280 + node` from it (Thruster manual
//! §1.1).

use embedded_can::{Frame, Id, StandardId};

use crate::error::{DecodeError, EncodeError};
use crate::field::{REPLY_ID_BASE, REQUEST_ID_BASE};
use crate::node::Node;
use crate::reply::Reply;
use crate::request::Request;
use crate::returned::Headerless;

/// The id of requests to this node, 0x301..=0x37F.
pub fn request_id(node: Node) -> StandardId {
    id_of(REQUEST_ID_BASE, node)
}

/// The id of replies of this node, 0x281..=0x2FF.
pub fn reply_id(node: Node) -> StandardId {
    id_of(REPLY_ID_BASE, node)
}

/// The node to which a frame with this id is sent, if it is a request id.
pub fn node_of_request_id(id: Id) -> Option<Node> {
    node_of(REQUEST_ID_BASE, id)
}

/// The node from which a frame with this id comes, if it is a reply id.
pub fn node_of_reply_id(id: Id) -> Option<Node> {
    node_of(REPLY_ID_BASE, id)
}

/// The frame that carries this request to this node.
pub fn request<F: Frame>(node: Node, request: &Request) -> Result<F, EncodeError> {
    F::new(request_id(node), request.encode()?.as_slice()).ok_or(EncodeError::Frame)
}

/// The node and the request of a frame sent to a device.
pub fn decode_request<F: Frame>(frame: &F) -> Result<(Node, Request), DecodeError> {
    let node = node_of_frame(REQUEST_ID_BASE, frame)?;
    Ok((node, Request::decode(frame.data())?))
}

/// The frame that carries this reply of this node.
pub fn reply<F: Frame>(node: Node, reply: &Reply) -> Result<F, EncodeError> {
    F::new(reply_id(node), reply.encode()?.as_slice()).ok_or(EncodeError::Frame)
}

/// The node and the reply of a frame sent by a device.
pub fn decode_reply<F: Frame>(frame: &F) -> Result<(Node, Reply), DecodeError> {
    let node = node_of_frame(REPLY_ID_BASE, frame)?;
    Ok((node, Reply::decode(frame.data())?))
}

/// The frame that carries these values of this node without a header.
pub fn headerless<F: Frame>(node: Node, values: &Headerless) -> Result<F, EncodeError> {
    F::new(reply_id(node), values.encode().as_slice()).ok_or(EncodeError::Frame)
}

/// The node and the values of a frame without a header; see [`Headerless`] for when this may be
/// asked.
pub fn decode_headerless<F: Frame>(frame: &F) -> Result<(Node, Headerless), DecodeError> {
    let node = node_of_frame(REPLY_ID_BASE, frame)?;
    Ok((node, Headerless::decode(frame.data())?))
}

fn id_of(base: u16, node: Node) -> StandardId {
    // base + node is at most 0x37F, so the fallback, the id of lowest priority, is never used.
    StandardId::new(base + u16::from(node.get())).unwrap_or(StandardId::MAX)
}

fn node_of(base: u16, id: Id) -> Option<Node> {
    let Id::Standard(id) = id else { return None };
    let offset = id.as_raw().checked_sub(base)?;
    Node::new(u8::try_from(offset).ok()?).ok()
}

fn node_of_frame<F: Frame>(base: u16, frame: &F) -> Result<Node, DecodeError> {
    let id = match frame.id() {
        Id::Standard(id) => id,
        Id::Extended(id) => return Err(DecodeError::ExtendedId { id: id.as_raw() }),
    };
    if frame.is_remote_frame() {
        return Err(DecodeError::RemoteFrame);
    }
    node_of(base, Id::Standard(id)).ok_or(DecodeError::WrongId { id: id.as_raw() })
}
