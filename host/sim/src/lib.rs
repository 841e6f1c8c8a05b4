//! Simulated motors on simulated buses, around the very core that runs in the firmware.
//!
//! A [`World`] holds one gateway, its buses with their motors, and its host links, all in virtual
//! time: it runs as fast as the machine can, and the same wiring, seed and input give the same run.
//! Programs talk to it with the client library over a [`SimTransport`], or over TCP and in real
//! time once [`serve()`] runs it.
//!
//! What a motor did is in its own [`MotorLog`], what was on the wires in [`World::trace`]; neither
//! passes through the gateway.
//!
//! ```
//! use std::time::Duration;
//! use mgw_sim::{Wiring, World};
//!
//! let mut world = World::new(Wiring::four_motors());
//! world.run_for(Duration::from_millis(5));
//! assert_eq!(world.now().as_micros(), 5_000);
//! assert_eq!(world.motors().len(), 4);
//! assert!(world.trace().is_empty(), "nobody has asked for anything");
//! ```
#![forbid(unsafe_code)]

mod bus;
mod can;
pub mod flash;
pub mod images;
mod motors;
mod random;
mod recording_file;
mod rs485;
mod serve;
mod transport;
mod wiring;
mod world;

pub use bus::{BusFault, Station, Wire};
pub use can::frame_bits as can_frame_bits;
pub use motors::{Beginning, Injection, LogEntry, Motor, MotorEvent, MotorLog, Outgoing, Turning};
pub use recording_file::RecordingFile;
pub use serve::{FlightFile, Server, put_fault, serve};
pub use transport::{SharedWorld, SimTransport};
pub use wiring::{BOARD, FlightWiring, MotorWiring, Wiring, WiringError};
pub use world::{TraceEntry, World};
