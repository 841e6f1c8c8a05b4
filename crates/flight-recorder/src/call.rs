//! The calls to a core that change it, and what has come of them.

use gateway::{Event, Gateway, Instant, Set, Transmit};
use host_protocol::{CHECKSUM, MAX_FRAME};
use serde::{Deserialize, Serialize};

/// A call to a core that changes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Call<'a> {
    /// [`Gateway::handle`].
    Handle(#[serde(borrow)] Event<'a>),
    /// [`Gateway::take_changes`].
    TakeChanges,
    /// [`Gateway::poll_cancel`].
    PollCancel {
        /// Index of the bus.
        bus: u8,
    },
    /// [`Gateway::poll_transmit`].
    PollTransmit {
        /// Index of the bus.
        bus: u8,
    },
    /// [`Gateway::next_deadline`].
    NextDeadline,
    /// [`Gateway::poll_host`].
    PollHost {
        /// Index of the link.
        link: u8,
    },
    /// [`Gateway::save_some`].
    SaveSome,
    /// [`Gateway::take_save`].
    TakeSave,
    /// [`Gateway::take_flight_read`].
    TakeFlightRead,
    /// [`Gateway::take_log`].
    TakeLog,
    /// No call: what has come of those before, which is compared when they are made again.
    Came(Outcome),
}

/// What has come of the calls so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outcome {
    /// The axes that [move](Gateway::moving).
    pub(crate) moving: Set,
    /// The axes that [have tripped](Gateway::tripped).
    pub(crate) tripped: Set,
    /// A checksum of why and when.
    trips: u32,
}

/// Axis, reason and time of a trip take no more bytes.
const TRIP_BYTES: usize = 64;

impl Outcome {
    /// Of the calls to this core.
    pub(crate) fn of(core: &Gateway) -> Self {
        let tripped = core.tripped();
        let mut digest = CHECKSUM.digest();
        for (axis, trip) in core.trips(tripped) {
            // What its stop makes of it comes later.
            let why = (axis, trip.reason, trip.time_us);
            let mut bytes = [0; TRIP_BYTES];
            digest.update(postcard::to_slice(&why, &mut bytes).map_or(&[], |bytes| bytes));
        }
        Self { moving: core.moving(), tripped, trips: digest.finalize() }
    }
}

impl Call<'_> {
    /// Makes the call, at a time in the core's own clock, and returns the frame that
    /// `poll_transmit` gives. Nothing is stored.
    pub fn make(&self, core: &mut Gateway, now: Instant) -> Option<Transmit> {
        let store = &mut |_, _| {};
        match *self {
            Self::Handle(event) => _ = core.handle(now, event, store),
            Self::TakeChanges => _ = core.take_changes(),
            Self::PollCancel { bus } => _ = core.poll_cancel(now, bus),
            Self::PollTransmit { bus } => return core.poll_transmit(now, bus),
            Self::NextDeadline => _ = core.next_deadline(),
            Self::PollHost { link } => _ = core.poll_host(link, &mut [0; MAX_FRAME], store),
            Self::SaveSome => _ = core.save_some(store),
            Self::TakeSave => _ = core.take_save(),
            Self::TakeFlightRead => _ = core.take_flight_read(),
            Self::TakeLog => _ = core.take_log(),
            Self::Came(_) => {}
        }
        None
    }

    /// Whether what is said to have come of the calls before is so.
    pub(crate) fn is_true(&self, core: &Gateway) -> bool {
        match self {
            Self::Came(outcome) => *outcome == Outcome::of(core),
            _ => true,
        }
    }
}
