//! Codec of the motor protocol with `D5` requests and `5D` replies ("D5 manual").
//!
//! Covered is the whole manual, requests and replies, both ways: commands 01 to 06 (query id, read,
//! write, asynchronous write, execute, reset), the magnetic angle, the self test, the error replies
//! and the register table. Any other command comes back as `Unknown` with its bytes.
//!
//! Every frame has eight bytes, `header id length command address low high sum`; [`request_frame`]
//! and its siblings deal with those, [`can`] puts them into CAN frames, [`serial`] finds them in a
//! byte stream. Decoding never judges a value: access and ranges are enforced when encoding
//! requests, so that a simulated motor can receive what a real one would.
//!
//! ```
//! use d5::{Address, DegreesPerSecond, Node, Register, Request, Value};
//!
//! // 600 °/s counter-clockwise for motor 0x0B, D5 manual, common commands, row 2.
//! let speed = Value::Word(d5::encode_speed(DegreesPerSecond(600)).unwrap());
//! let request = Request::Write { register: Register::SPEED, value: speed };
//! let address = Address::Node(Node::new(0x0B).unwrap());
//! let frame = d5::request_frame(address, &request).unwrap();
//! assert_eq!(frame, [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D]);
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod ack;
pub mod angle;
pub mod can;
pub mod command;
mod error;
mod faults;
mod field;
mod frame;
mod matching;
mod motor_error;
mod node;
mod payload;
mod register;
mod register_fields;
mod reply;
mod request;
pub mod serial;
pub mod speed;
mod table;
pub mod temperature;
mod units;

pub use ack::AckLevel;
pub use angle::{decode_angle, encode_angle};
pub use codec::{BuildError, CommandInfo, FieldInfo, FieldKind, FieldValue};
pub use error::{DecodeError, EncodeError};
pub use faults::{FAULTS, FaultInfo, Faults};
pub use field::{FRAME_LEN, PAYLOAD_LEN, REPLY_HEADER, REQUEST_HEADER};
pub use frame::{
    Message, decode_frame, decode_reply_frame, decode_request_frame, reply_frame, request_frame,
};
pub use matching::{Answer, answer};
pub use motor_error::MotorError;
pub use node::{Address, Node};
pub use payload::{Payload, Value, Width};
pub use register::{Access, Coding, REGISTERS, Register, RegisterInfo};
pub use reply::Reply;
pub use request::Request;
pub use speed::{decode_speed, encode_speed};
pub use table::COMMANDS;
pub use temperature::{decode_temperature, encode_temperature};
pub use units::{Celsius, Degrees, DegreesPerSecond, TurnDegrees};
