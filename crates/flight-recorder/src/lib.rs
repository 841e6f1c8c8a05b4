//! What led to a trip: snapshots of the core and every call to it since, kept in a ring of memory,
//! and played again.
//!
//! A core does what follows from its state and from what it is told, and from nothing else. So
//! whoever has a snapshot of it and every call since can do it all again: the same trip, at the
//! same microsecond.
//!
//! The port of a core owns a [`Recorder`] and [notes](Recorder::note) each call before it makes it.
//! The recorder begins when an axis is armed, keeps the latest calls in two halves of its memory,
//! each behind a snapshot of its own, and goes on after a trip until a half is full: the trip and
//! what led to it stay, until an axis is armed again. [`Recording::read`] finds them there, also in
//! memory that has outlived a reset, and [`Replay`] does it all again.
//!
//! | The memory | |
//! |---|---|
//! | 0 | `MGFR`; the trip: length of what follows, checksum, axis and trip |
//! | 128 | two halves: number, since when, lengths, checksum of board and snapshot; board; snapshot; calls |
//!
//! A file has the used parts of it, moved together, and a checksum of all that behind them.
#![no_std]
#![forbid(unsafe_code)]

mod board;
mod call;
mod memory;
mod recorder;
mod recording;
mod replay;

pub use board::RecordedBoard;
pub use call::Call;
pub use memory::trip as recorded_trip;
pub use recorder::Recorder;
pub use recording::{Calls, Half, Recording, Unreadable};
pub use replay::{Diverged, Replay, Step};
