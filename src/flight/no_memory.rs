//! A board without room for a flight recorder: one copy of the core takes half of its RAM.

use flight_recorder::NoShelf;
use host_protocol::BootReason;

/// There is none.
pub type Memory = NoShelf;

/// Nothing is kept.
pub fn start(_: BootReason, _: bool) -> bool {
    false
}

/// None.
pub fn take(_: bool) -> Memory {
    NoShelf
}
