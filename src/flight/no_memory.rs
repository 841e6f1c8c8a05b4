//! A board without room for a flight recorder: one copy of the core takes half of its RAM.

use embassy_executor::Spawner;
use flight_recorder::NoShelf;
use host_protocol::BootReason;

use crate::shared_gateway::SharedGateway;

/// There is none.
pub type Memory = NoShelf;

/// None.
pub fn take(_: BootReason) -> Memory {
    NoShelf
}

/// There is nothing to do.
pub fn spawn(_: Spawner, _: &'static SharedGateway) {}
