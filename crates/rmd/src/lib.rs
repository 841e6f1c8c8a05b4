//! Codec for MyActuator RMD servo motors: "Servo Motor Control Protocol V3.6", cited here as "RMD V3.6 §…".
//!
//! Requests and replies, both encoded and decoded, over CAN ([`can`]) and RS485 ([`rs485`]). Covered are angle and
//! status reading (0x92, 0x9A, 0x9C), shutdown and stop (0x80, 0x81), torque current, velocity and absolute position
//! (0xA1, 0xA2, 0xA4), the brake (0x77, 0x78), the motor's communication timeout (0xB3) and its notice (0xF1). Every
//! other command comes back as `Unknown` with its bytes, so that nothing read from a wire is lost.
//!
//! Units are the manual's own ([`Centiamps`], [`Centidegrees`], …); signs are the motor's.
//!
//! ```
//! use rmd::{Answer, Centiamps, Node, Reply, Request, answer, rs485};
//!
//! let request = Request::TorqueCurrent { current: Centiamps(100) };
//! assert_eq!(request.encode(), Ok([0xA1, 0x00, 0x00, 0x00, 0x64, 0x00, 0x00, 0x00]));
//!
//! let reply = Reply::decode(&[0xA1, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00])?;
//! assert_eq!(answer(&request, &reply), Answer::Reply(reply));
//!
//! let frame = rs485::request(Node::new(1)?, &Request::ReadStatus2)?;
//! assert_eq!(frame, [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30]);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub mod can;
mod error;
mod faults;
mod field;
mod matching;
mod node;
mod notice;
mod reply;
mod request;
pub mod rs485;
mod units;

pub use error::{DecodeError, EncodeError};
pub use faults::Faults;
pub use field::{DATA_LEN, command};
pub use matching::{Answer, answer};
pub use node::Node;
pub use notice::RawNotice;
pub use reply::{Motion, Reply};
pub use request::Request;
pub use units::{
    Celsius, Centiamps, Centidegrees, CentidegreesPerSecond, Decivolts, Degrees, DegreesPerSecond,
    Milliseconds, SpeedLimit,
};

#[cfg(test)]
#[path = "../tests/frame/mod.rs"]
mod test_frame;
