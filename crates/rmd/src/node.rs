//! The motor's id on its bus, and to whom a request goes.

use codec::{Encode, FieldInfo, Shown, Visit};

use crate::bus_id;
use crate::error::DecodeError;
use crate::field::DATA_LEN;
use crate::payload::Payload;

codec::node! {
    /// Id of one motor, 1..=32, the same number on CAN and on RS485 (RMD V3.6 §1.1.2, §1.2.2).
    struct Node in 1..=32;
}

impl Node {
    /// The motor that an id byte received over RS485 names.
    pub(crate) fn received(node: u8) -> Result<Node, DecodeError> {
        Node::new(node).map_err(|_| DecodeError::Node { node })
    }
}

/// Whom a request addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Target {
    /// One motor.
    Node(Node),
    /// Every motor on the bus (RMD V3.6 §3, §4, §6, §7).
    All,
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
