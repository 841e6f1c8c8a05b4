//! The motor's id on its bus, and to whom a request goes.

use crate::error::{DecodeError, EncodeError};

codec::node! {
    /// Id of one motor, 0x01..=0xFD. The manual gives no range; 0xFE is the broadcast id.
    struct Node in 0x01..=0xFD;
}

impl Node {
    /// The id from the factory, which a reset restores (D5 manual, table row 6).
    pub const FACTORY: Node = Node(0x0B);

    /// The motor that a received id byte names.
    pub(crate) fn received(node: u8) -> Result<Node, DecodeError> {
        Node::new(node).map_err(|_| DecodeError::Node { node })
    }
}

/// To whom a request goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Address {
    /// One motor.
    Node(Node),
    /// All motors, id 0xFE: printed with query, execute and reset only, and sent only with those
    /// (D5 manual, table row 1 and quick start).
    Broadcast,
}

impl Address {
    /// The id byte of a broadcast (D5 manual, table row 1).
    pub const BROADCAST_ID: u8 = 0xFE;

    /// Whom an id byte names: one motor, or all with [`Address::BROADCAST_ID`].
    pub const fn new(id: u8) -> Result<Address, EncodeError> {
        if id == Self::BROADCAST_ID {
            return Ok(Address::Broadcast);
        }
        match Node::new(id) {
            Ok(node) => Ok(Address::Node(node)),
            Err(error) => Err(error),
        }
    }

    /// The id byte of the frame.
    pub const fn id(self) -> u8 {
        match self {
            Address::Node(node) => node.get(),
            Address::Broadcast => Self::BROADCAST_ID,
        }
    }
}
