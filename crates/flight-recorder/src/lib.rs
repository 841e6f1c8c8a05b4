//! What led to a trip: copies of the core and every call to it since, kept in a ring of memory, and
//! played again.
//!
//! A core does what follows from its state and from what it is told, and from nothing else. So
//! whoever has a copy of it and every call since can do it all again: the same trip, at the same
//! microsecond.
//!
//! The port of a core calls it through [`Recorded`], whose [`Recorder`] keeps each call before it is
//! made. It begins when an axis is armed, keeps the latest calls in two halves of its
//! [memory](Shelf), each behind a copy of the core, and goes on after a trip until a half is full:
//! the trip and what led to it stay, until an axis is armed again. A copy is made in parts between
//! the calls, as one in one piece takes longer than a stop may wait.
//!
//! What it has kept is [read](Recorder::read) in parts. They make a file, which [`Recording`] reads
//! and [`Replay`] plays.
#![no_std]
#![forbid(unsafe_code)]

mod board;
mod call;
mod copy;
mod file;
mod log;
mod recorded;
mod recorder;
mod recording;
mod replay;
mod shelf;

pub use board::RecordedBoard;
pub use call::Call;
pub use recorded::Recorded;
pub use recorder::Recorder;
pub use recording::{Calls, Half, Recording, Unreadable};
pub use replay::{Diverged, Replay, Step};
pub use shelf::Shelf;
