//! CAN frames: standard ids, data frames, DLC 8 (RMD V3.6 §1.1.2).

use embedded_can::{Frame, Id, StandardId};

use crate::error::{DecodeError, EncodeError};
use crate::field::DATA_LEN;
use crate::node::Node;
use crate::reply::Reply;
use crate::request::Request;

/// Request id of a motor = this + node: 0x141..=0x160 (RMD V3.6 §1.1.2).
pub const REQUEST_BASE: u16 = 0x140;
/// Reply id of a motor = this + node: 0x241..=0x260 (RMD V3.6 §1.1.2).
pub const REPLY_BASE: u16 = 0x240;

/// Id on which the motor listens.
pub fn request_id(node: Node) -> StandardId {
    id::<REQUEST_BASE>(node)
}

/// Id on which the motor answers.
pub fn reply_id(node: Node) -> StandardId {
    id::<REPLY_BASE>(node)
}

/// The motor that sends with this id, if any does.
pub fn node_of_reply_id(id: Id) -> Option<Node> {
    match id {
        Id::Standard(id) => node_above(REPLY_BASE, id),
        Id::Extended(_) => None,
    }
}

/// The frame that carries a request to a motor.
pub fn request<F: Frame>(node: Node, request: &Request) -> Result<F, EncodeError> {
    F::new(request_id(node), &request.encode()?).ok_or(EncodeError::Frame)
}

/// The motor addressed by a frame and the request in it.
pub fn decode_request<F: Frame>(frame: &F) -> Result<(Node, Request), DecodeError> {
    let node = sender_or_target(frame, REQUEST_BASE)?;
    let data = frame.data();
    let data = <&[u8; DATA_LEN]>::try_from(data)
        .map_err(|_| DecodeError::Length { got: data.len(), expected: DATA_LEN })?;
    Ok((node, Request::decode(data)))
}

/// The frame that carries a reply from a motor. A timeout notice has as many bytes as it was received with.
pub fn reply<F: Frame>(node: Node, reply: &Reply) -> Result<F, EncodeError> {
    let data = reply.encode()?;
    let data = data.get(..reply.frame_len()).unwrap_or(&data);
    F::new(reply_id(node), data).ok_or(EncodeError::Frame)
}

/// The motor that sent a frame and the reply in it.
pub fn decode_reply<F: Frame>(frame: &F) -> Result<(Node, Reply), DecodeError> {
    let node = sender_or_target(frame, REPLY_BASE)?;
    Ok((node, Reply::decode(frame.data())?))
}

fn id<const BASE: u16>(node: Node) -> StandardId {
    const { assert!(StandardId::new(BASE + Node::MAX as u16).is_some()) };
    // The assertion above leaves the fallback without a case.
    StandardId::new(BASE + u16::from(node.get())).unwrap_or(StandardId::MAX)
}

fn node_above(base: u16, id: StandardId) -> Option<Node> {
    let node = u8::try_from(id.as_raw().checked_sub(base)?).ok()?;
    Node::new(node).ok()
}

fn sender_or_target<F: Frame>(frame: &F, base: u16) -> Result<Node, DecodeError> {
    let id = match frame.id() {
        Id::Standard(id) => id,
        Id::Extended(id) => return Err(DecodeError::ExtendedId { id: id.as_raw() }),
    };
    if frame.is_remote_frame() {
        return Err(DecodeError::RemoteFrame);
    }
    node_above(base, id).ok_or(DecodeError::WrongId { id: id.as_raw() })
}

#[cfg(test)]
mod tests {
    use embedded_can::ExtendedId;

    use super::*;
    use crate::notice::RawNotice;
    use crate::test_frame::CanFrame;
    use crate::units::Centiamps;

    fn node(node: u8) -> Node {
        Node::new(node).expect("1..=32")
    }

    fn standard(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::new(StandardId::new(id).expect("11 bits"), data).expect("at most 8 bytes")
    }

    /// RMD V3.6 §1.1.2. Ids from 0x280 up belong to broadcast, configuration and other protocols.
    #[test]
    fn ids_of_the_first_and_last_motor() {
        assert_eq!(request_id(node(1)).as_raw(), 0x141);
        assert_eq!(request_id(node(32)).as_raw(), 0x160);
        assert_eq!(reply_id(node(1)).as_raw(), 0x241);
        assert_eq!(reply_id(node(32)).as_raw(), 0x260);
    }

    #[test]
    fn only_reply_ids_name_a_node() {
        let of = |id| node_of_reply_id(Id::Standard(StandardId::new(id).expect("11 bits")));
        assert_eq!(of(0x241), Some(node(1)));
        assert_eq!(of(0x260), Some(node(32)));
        for id in [0x000, 0x141, 0x240, 0x261, 0x280, 0x281, 0x300, 0x341, 0x7FF] {
            assert_eq!(of(id), None, "{id:#05x}");
        }
        assert_eq!(node_of_reply_id(Id::Extended(ExtendedId::new(0x241).expect("29 bits"))), None);
    }

    /// RMD V3.6 §2.17.4: 1 A to node 1, and the reply.
    #[test]
    fn torque_current_to_node_1() {
        let sent = standard(0x141, &[0xA1, 0x00, 0x00, 0x00, 0x64, 0x00, 0x00, 0x00]);
        let torque = Request::TorqueCurrent { current: Centiamps(100) };
        assert_eq!(request(node(1), &torque), Ok(sent));
        assert_eq!(decode_request(&sent), Ok((node(1), torque)));

        let received = standard(0x241, &[0xA1, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00]);
        let (from, decoded) = decode_reply(&received).expect("a reply");
        assert_eq!(from, node(1));
        assert_eq!(reply(from, &decoded), Ok(received));
    }

    #[test]
    fn a_short_notice_stays_short() {
        for payload in [&[][..], &[0x00], &[1, 2, 3, 4, 5, 6, 7]] {
            let notice = Reply::TimeoutNotice { raw: RawNotice::new(payload).expect("at most 7 bytes") };
            let frame: CanFrame = reply(node(2), &notice).expect("a frame");
            assert_eq!(frame.dlc(), 1 + payload.len());
            assert_eq!(decode_reply(&frame), Ok((node(2), notice)));
        }
        assert_eq!(
            reply(node(2), &Reply::TimeoutNotice { raw: RawNotice::default() }),
            Ok(standard(0x242, &[0xF1]))
        );
    }

    #[test]
    fn frames_of_others_are_refused() {
        let stop = [0x81, 0, 0, 0, 0, 0, 0, 0];
        for id in [0x140, 0x161, 0x241, 0x280, 0x300] {
            assert_eq!(decode_request(&standard(id, &stop)), Err(DecodeError::WrongId { id }));
        }
        for id in [0x141, 0x240, 0x261, 0x281, 0x300] {
            assert_eq!(decode_reply(&standard(id, &stop)), Err(DecodeError::WrongId { id }));
        }
        let extended = CanFrame::new(ExtendedId::new(0x241).expect("29 bits"), &stop).expect("a frame");
        assert_eq!(decode_reply(&extended), Err(DecodeError::ExtendedId { id: 0x241 }));
        let remote = CanFrame::new_remote(StandardId::new(0x241).expect("11 bits"), 8).expect("a frame");
        assert_eq!(decode_reply(&remote), Err(DecodeError::RemoteFrame));
    }

    #[test]
    fn short_frames_are_refused() {
        assert_eq!(
            decode_request(&standard(0x141, &[0x81])),
            Err(DecodeError::Length { got: 1, expected: 8 })
        );
        assert_eq!(decode_request(&standard(0x141, &[])), Err(DecodeError::Length { got: 0, expected: 8 }));
        assert_eq!(decode_reply(&standard(0x241, &[0x81])), Err(DecodeError::Length { got: 1, expected: 8 }));
    }
}
