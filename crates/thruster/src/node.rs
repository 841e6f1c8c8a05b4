//! The id of a device on its bus.

use codec::check_range;

use crate::error::EncodeError;

/// Id of one device, 1..=127 (Thruster manual §1.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Node(u8);

impl Node {
    /// Lowest id (Thruster manual §1.1).
    pub const MIN: u8 = 1;
    /// Highest id (Thruster manual §1.1).
    pub const MAX: u8 = 127;

    /// The device with this id; refuses anything outside [`Node::MIN`]..=[`Node::MAX`].
    pub const fn new(node: u8) -> Result<Node, EncodeError> {
        match check_range("node", node as i64, Self::MIN as i64, Self::MAX as i64) {
            Ok(()) => Ok(Node(node)),
            Err(error) => Err(error),
        }
    }

    /// The id as a number, 1..=127.
    pub const fn get(self) -> u8 {
        self.0
    }
}
