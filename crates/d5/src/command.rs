//! Command codes: byte 3 of every frame.

pub use crate::table::codes::*;

/// In the reply to a reset: the command state is cleared (D5 manual, table row 6).
pub const RESET_DONE: u8 = 0x00;
