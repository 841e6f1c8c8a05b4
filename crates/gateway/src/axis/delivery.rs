//! The backstop behind all scheduling: what a host has been told to be accepted is on the wire in
//! time, or the axis trips (GUARANTEES G2). It looks at what has left, never at who should have
//! sent it.

use super::Axis;
use super::exchanges::Pending;
use crate::time::{Duration, Instant};
use host_protocol::AxisState;

impl Axis {
    /// A setpoint has been accepted. One that takes the place of another, not sent yet, has no more
    /// time than that had.
    pub(super) fn owe_delivery(&mut self, now: Instant) {
        let moves = self.state == AxisState::Active;
        self.undelivered_since = if moves { self.undelivered_since.min(now) } else { now };
    }

    /// The bus has not sent what it had taken.
    pub(super) fn not_delivered(&mut self, pending: &Pending) {
        if let Some(since) = pending.undelivered_since() {
            self.undelivered_since = self.undelivered_since.min(since);
        }
    }

    /// From when on the setpoint in force is late, but for the time that its bus may take: its
    /// refresh time after it was accepted, or after its refresh was due.
    pub fn delivery_due_at(&self) -> Option<Instant> {
        self.undelivered_since().map(|since| since + self.refresh())
    }

    /// Whether the setpoint in force is late by more than the time that its bus may take.
    pub fn delivery_is_late(&self, now: Instant, within: Duration) -> bool {
        // Most wait for no delivery: the refresh time takes longer to find.
        self.undelivered_since()
            .is_some_and(|since| since <= now && since + self.refresh() + within <= now)
    }

    fn undelivered_since(&self) -> Option<Instant> {
        if self.state != AxisState::Active {
            return None;
        }
        let taken = self.pending.as_ref().and_then(Pending::undelivered_since);
        let since = taken.map_or(self.undelivered_since, |taken| taken.min(self.undelivered_since));
        (since < Instant::NEVER).then_some(since)
    }
}
