//! The host protocol as PROTOCOL.md has it, read anew: frames, bodies, and the messages that the
//! promises speak of.

mod body;
mod frame;
mod incident;
mod message;
mod report;
mod request;

pub use body::Body;
pub use frame::{Deframer, Kind, Message, frame};
pub use incident::Incident;
pub use message::{News, Told, event, events_lost};
pub use report::{Listed, Report, report};
pub use request::{BusSetting, Change, Clears, Request, Stops};
