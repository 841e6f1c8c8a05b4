//! The calls to a core that change it.

use gateway::{Event, Gateway, Instant, Transmit};
use host_protocol::MAX_FRAME;
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
    /// [`Gateway::take_log`].
    TakeLog,
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
            Self::TakeLog => _ = core.take_log(),
        }
        None
    }
}
