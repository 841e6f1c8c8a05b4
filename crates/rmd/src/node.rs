//! The motor's id on its bus.

use codec::{Encode, FieldInfo, Shown, Visit, check_range};

use crate::bus_id;
use crate::error::{DecodeError, EncodeError};
use crate::field::DATA_LEN;
use crate::payload::Payload;

/// Id of one motor, 1..=32, the same number on CAN and on RS485 (RMD V3.6 §1.1.2, §1.2.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Node(u8);

impl Node {
    /// Lowest id (RMD V3.6 §1.1.2).
    pub const MIN: u8 = 1;
    /// Highest id (RMD V3.6 §1.1.2).
    pub const MAX: u8 = 32;

    /// The motor with this id; refuses anything outside [`Node::MIN`]..=[`Node::MAX`].
    pub const fn new(node: u8) -> Result<Node, EncodeError> {
        match check_range("node", node as i64, Self::MIN as i64, Self::MAX as i64) {
            Ok(()) => Ok(Node(node)),
            Err(error) => Err(error),
        }
    }

    /// The id as a number, 1..=32.
    pub const fn get(self) -> u8 {
        self.0
    }

    /// The motor that an id byte received over RS485 names.
    pub(crate) fn received(node: u8) -> Result<Node, DecodeError> {
        Node::new(node).map_err(|_| DecodeError::Node { node })
    }
}

impl Shown for Node {
    const INFO: FieldInfo = FieldInfo::integer("", "", Node::MIN as i64, Node::MAX as i64);

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        field.visit_integer(visit, self.0);
    }
}

/// In byte 7; in the reply to a read on CAN the word from byte 6 on.
impl Encode<Payload> for Node {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        if AT == bus_id::WORD_AT { bus_id::put_word(data, *self) } else { self.0.put::<AT>(data) }
    }
}
