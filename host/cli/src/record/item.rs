//! What can be recorded.

use std::time::Duration;

use host_protocol::{CycleMessage, EventMessage, ReceivedFrame};
use mgw_serve::Seen;

/// Something that was seen, and when.
#[derive(Debug, Clone)]
pub struct Item {
    /// Host time since the recording began.
    pub at: Duration,
    pub what: What,
}

/// Something that was seen.
#[expect(clippy::large_enum_variant, reason = "the queue of a recording boxes it")]
#[derive(Debug, Clone)]
pub enum What {
    /// An event, a sample too.
    Event(EventMessage),
    /// A period of a free-running cycle.
    Cycle(CycleMessage),
    /// A frame of a bus that is open for raw frames.
    Frame { bus: u8, frame: ReceivedFrame },
    /// A frame of the cable of a server.
    Seen(Seen),
    /// So many samples, events and raw frames got lost on the way, in all.
    Lost { on_the_way: u64 },
}
