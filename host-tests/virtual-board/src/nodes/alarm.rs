//! The one event that a peer waits for on its controller's clock.

use std::time::Duration;

use rigless::chip::Timeline;
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

use super::instant;

/// When a peer wants to be called next. The emulator cannot cancel an event, so one that is no
/// longer wanted passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Alarm(Option<(VirtualNanos, EventId)>);

impl Alarm {
    /// Wakes the peer at `at` and at no other time. A time that has passed means at once.
    pub(crate) fn set(&mut self, at: Option<Duration>, timeline: &mut Timeline<'_, '_>) {
        let wanted = at.map(|at| instant(at).max(timeline.now()));
        if self.0.map(|(at, _)| at) != wanted {
            self.0 = wanted.map(|at| (at, timeline.schedule(at)));
        }
    }

    /// Whether this is the event, which has come with that.
    pub(crate) fn take(&mut self, event: EventId) -> bool {
        self.0.take_if(|(_, awaited)| *awaited == event).is_some()
    }

    /// The controller has dropped its events.
    pub(crate) fn lost(&mut self) {
        self.0 = None;
    }
}
