//! The core as it is recorded, and the memory of the recorder.

mod memory;

use flight_recorder::Recorded;

pub use memory::{Memory, start, take};

/// The core, and the recorder that is told of each call to it.
pub type Core = Recorded<Memory>;
