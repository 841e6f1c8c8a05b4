//! Whom a frame addresses.

use crate::node::Node;

/// Whom a request addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Target {
    /// One motor.
    Node(Node),
    /// Every motor on the bus (RMD V3.6 §3, §4, §6, §7).
    All,
}
