//! Stops that come to nothing, and the motor that is left alone for it; stops that could not be
//! sent; stops that are asked for again (GUARANTEES G4).

use super::Phase;
use crate::axis::Axis;
use crate::axis::exchanges::Pending;
use crate::outbox::Outbox;
use crate::time::Instant;
use host_protocol::{AxisState, Error, Event, TripReason};

impl Axis {
    /// A stop came to nothing. After so many of them the motor counts as unreachable (GUARANTEES
    /// G4).
    pub(super) fn count_unconfirmed(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let enough = self.config.stops_before_unreachable();
        let Some(stop) = &mut self.stop else { return };
        stop.went_on_at = now;
        stop.unconfirmed = stop.unconfirmed.saturating_add(1);
        if stop.unconfirmed >= enough && !stop.resting {
            self.rest(now, out);
        }
    }

    /// The motor is unreachable: from now on it is sent two stops between silences, in which its
    /// own timeout can act.
    pub(in crate::axis) fn rest(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let silence = self.unreachable_silence();
        let Some(stop) = &mut self.stop else { return };
        stop.resting = true;
        stop.second_follows = false;
        // The silence is for a motor that hears us: what has not left has fed no timeout, and a
        // stop that has never left is due.
        stop.rests_until = stop.last_left.map_or(now, |left| left + silence);
        self.becomes_unreachable(now, true, out);
    }

    /// Since when the stop has a frame to send that has not left, where nobody has been told of
    /// that.
    pub fn unsent_stop_since(&self) -> Option<Instant> {
        let stop = self.stop.as_ref()?;
        if self.pending.as_ref().is_some_and(Pending::is_waiting) {
            return None;
        }
        let since = stop.unsent_since()?;
        Some(if stop.has_left() { self.quiet.delays(false, since) } else { since })
    }

    /// The stop has not left for too long: it is not counted as sent, and stays owed. An axis that
    /// was at rest waits for it; of any other the motor may be turning.
    pub fn stop_not_sent(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let Some(stop) = &mut self.stop else { return };
        stop.not_sent = true;
        if !stop.from_rest || stop.has_left() {
            self.becomes_unreachable(now, false, out);
        }
    }

    /// Nothing is known of the motor any more, a locked brake included: all of the stop begins
    /// again.
    fn becomes_unreachable(&mut self, now: Instant, stop_transmitted: bool, out: &mut Outbox<'_>) {
        let Some(stop) = &mut self.stop else { return };
        stop.hold_poll = None;
        stop.braked = false;
        stop.acknowledged = false;
        stop.go(now, Phase::Command);
        if core::mem::replace(&mut stop.unreachable, true) {
            return;
        }
        if self.state == AxisState::Stopping {
            self.trip(now, TripReason::StopUnconfirmed, out);
        }
        if let Some(trip) = &mut self.trip {
            trip.unreachable = true;
        }
        self.no_longer_confirmed(now, out);
        out.event(&Event::AxisUnreachable { axis: self.index, stop_transmitted });
    }

    /// The stop of a tripped axis has to be confirmed anew, before anybody clears it.
    pub(super) fn no_longer_confirmed(&mut self, now: Instant, out: &mut Outbox<'_>) {
        self.fail(now, Error::StopNotConfirmed { axis: self.index }, out);
        self.enter(AxisState::Tripped { confirmed: false }, out);
    }

    /// A stop is asked for although one is under way or confirmed: it is sent again at once, and
    /// what is under way makes room.
    pub(in crate::axis) fn stop_again(&mut self, now: Instant) {
        let is_stop = self.pending.as_ref().is_some_and(|pending| pending.exchange.is_stop());
        if self.stop.as_mut().is_some_and(|stop| stop.ask_again(now)) && !is_stop {
            self.displace();
        }
    }

    /// Notices a stop that does not bring the motor to rest.
    pub(in crate::axis) fn expire_stop(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if self.stop.as_ref().is_some_and(|stop| stop.is_overdue(now)) {
            self.displace();
            self.rest(now, out);
        }
    }
}
