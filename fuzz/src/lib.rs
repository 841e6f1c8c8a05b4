//! What must hold for any bytes: one module for each fuzz target, each with a function `check` that
//! panics where it does not.

pub mod d5;
pub mod d5_serial;
pub mod host_messages;
pub mod host_stream;
pub mod promises;
pub mod rmd;
pub mod rmd_rs485;
pub mod thruster;

pub mod frames;
mod line;
mod take;
