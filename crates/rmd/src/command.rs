//! Command codes: data byte 0 of a request and of its reply.

use core::ops::RangeInclusive;

pub use crate::table::codes::*;

/// The closed-loop commands, 0xA1 to 0xA9 (RMD V3.6 §2.17 to §2.22, V4.3 0xA9): the ones that move
/// the motor, beside 0x72 and 0x73 of V4.4.
pub const CLOSED_LOOP: RangeInclusive<u8> = TORQUE_CURRENT..=CAPPED_POSITION;
/// Use or switch one of four functions (RMD V3.6 §2.33).
pub const FUNCTION: u8 = CLEAR_MULTI_TURN;
/// Read or set the id, under ids of its own on both buses (RMD V3.6 §4, §7).
pub const BUS_ID: u8 = READ_CAN_ID;
/// Sent by some motors, unasked, once their communication timeout has struck. Not in the manual.
pub const TIMEOUT_NOTICE: u8 = 0xF1;
