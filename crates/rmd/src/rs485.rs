//! RS485 frames: `3E id 08 D0..D7 crc16`, 13 bytes (RMD V3.6 §1.2.2).
//!
//! A frame does not say whether it is a request or a reply: both carry the motor's id (RMD V3.6 §7.4), so the caller
//! says which one it reads. The caller also discards what it hears of its own sending, which would otherwise pass for
//! the echo that confirms a stop.

mod deframer;

use crc::{CRC_16_MODBUS, Crc, Table};

pub use self::deframer::Deframer;
use crate::error::{DecodeError, EncodeError};
use crate::field::DATA_LEN;
use crate::node::Node;
use crate::reply::Reply;
use crate::request::Request;

/// Header, id, length, data and checksum.
pub const FRAME_LEN: usize = HEADER_LEN + DATA_LEN + CHECKSUM_LEN;
/// Header byte, id and length byte.
const HEADER_LEN: usize = 3;
/// CRC, low byte first.
const CHECKSUM_LEN: usize = 2;
/// First byte of every frame.
const HEADER: u8 = 0x3E;
/// The length byte: always eight data bytes.
const LENGTH: u8 = 0x08;
const _: () = assert!(LENGTH as usize == DATA_LEN);

/// The manual says "CRC16" only. Two proven frames (see the tests) settle it as CRC-16/MODBUS over all bytes before it.
static CHECKSUM: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);

/// The frame that carries a request to a motor.
pub fn request(node: Node, request: &Request) -> Result<[u8; FRAME_LEN], EncodeError> {
    Ok(frame(node, request.encode()?))
}

/// The frame that carries a reply from a motor.
pub fn reply(node: Node, reply: &Reply) -> Result<[u8; FRAME_LEN], EncodeError> {
    Ok(frame(node, reply.encode()?))
}

/// The motor addressed by a frame and the request in it.
pub fn decode_request(frame: &[u8; FRAME_LEN]) -> Result<(Node, Request), DecodeError> {
    let (node, data) = open(frame)?;
    Ok((node, Request::decode(data)))
}

/// The motor that sent a frame and the reply in it.
pub fn decode_reply(frame: &[u8; FRAME_LEN]) -> Result<(Node, Reply), DecodeError> {
    let (node, data) = open(frame)?;
    Ok((node, Reply::decode_full(data)))
}

fn frame(node: Node, data: [u8; DATA_LEN]) -> [u8; FRAME_LEN] {
    let [d0, d1, d2, d3, d4, d5, d6, d7] = data;
    let body = [HEADER, node.get(), LENGTH, d0, d1, d2, d3, d4, d5, d6, d7];
    let [low, high] = CHECKSUM.checksum(&body).to_le_bytes();
    [HEADER, node.get(), LENGTH, d0, d1, d2, d3, d4, d5, d6, d7, low, high]
}

fn open(frame: &[u8; FRAME_LEN]) -> Result<(Node, &[u8; DATA_LEN]), DecodeError> {
    let [header, node, length, data @ .., _, _] = frame;
    if *header != HEADER {
        return Err(DecodeError::Header { got: *header, expected: HEADER });
    }
    if *length != LENGTH {
        return Err(DecodeError::Length { got: usize::from(*length), expected: DATA_LEN });
    }
    check(frame)?;
    Ok((Node::received(*node)?, data))
}

fn check(frame: &[u8; FRAME_LEN]) -> Result<(), DecodeError> {
    let [body @ .., low, high] = frame;
    let got = u16::from_le_bytes([*low, *high]);
    let expected = CHECKSUM.checksum(body);
    if got == expected { Ok(()) } else { Err(DecodeError::Checksum { got, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reply::Motion;
    use crate::units::{Celsius, Centiamps, Degrees, DegreesPerSecond};

    const REQUEST: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    const REPLY: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];

    fn node(node: u8) -> Node {
        Node::new(node).expect("1..=32")
    }

    /// Proven frame; layout RMD V3.6 §2.13.4.
    #[test]
    fn request_frame() {
        assert_eq!(request(node(1), &Request::ReadStatus2), Ok(REQUEST));
        assert_eq!(decode_request(&REQUEST), Ok((node(1), Request::ReadStatus2)));
    }

    /// Proven frame; layout RMD V3.6 §2.13.4.
    #[test]
    fn reply_frame() {
        let status = Reply::Status2 {
            motion: Motion {
                temperature: Celsius(25),
                current: Centiamps(0x1234),
                speed: DegreesPerSecond(-100),
                angle: Degrees(0x5678),
            },
        };
        assert_eq!(reply(node(1), &status), Ok(REPLY));
        assert_eq!(decode_reply(&REPLY), Ok((node(1), status)));
    }

    #[test]
    fn wrong_header_length_and_checksum() {
        let mut frame = REQUEST;
        frame[0] = 0x3D;
        assert_eq!(decode_request(&frame), Err(DecodeError::Header { got: 0x3D, expected: 0x3E }));
        let mut frame = REQUEST;
        frame[2] = 0x07;
        assert_eq!(decode_request(&frame), Err(DecodeError::Length { got: 7, expected: 8 }));
        let mut frame = REQUEST;
        frame[11] = 0xF3;
        assert_eq!(decode_reply(&frame), Err(DecodeError::Checksum { got: 0x30F3, expected: 0x30F2 }));
    }

    /// High byte first is not the protocol's order (RMD V3.6 §1.2.2).
    #[test]
    fn the_checksum_has_its_low_byte_first() {
        let frame = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0x30, 0xF2];
        assert_eq!(decode_request(&frame), Err(DecodeError::Checksum { got: 0xF230, expected: 0x30F2 }));
    }

    /// Broadcast and out-of-range ids with a valid checksum (computed apart from this crate) name no single motor.
    #[test]
    fn ids_outside_1_to_32() {
        let broadcast = [0x3E, 0xCD, 0x08, 0x80, 0, 0, 0, 0, 0, 0, 0, 0x36, 0x6A];
        assert_eq!(decode_reply(&broadcast), Err(DecodeError::Node { node: 0xCD }));
        let zero = [0x3E, 0x00, 0x08, 0x80, 0, 0, 0, 0, 0, 0, 0, 0xA2, 0xAC];
        assert_eq!(decode_request(&zero), Err(DecodeError::Node { node: 0 }));
        let above = [0x3E, 0x21, 0x08, 0x80, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x03];
        assert_eq!(decode_request(&above), Err(DecodeError::Node { node: 33 }));
    }
}
