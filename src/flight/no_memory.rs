//! A board without room for a flight recorder: one copy of the core takes half of its RAM.

use flight_recorder::NoShelf;
use host_protocol::BootReason;

/// There is none.
pub type Memory = NoShelf;

/// None.
pub fn take(_: BootReason) -> Memory {
    NoShelf
}
