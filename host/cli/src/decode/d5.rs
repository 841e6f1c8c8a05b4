//! D5 frames: the first byte says which way they go.

use std::io::Write;

use d5::{Address, DecodeError, FRAME_LEN, Message, Reply, Request};
use embedded_can::Frame;
use host_protocol::CanFrame;

use super::record::{Direction, Motor, Record};
use super::{put, put_message};

const NAME: &str = "d5";

/// Whether data look like a frame of this protocol, which has no ids of its own to tell.
pub fn begins(data: &[u8]) -> bool {
    data.len() == FRAME_LEN && matches!(data, [d5::REQUEST_HEADER | d5::REPLY_HEADER, ..])
}

/// The message of a CAN frame.
pub fn can(frame: &CanFrame) -> Result<Message, DecodeError> {
    if frame.is_remote_frame() {
        return Err(DecodeError::RemoteFrame);
    }
    let data = frame.data();
    let bytes = data
        .try_into()
        .map_err(|_| DecodeError::Length { got: data.len(), expected: FRAME_LEN })?;
    d5::decode_frame(bytes)
}

/// Writes a message, or why there is none.
pub fn write<W: Write>(message: Result<Message, DecodeError>, record: &mut Record<W>) {
    match message {
        Ok(Message::Request(address, request)) => {
            let motor = match address {
                Address::Node(node) => Motor::Node(node.get()),
                Address::Broadcast => Motor::All,
            };
            let is_known = !matches!(request, Request::Unknown { .. });
            put_message!(record, Request, motor, request, is_known, &[]);
        }
        Ok(Message::Reply(node, reply)) => {
            let is_known = !matches!(reply, Reply::Unknown { .. });
            put_message!(record, Reply, Motor::Node(node.get()), reply, is_known, &[]);
        }
        Err(error) => {
            record.protocol(NAME);
            record.error(error_name(&error), &error);
        }
    }
}

fn error_name(error: &DecodeError) -> &'static str {
    match error {
        DecodeError::RemoteFrame => "remote_frame",
        DecodeError::Length { .. } => "length",
        DecodeError::Checksum { .. } => "checksum",
        DecodeError::Header { .. } => "header",
        DecodeError::Node { .. } => "node",
        DecodeError::FixedByte { .. } => "fixed_byte",
    }
}
