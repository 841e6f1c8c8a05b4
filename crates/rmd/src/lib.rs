//! Codec for MyActuator RMD servo motors: "Servo Motor Control Protocol V3.6", cited here as "RMD
//! V3.6 §…".
//!
//! Requests and replies, both encoded and decoded, over CAN ([`can`]) and RS485 ([`rs485`]): every
//! single-motor command of §2, commands to all motors (§3, §6), the commands that read and set a
//! motor's id (§4, §7) and motion mode (§5), which is CAN only. What the manual does not list comes
//! back as `Unknown` with its bytes, so that nothing read from a wire is lost.
//!
//! Newer motors speak other versions of it: a [`Dialect`] says which commands a motor has and in
//! which form ([`Request::encode_in`], [`Request::decode_in`], [`Reply::decode_in`]).
//!
//! Tools reach every command by its name in [`COMMANDS`]: [`Request::build`],
//! [`Request::visit_fields`] and [`Reply::visit_fields`].
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

mod baud;
mod bus_id;
pub mod can;
pub mod command;
mod dialect;
mod error;
mod faults;
mod field;
mod function;
mod gain;
mod matching;
mod model;
mod motion;
mod motion_mode;
mod node;
mod notice;
mod payload;
mod pid;
mod ramp;
mod recognition;
mod reply;
mod request;
pub mod rs485;
mod run_mode;
mod table;
mod units;

pub use baud::BaudCode;
pub use codec::{BuildError, CommandInfo, FieldInfo, FieldKind, FieldValue};
pub use dialect::{Dialect, Dialects};
pub use error::{DecodeError, EncodeError};
pub use faults::{FAULTS, FaultInfo, FaultLevel, Faults};
pub use field::DATA_LEN;
pub use function::Function;
pub use gain::{Gain, GainValue};
pub use matching::{Answer, answer, answer_on_line};
pub use model::{Model, ModelPart};
pub use motion::Motion;
pub use motion_mode::{
    MotionCommand, MotionFeedback, MotionRanges, MotionState, MotionTarget, Span,
};
pub use node::{Node, Target};
pub use notice::RawNotice;
pub use pid::PidGains;
pub use ramp::Ramp;
pub use recognition::{PROBES, Recognised, is_echo_of_version, tells};
pub use reply::Reply;
pub use request::Request;
pub use run_mode::RunMode;
pub use table::COMMANDS;
pub use units::{
    Celsius, Centiamps, Centidegrees, CentidegreesPerSecond, Decivolts, Deciwatts, Degrees,
    DegreesPerSecond, DegreesPerSecondSquared, EncoderCounts, EncoderPulses, FeedForward,
    FineSpeedLimit, Milliseconds, SingleTurn, SpeedLimit, TorqueCap, VersionDate,
};
