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

#[cfg(test)]
mod tests {
    use embedded_can::ExtendedId;

    use super::*;
    use crate::faults::Faults;
    use crate::units::{Deciamps, Decivolts, Percent, Rpm};
    use codec::testing::CanFrame;

    fn node(id: u8) -> Node {
        Node::new(id).unwrap()
    }

    fn frame(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::new(StandardId::new(id).unwrap(), data).unwrap()
    }

    /// Thruster manual §1.3: the printed frames of TC −5 % with node 0x0B.
    #[test]
    fn printed_frames_of_node_11() {
        let data = [0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFB];
        let to_device = Request::Signal { signal: Percent(-5) };
        let from_device = Reply::Signal { signal: Percent(-5) };
        assert_eq!(request(node(0x0B), &to_device), Ok(frame(0x30B, &data)));
        assert_eq!(decode_request(&frame(0x30B, &data)), Ok((node(0x0B), to_device)));
        assert_eq!(reply(node(0x0B), &from_device), Ok(frame(0x28B, &data)));
        assert_eq!(decode_reply(&frame(0x28B, &data)), Ok((node(0x0B), from_device)));
    }

    /// Thruster manual §1.2: a query has four bytes on the wire.
    #[test]
    fn a_query_has_four_bytes() {
        let expected = frame(0x37F, &[0x51, 0x56, 0x00, 0x00]);
        assert_eq!(request(node(127), &Request::ReadSpeed), Ok(expected));
    }

    /// Thruster manual §2.4: speed, voltage, current and status under the id of a reply.
    #[test]
    fn a_frame_without_a_header() {
        let data = [0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A, 0x00, 0x10];
        let values = Headerless {
            speed: Rpm(1000),
            voltage: Decivolts(240),
            current: Deciamps(10),
            faults: Faults::UNDER_VOLTAGE,
        };
        assert_eq!(headerless(node(0x0B), &values), Ok(frame(0x28B, &data)));
        assert_eq!(decode_headerless(&frame(0x28B, &data)), Ok((node(0x0B), values)));
        let to_device = frame(0x30B, &data);
        assert_eq!(decode_headerless(&to_device), Err(DecodeError::WrongId { id: 0x30B }));
    }

    /// Thruster manual §1.1: the ids of the two directions and their ends.
    #[test]
    fn ids_run_from_node_1_to_127() {
        for (id, to, from) in [
            (0x280, None, None),
            (0x281, None, Some(1)),
            (0x2FF, None, Some(127)),
            (0x300, None, None),
            (0x301, Some(1), None),
            (0x37F, Some(127), None),
            (0x380, None, None),
            (0x141, None, None),
            (0x7FF, None, None),
        ] {
            let id = Id::Standard(StandardId::new(id).unwrap());
            assert_eq!(node_of_request_id(id), to.map(node));
            assert_eq!(node_of_reply_id(id), from.map(node));
        }
    }

    /// Thruster manual §1.1: standard data frames only.
    #[test]
    fn other_frames_are_named() {
        let data = [0x51, 0x56, 0x00, 0x00];
        let extended = CanFrame::new(ExtendedId::new(0x30B).unwrap(), &data).unwrap();
        assert_eq!(decode_request(&extended), Err(DecodeError::ExtendedId { id: 0x30B }));
        let remote = CanFrame::new_remote(StandardId::new(0x30B).unwrap(), 4).unwrap();
        assert_eq!(decode_request(&remote), Err(DecodeError::RemoteFrame));
        assert_eq!(decode_request(&frame(0x28B, &data)), Err(DecodeError::WrongId { id: 0x28B }));
        assert_eq!(decode_reply(&frame(0x30B, &data)), Err(DecodeError::WrongId { id: 0x30B }));
    }
}
