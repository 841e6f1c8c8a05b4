//! The data of 0x79, which reads and sets the motor's id on CAN (RMD V3.6 §4) and on RS485 (§7).
//!
//! It has an id of its own on either bus, and every motor there obeys.

use crate::can::REPLY_BASE;
use crate::command;
use crate::error::DecodeError;
use crate::field::{DATA_LEN, Field};
use crate::node::Node;

/// Read or write flag (RMD V3.6 §4.2).
const ACCESS: Field<2, 1> = Field;
const WRITE: u8 = 0;
const READ: u8 = 1;
/// Id in requests and in the echo of a write (RMD V3.6 §4.2).
const ID: Field<7, 1> = Field;
/// Id in the reply to a read: a little-endian word (RMD V3.6 §4.3).
const WORD: Field<WORD_AT, 2> = Field;
pub(crate) const WORD_AT: usize = 6;

/// Whether a frame reads, and the id it carries.
pub(crate) enum Access {
    Read,
    Write,
}

/// What follows the command byte of a read, and of its reply before the id.
pub(crate) const READ_BYTES: [u8; DATA_LEN - 1] = [0, READ, 0, 0, 0, 0, 0];

/// Puts the CAN id with which the motor answers (RMD V3.6 §4.4 example 2).
pub(crate) fn put_word(data: &mut [u8; DATA_LEN], id: Node) {
    WORD.put(data, (REPLY_BASE + u16::from(id.get())).to_le_bytes());
}

/// Whether these are the data of an id command, and which access; the flag is a bool, so all but 0
/// reads.
pub(crate) fn access(data: &[u8; DATA_LEN]) -> Option<Access> {
    let [command::BUS_ID, ..] = data else { return None };
    Some(if ACCESS.get(data) == [WRITE] { Access::Write } else { Access::Read })
}

/// The id in the data of a write.
pub(crate) fn written(data: &[u8; DATA_LEN]) -> u8 {
    let [id] = ID.get(data);
    id
}

/// The motor in the echo of a write.
pub(crate) fn written_node(data: &[u8; DATA_LEN]) -> Result<Node, DecodeError> {
    let id = written(data);
    Node::new(id).map_err(|_| DecodeError::BusId { word: u16::from(id) })
}

/// The motor in the reply to a read on CAN: a word above the base of reply ids is such an id, any
/// other the bare id.
pub(crate) fn can_node(data: &[u8; DATA_LEN]) -> Result<Node, DecodeError> {
    let word = u16::from_le_bytes(WORD.get(data));
    let id = word.checked_sub(REPLY_BASE).filter(|id| *id > 0).unwrap_or(word);
    node(id, word)
}

/// The motor in the reply to a read on RS485. The table of §7.3 has the id in byte 6, the example
/// of §7.4 in byte 7.
pub(crate) fn rs485_node(data: &[u8; DATA_LEN]) -> Result<Node, DecodeError> {
    let [sixth, seventh] = WORD.get(data);
    let id = if seventh == 0 { sixth } else { seventh };
    node(u16::from(id), u16::from_le_bytes([sixth, seventh]))
}

fn node(id: u16, word: u16) -> Result<Node, DecodeError> {
    let id = u8::try_from(id).ok().and_then(|id| Node::new(id).ok());
    id.ok_or(DecodeError::BusId { word })
}
