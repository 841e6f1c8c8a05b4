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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::payload::{Value, Width};
    use crate::register::Register;

    fn node(id: u8) -> Node {
        Node::new(id).unwrap()
    }

    /// D5 manual, common commands, rows 2 and 3: 600 °/s counter-clockwise and clockwise.
    #[test]
    fn printed_speed_frames() {
        for (frame, reply, word) in [
            (
                [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D],
                [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D],
                0x0258,
            ),
            (
                [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x82, 0x0D],
                [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x82, 0x0D],
                0x8258,
            ),
        ] {
            let (register, value) = (Register::SPEED, Value::Word(word));
            let write = Request::Write { register, value };
            assert_eq!(request_frame(Address::Node(node(0x0B)), &write), Ok(frame));
            assert_eq!(decode_request_frame(&frame), Ok((Address::Node(node(0x0B)), write)));
            let written = Reply::Written { register, value };
            assert_eq!(reply_frame(node(0x0B), &written), Ok(reply));
            assert_eq!(decode_reply_frame(&reply), Ok((node(0x0B), written)));
        }
    }

    /// D5 manual, frame format: the printed reply counts the header into its sum, against its own
    /// rule.
    #[test]
    fn the_printed_sum_with_the_header_is_rejected() {
        let printed = [0x5D, 0x0A, 0x05, 0x02, 0x20, 0x60, 0x80, 0x6E];
        assert_eq!(
            decode_reply_frame(&printed),
            Err(DecodeError::Checksum { got: 0x6E, expected: 0x11 })
        );
        let right = [0x5D, 0x0A, 0x05, 0x02, 0x20, 0x60, 0x80, 0x11];
        let reply = Reply::Read { register: Register::SPEED, value: Value::Word(0x8060) };
        assert_eq!(decode_reply_frame(&right), Ok((node(0x0A), reply)));
    }

    /// D5 manual, table row 3: the printed request with a wrong checksum.
    #[test]
    fn a_wrong_checksum_is_named() {
        let printed = [0xD5, 0x0B, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7A];
        assert_eq!(
            decode_request_frame(&printed),
            Err(DecodeError::Checksum { got: 0x7A, expected: 0x7B })
        );
    }

    /// D5 manual, frame format: D5 goes to the motor, 5D comes from it.
    #[test]
    fn the_header_gives_the_direction() {
        let request = [0xD5, 0x0B, 0x05, 0x01, 0x00, 0x00, 0x00, 0x11];
        assert_eq!(
            decode_reply_frame(&request),
            Err(DecodeError::Header { got: 0xD5, expected: 0x5D })
        );
        let reply = [0x5D, 0x0B, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x75];
        assert_eq!(
            decode_request_frame(&reply),
            Err(DecodeError::Header { got: 0x5D, expected: 0xD5 })
        );
        let message = Message::Request(Address::Node(node(0x0B)), Request::QueryId);
        assert_eq!(decode_frame(&request), Ok(message));
        assert_eq!(decode_frame(&reply), Ok(Message::Reply(node(0x0B), Reply::Id)));
        let neither = [0x3E, 0x0B, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x75];
        assert_eq!(decode_frame(&neither), Err(DecodeError::Header { got: 0x3E, expected: 0xD5 }));
    }

    /// D5 manual, table row 1 and quick start (1), (4): query, execute and reset for all.
    #[test]
    fn printed_broadcasts() {
        for (frame, request) in [
            ([0xD5, 0xFE, 0x05, 0x01, 0x00, 0x00, 0x00, 0x04], Request::QueryId),
            ([0xD5, 0xFE, 0x05, 0x05, 0x00, 0x00, 0x00, 0x08], Request::Execute),
            ([0xD5, 0xFE, 0x05, 0x06, 0x00, 0x00, 0x00, 0x09], Request::Reset),
        ] {
            assert_eq!(request_frame(Address::Broadcast, &request), Ok(frame));
            assert_eq!(decode_request_frame(&frame), Ok((Address::Broadcast, request)));
        }
    }

    /// The manual prints no broadcast of any other command.
    #[test]
    fn other_requests_are_not_broadcast() {
        let raw = Payload([0x05, 0xAA, 0x00, 0x00, 0x00]);
        for request in [
            Request::ReadMagneticAngle,
            Request::SelfTest,
            Request::Read { register: Register::STATUS, width: Width::Byte },
            Request::Write { register: Register::SPEED, value: Value::Word(0) },
            Request::AsyncWrite { register: Register::SPEED, value: Value::Word(0) },
            Request::Unknown { raw },
        ] {
            let result = request_frame(Address::Broadcast, &request);
            assert!(matches!(
                result,
                Err(EncodeError::Forbidden { field: "node", value: 0xFE, .. })
            ));
        }
        let turn_all = [0xD5, 0xFE, 0x05, 0x03, 0x20, 0x58, 0x02, 0x80];
        let turn = Request::Write { register: Register::SPEED, value: Value::Word(0x0258) };
        assert_eq!(decode_request_frame(&turn_all), Ok((Address::Broadcast, turn)));
        let reply_of_all = [0x5D, 0xFE, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x68];
        assert_eq!(decode_reply_frame(&reply_of_all), Err(DecodeError::Node { node: 0xFE }));
        let node_0 = [0xD5, 0x00, 0x05, 0x01, 0x00, 0x00, 0x00, 0x06];
        assert_eq!(decode_request_frame(&node_0), Err(DecodeError::Node { node: 0x00 }));
    }
}
