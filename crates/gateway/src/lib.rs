//! The core of the motor gateway, without input or output: axes, routing, translation, deadlines,
//! stop sequences.
//!
//! It takes events and the time as arguments and never reads a clock or touches a peripheral, so
//! the same code runs in the firmware, in the simulator and in tests with virtual time.
#![no_std]
#![forbid(unsafe_code)]

mod axes;
mod axis;
mod bus;
mod bus_rules;
mod config;
mod each;
mod filled;
mod gateway;
mod history;
mod link;
mod log;
mod measured;
mod outbox;
pub mod port;
mod protocol;
mod rules;
mod set;
mod state_text;
mod time;
mod tracked;
mod transaction;

pub use axis::PERIOD_US;
pub use bus::{Assumptions, AxisPlan, BusPlan, PAUSE_BITS, bits_at};
pub use bus_rules::check_bus_config;
pub use gateway::{
    Gateway, MAX_SNAPSHOT, MAX_STORED_ROW, NextRow, Part, RETAINED_WORDS, ResumeError, STORED_ROWS,
};
pub use host_protocol::StoredState;
pub use log::LogEntry;
pub use port::{
    Board, BusPort, BusSetup, Changes, Event, FlightPage, FlightRead, FlightReadError, Found,
    FoundImage, ImageJob, Images, Light, LinkPort, Outgoing, Save, SaveError, Store, Then,
    Transmit,
};
pub use rules::{AxisRules, NativeEffect};
pub use set::Set;
pub use time::{Duration, Instant};

/// Axes of one gateway.
pub const MAX_AXES: usize = 32;
/// Buses of one gateway.
pub const MAX_BUSES: usize = 4;
/// Host links of one gateway.
pub const MAX_LINKS: usize = 3;

/// [`MAX_AXES`] as the wire carries it.
#[allow(clippy::cast_possible_truncation)]
pub(crate) const MAX_AXES_WIRE: u8 = MAX_AXES as u8;
/// [`MAX_LINKS`] likewise.
#[allow(clippy::cast_possible_truncation)]
pub(crate) const MAX_LINKS_WIRE: u8 = MAX_LINKS as u8;
