//! A CAN controller (FDCAN, classic frames) as the core's port needs it.
//!
//! `embassy-stm32` sets it up: clock, pins, message RAM, bit timing, filters. Frames go in and out
//! through its registers, because the core must know which frame the bus has acknowledged, and
//! because the driver sends a remote frame that asks for data as a data frame.

mod controller;
mod element;
mod happenings;
mod message_ram;
mod port;
mod timing;

pub use controller::{Controller, ErrorState};
pub(crate) use happenings::instance;
pub use happenings::{FIFO, Happening, Happenings, Instance, InterruptHandler, OTHER_FIFO};
pub use message_ram::MessageRam;
pub use port::{CanPort, FdcanPort};
pub use timing::{Timing, bitrates};
