//! The host protocol of the motor gateway: framing, and one table of requests, replies, errors and
//! events.
//!
//! `PROTOCOL.md` describes the same wire for readers of other languages; a test holds the two
//! together.
//!
//! ```
//! use host_protocol::{Deframer, Kind, MAX_FRAME, Request, requests::Ping};
//!
//! let mut out = [0; MAX_FRAME];
//! let length = Request::Ping(Ping {}).encode_frame(1, &mut out).unwrap();
//! let bytes = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];
//! assert_eq!(out[..length], bytes);
//!
//! let mut deframer = Deframer::new();
//! let mut pings = 0;
//! for byte in &out[..length] {
//!     if let Some(Ok(frame)) = deframer.push(*byte) {
//!         assert_eq!((frame.kind, frame.sequence), (Kind::Request, 1));
//!         assert_eq!(Request::decode(frame.number, frame.body), Ok(Request::Ping(Ping {})));
//!         pings += 1;
//!     }
//! }
//! assert_eq!(pings, 1);
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod axis;
mod bus;
mod can_frame;
mod can_id;
mod changes;
mod cycle;
mod cycle_event;
mod deframer;
mod encode;
mod error_text;
mod errors;
mod events;
mod field_doc;
mod filled;
mod frame;
mod image;
mod incident;
#[cfg(test)]
mod largest;
pub mod messages;
mod names;
pub mod parameters;
mod pieces;
mod protocol;
pub mod replies;
pub mod requests;
mod size;
mod text;
mod value;

pub use axis::{
    Agreement, AxisState, AxisSummary, ClearTarget, FaultReading, MotorTimeout, Reading, Setpoint,
    StopTarget, Trip, TripReason,
};
pub use bus::{
    BusCapability, BusConfig, BusCounters, BusKind, BusLimit, BusMode, BusState, MAX_BITRATES,
    MAX_SERIAL_FRAME, RawFrame, ReceivedFrame,
};
pub use can_frame::{CanFrame, MAX_CAN_DATA};
pub use can_id::{CanId, NoCanId};
pub use changes::{Change, Setting, StoredState};
pub use cycle::{CycleResult, CycleState, FixedU32, MAX_CYCLE_AXES, cycle_frame_bytes};
pub use cycle_event::{CycleEvent, CycleMessage, Overruns, SlowState, cycle_event_bytes};
pub use deframer::Deframer;
pub use encode::{EncodeError, encode, encode_body, frame_message, write_message};
pub use errors::{ERRORS, Error, NoReplyHint, TogetherBar};
pub use events::{AuthorityLossReason, EVENT_BASE, EVENTS, Event, EventMessage};
pub use filled::Filled;
pub use frame::{
    CHECKSUM, CHECKSUM_SIZE, DELIMITER, Frame, FrameError, HEADER_SIZE, Kind, MAX_BODY, MAX_FRAME,
    MAX_MESSAGE,
};
pub use image::{FirmwareVersion, IMAGE_UNIT, ImageState, MAX_IMAGE_BYTES, SIGNATURE_SIZE};
pub use incident::{BootReason, Incident};
pub use messages::{Call, DecodeError, MessageInfo, REQUESTS, Reply, Request, class};
pub use names::{MAX_NAME, Named, Subject, is_name};
pub use parameters::{
    AxisParameter, GatewayParameter, ParameterInfo, ParameterText, REPLY_WINDOW_US, ValueKind,
};
pub use pieces::Pieces;
pub use protocol::{Protocol, ProtocolSet, StateField, StateFields, StopAction, UnknownNumber};
pub use replies::VersionAnswer;
pub use requests::Member;
pub use size::{MaxSize, layout_of};
pub use text::{Bytes, Text, Vec};
pub use value::{Quantity, Value};

/// Grows when a message of an earlier version loses its meaning. Host and gateway refuse another
/// one than theirs.
pub const PROTOCOL_MAJOR: u16 = 1;

/// Baud of a host link on a UART after a start, and when it hears nothing valid at another rate.
pub const DEFAULT_BAUD: u32 = 921_600;

/// Grows when messages are added.
pub const PROTOCOL_MINOR: u16 = 0;
