//! RS485 frames: `3E id 08 D0..D7 crc16`, 13 bytes (RMD V3.6 §1.2.2).
//!
//! A frame does not say whether it is a request or a reply: both carry the motor's id (RMD V3.6
//! §7.4), so the caller says which one it reads. The caller also discards what it hears of its own
//! sending, which would otherwise pass for the echo that confirms a stop.

mod deframer;
mod scan;

use crc::{CRC_16_MODBUS, Crc, Table};

pub use self::deframer::{Deframer, Rs485Framing};
pub use self::scan::{Piece, Scan};
use crate::bus_id::{self, Access};
use crate::dialect::Dialect;
use crate::error::{DecodeError, EncodeError};
use crate::field::DATA_LEN;
use crate::node::{Node, Target};
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

/// The manual says "CRC16" only. Two proven frames (see the tests) settle it as CRC-16/MODBUS over
/// all bytes before it.
static CHECKSUM: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);

/// Id byte of frames to every motor, and of the commands that read and set the RS485 id (RMD V3.6
/// §6, §7).
pub const BROADCAST_ID: u8 = 0xCD;

/// The frame that carries a request to a motor. The commands that read and set the RS485 id go to
/// every motor on the line, whatever the node.
pub fn request(node: Node, request: &Request) -> Result<[u8; FRAME_LEN], EncodeError> {
    request_frame(node.get(), request)
}

/// The frame that carries a request to every motor. Their replies collide, so it counts as
/// unanswered (RMD V3.6 §6.2).
pub fn broadcast(request: &Request) -> Result<[u8; FRAME_LEN], EncodeError> {
    request_frame(BROADCAST_ID, request)
}

/// The frame that carries a reply from a motor.
pub fn reply(node: Node, reply: &Reply) -> Result<[u8; FRAME_LEN], EncodeError> {
    let id = match reply {
        Reply::Rs485Id { .. } | Reply::Rs485IdSet { .. } => BROADCAST_ID,
        Reply::CanId { .. } | Reply::CanIdSet { .. } | Reply::MotionMode { .. } => {
            return Err(can_only(reply.command()));
        }
        _ => node.get(),
    };
    Ok(frame(id, reply.encode()?))
}

/// The motor addressed by a frame and the request in it.
pub fn decode_request(frame: &[u8; FRAME_LEN]) -> Result<(Node, Request), DecodeError> {
    match decode_any_request(frame)? {
        (Target::Node(node), request) => Ok((node, request)),
        (Target::All, _) => Err(DecodeError::Node { node: BROADCAST_ID }),
    }
}

/// The motor or motors addressed by a frame and the request in it.
pub fn decode_any_request(frame: &[u8; FRAME_LEN]) -> Result<(Target, Request), DecodeError> {
    let (id, data) = open(frame)?;
    if id != BROADCAST_ID {
        return Ok((Target::Node(Node::received(id)?), Request::decode(data)));
    }
    let request = match bus_id::access(data) {
        Some(Access::Read) => Request::ReadRs485Id,
        Some(Access::Write) => Request::SetRs485Id { id: bus_id::written(data) },
        None => Request::decode(data),
    };
    Ok((Target::All, request))
}

/// The motor that sent a frame and the reply in it. A reply about the RS485 id names its motor in
/// the data: the new id once that is set.
pub fn decode_reply(frame: &[u8; FRAME_LEN]) -> Result<(Node, Reply), DecodeError> {
    decode_reply_in(Dialect::V3_6, frame)
}

/// [`decode_reply`] of a motor of this dialect.
pub fn decode_reply_in(
    dialect: Dialect,
    frame: &[u8; FRAME_LEN],
) -> Result<(Node, Reply), DecodeError> {
    let (id, data) = open(frame)?;
    if id != BROADCAST_ID {
        return Ok((Node::received(id)?, Reply::decode_full_in(dialect, data)));
    }
    match bus_id::access(data).ok_or(DecodeError::Node { node: id })? {
        Access::Read => bus_id::rs485_node(data).map(|id| (id, Reply::Rs485Id { id })),
        Access::Write => bus_id::written_node(data).map(|id| (id, Reply::Rs485IdSet { id })),
    }
}

/// The frame of a request under an id, unless the request has an id of its own or none on RS485.
fn request_frame(id: u8, request: &Request) -> Result<[u8; FRAME_LEN], EncodeError> {
    let id = match request {
        Request::ReadRs485Id | Request::SetRs485Id { .. } => BROADCAST_ID,
        Request::ReadCanId | Request::SetCanId { .. } | Request::MotionMode { .. } => {
            return Err(can_only(request.command()));
        }
        _ => id,
    };
    Ok(frame(id, request.encode()?))
}

fn can_only(command: u8) -> EncodeError {
    let reason = "this command is for CAN";
    EncodeError::Forbidden { field: "command", value: i64::from(command), reason }
}

fn frame(id: u8, data: [u8; DATA_LEN]) -> [u8; FRAME_LEN] {
    let [d0, d1, d2, d3, d4, d5, d6, d7] = data;
    let body = [HEADER, id, LENGTH, d0, d1, d2, d3, d4, d5, d6, d7];
    let [low, high] = CHECKSUM.checksum(&body).to_le_bytes();
    [HEADER, id, LENGTH, d0, d1, d2, d3, d4, d5, d6, d7, low, high]
}

/// The id byte and the data of a frame that is whole.
fn open(frame: &[u8; FRAME_LEN]) -> Result<(u8, &[u8; DATA_LEN]), DecodeError> {
    let [header, id, length, data @ .., _, _] = frame;
    if *header != HEADER {
        return Err(DecodeError::Header { got: *header, expected: HEADER });
    }
    if *length != LENGTH {
        return Err(DecodeError::Length { got: usize::from(*length), expected: DATA_LEN });
    }
    check(frame)?;
    Ok((*id, data))
}

fn check(frame: &[u8; FRAME_LEN]) -> Result<(), DecodeError> {
    let [body @ .., low, high] = frame;
    let got = u16::from_le_bytes([*low, *high]);
    let expected = CHECKSUM.checksum(body);
    if got == expected { Ok(()) } else { Err(DecodeError::Checksum { got, expected }) }
}
