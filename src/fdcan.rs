//! A CAN controller (FDCAN, classic frames) as the core's port needs it.
//!
//! `embassy-stm32` sets it up: clock, pins, message RAM, bit timing, filters. Frames go in and out
//! through its registers, because the core must know which frame the bus has acknowledged, and
//! because the driver sends a remote frame that asks for data as a data frame.

mod can_events;
mod controller;
mod element;
mod message_ram;
mod port;
mod timing;

pub(crate) use can_events::instance;
pub use can_events::{
    CanEvent, CanEvents, FIFO, Instance, InterruptHandler, OTHER_FIFO, look, may_sleep, stay_awake,
    waiting,
};
pub use controller::{Controller, ErrorState};
pub use element::received;
pub use message_ram::MessageRam;
pub use port::{CanPort, FdcanPort};
pub use timing::{Timing, bitrates};
