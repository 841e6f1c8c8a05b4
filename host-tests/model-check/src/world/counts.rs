//! What has happened in a run.

use super::World;
use promise_model::Told;

/// What has happened so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counts {
    /// Events that the core took in.
    pub events: u64,
    /// Of them while an axis was armed, active or stopping.
    pub busy: u64,
    /// Motion frames.
    pub motions: u64,
    /// Armings.
    pub armed: u64,
    /// Trips.
    pub trips: u64,
    /// Stops that were confirmed.
    pub confirmed: u64,
    /// Starts after a reset or a loss of power.
    pub starts: u64,
    /// Frames that have set several motors in motion.
    pub started_together: u64,
    /// Frames that a serial port sent by itself behind a reply.
    pub behind_replies: u64,
}

impl Counts {
    /// The sum of two.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            events: self.events + other.events,
            busy: self.busy + other.busy,
            motions: self.motions + other.motions,
            armed: self.armed + other.armed,
            trips: self.trips + other.trips,
            confirmed: self.confirmed + other.confirmed,
            starts: self.starts + other.starts,
            started_together: self.started_together + other.started_together,
            behind_replies: self.behind_replies + other.behind_replies,
        }
    }
}

impl World {
    pub(super) fn count(&mut self) {
        for (axis, told) in (0u8..).zip(&mut self.told) {
            let now = self.oracle.told(axis);
            let before = std::mem::replace(told, now);
            if before == now {
                continue;
            }
            let (was_tripped, is_tripped) =
                (matches!(before, Told::Tripped { .. }), matches!(now, Told::Tripped { .. }));
            self.counts.armed += u64::from(now == Told::Armed);
            self.counts.trips += u64::from(is_tripped && !was_tripped);
            let stopped = before == Told::Stopping && now.is_at_rest();
            self.counts.confirmed += u64::from(stopped || now == Told::Tripped { confirmed: true });
        }
        for (axis, epoch) in (0u8..).zip(&mut self.epochs) {
            *epoch = self.oracle.epoch(axis).unwrap_or(*epoch);
        }
    }
}
