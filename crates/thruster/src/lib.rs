//! Codec of the CAN protocol of thrusters, rudders and push rods ("Thruster manual": the thruster
//! CAN manual).
//!
//! Covered is the whole manual, requests and replies, both ways: signal, speed and position
//! commands, queries, faults, automatic returns, settings, system parameters and the emergency
//! stop. System parameters other than the position limits are raw. Any other command comes back as
//! `Unknown` with its bytes.
//!
//! The codec speaks the manual's own units and knows no bus but CAN. Decoding never judges a value:
//! ranges are enforced when encoding, so that a simulated device can receive, and refuse, what a
//! real one would.
//!
//! ```
//! use thruster::{Percent, Reply, Request};
//!
//! // −5 % signal, Thruster manual §1.3.
//! let request = Request::Signal { signal: Percent(-5) };
//! let payload = request.encode().unwrap();
//! assert_eq!(payload.as_slice(), [0x54, 0x43, 0, 0, 0, 0, 0xFF, 0xFB]);
//!
//! let refusal = Reply::decode(&[0x54, 0x43, 0, 0, 0, 0, 0xEE, 0xEE]).unwrap();
//! assert_eq!(refusal, Reply::Refused { command: thruster::command::SIGNAL, parameter: 0 });
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod bitrate;
pub mod can;
pub mod command;
mod error;
mod faults;
mod field;
mod matching;
mod node;
mod parameter;
mod payload;
mod refused;
mod reply;
mod request;
mod returned;
mod table;
mod units;

pub use bitrate::{BITRATES, BitrateInfo};
pub use codec::{BuildError, CommandInfo, FieldInfo, FieldKind, FieldValue};
pub use error::{DecodeError, EncodeError};
pub use faults::{FAULTS, FaultAction, FaultInfo, FaultRecovery, Faults};
pub use field::{
    POSITION_LIMITS, POSITION_MAX, POSITION_MIN, REPLY_ID_BASE, REQUEST_ID_BASE, SIGNAL_MAX,
    SIGNAL_MIN, SPEED_MIN_MAGNITUDE, TIMEOUT_MAX, TIMEOUT_MIN, TIMEOUT_OFF,
};
pub use matching::{Answer, answer};
pub use node::Node;
pub use payload::Payload;
pub use reply::Reply;
pub use request::Request;
pub use returned::{Headerless, ReturnFlags, ReturnFrames, ReturnSource, Returned, ReturnedFrame};
pub use table::COMMANDS;
pub use units::{
    Celsius, Deciamps, Decidegrees, Decivolts, Kilobits, LimitDecidegrees, Milliseconds, Percent,
    Rpm, RpmLimit,
};
