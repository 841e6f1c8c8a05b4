//! What answers, silence and time do to the stop of an axis: confirmed, watched, given up
//! (GUARANTEES G4).

use super::state::State;
use super::stop::StopEffect;
use super::{Axis, Stop};
use crate::measured::Observation;
use crate::outbox::Outbox;
use crate::protocol::{Exchange, Outcome};
use crate::time::Instant;
use crate::transaction::Transaction;
use host_protocol::{AxisState, Error, Event, TripReason};

impl Axis {
    /// A request has ended while there is a stop; `seen`: what its answer tells.
    pub(super) fn stop_goes_on(
        &mut self,
        now: Instant,
        request: &Transaction,
        outcome: Outcome,
        seen: &Observation,
        out: &mut Outbox<'_>,
    ) {
        let still = self.still(seen);
        let is_of_job = self.job_step() == Some(request.exchange);
        let restarts = now < self.restarts_until;
        let before = self.state();
        let Self { state: State::Stopping(stop) | State::Tripped(_, stop), config, .. } = self
        else {
            return;
        };
        let was_confirmed = stop.is_confirmed();
        stop.request_over(request.exchange);
        let effect = match outcome {
            Outcome::Answered => stop.answered(now, request, seen, still, config),
            Outcome::Refused => stop.refused(now, request.exchange, config),
            // A motor that restarts misses stops, and its output is off.
            Outcome::NoReply if restarts && was_confirmed => StopEffect::None,
            Outcome::NoReply => stop.unanswered(now, request.exchange, is_of_job, config),
            Outcome::Echoed => StopEffect::None,
        };
        if before == AxisState::Stopping {
            // At rest it would be forgotten.
            stop.stays_while_owed(config);
        }
        let is_confirmed = stop.is_confirmed();
        match effect {
            StopEffect::None => {}
            StopEffect::CameToNothing if restarts => {
                if let Some(stop) = self.stop_mut() {
                    stop.goes_unheard();
                }
            }
            StopEffect::CameToNothing => self.count_unconfirmed(now, out),
            StopEffect::BrakeUnverified => {
                out.event(&Event::BrakeUnverified { axis: self.index, locked: true });
            }
        }
        if is_confirmed && !was_confirmed {
            self.stop_confirmed(now, before, out);
        } else if was_confirmed && request.exchange == Exchange::Velocity {
            match (still, self.stop_mut()) {
                (Some(false), _) => self.turns_again(now, out),
                (Some(true), Some(stop)) => stop.stands(),
                _ => {}
            }
        }
    }

    /// A confirmed stop is watched: a motor that turns again is not stopped, and the stop begins
    /// anew. One that may coast is left to its own timeout after a while.
    fn turns_again(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if !self.must_stand() {
            let timeout = self.programmed_timeout();
            if let (Some(timeout), Some(stop)) = (timeout, self.stop_mut()) {
                stop.coasts_on(now, timeout.and_a_half());
            }
            return;
        }
        self.stop_anew(now, out);
    }

    /// The confirmed stop of a tripped axis begins anew: what is under way makes room, but for a
    /// stop that has still to leave.
    fn stop_anew(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let before = self.state();
        if let State::Tripped(_, stop) = &mut self.state {
            *stop = Stop::new(now, false, &self.config);
            self.transactions.preempt_all_but_a_stop();
            self.no_longer_confirmed(now, before, out);
        }
    }

    /// Whether the motor holds, as far as is known, and needs to hear something for it.
    pub(super) fn is_held(&self) -> bool {
        let is_confirmed = self.stop().is_some_and(Stop::is_confirmed);
        self.is_kept_holding() || self.must_hold() && is_confirmed
    }

    /// Its own timeout may have cut the output since: it is told to hold again, and a stop under
    /// way confirms nothing by what it was told before.
    pub(super) fn hold_again(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if self.is_kept_holding() {
            self.halt(now, out);
        } else if self.is_held() {
            self.stop_anew(now, out);
        } else if let Some(stop) = self.stop_mut() {
            stop.missed();
        }
    }

    /// The motor has confirmed the stop: a stopped axis is idle or holds, a tripped one stays
    /// tripped.
    fn stop_confirmed(&mut self, now: Instant, before: AxisState, out: &mut Outbox<'_>) {
        let standstill = self.standstill();
        let repeat_at = now + self.config.stop_repeat();
        let hold_poll = self.must_hold().then(|| self.refresh());
        let Some(stop) = self.stop_mut() else { return };
        stop.goes_on_confirmed(repeat_at, hold_poll);
        let reaction_us = stop.reaction(now).as_micros_u32();
        let elapsed_us = now.since(stop.since).as_micros_u32();
        let axis = self.index;
        out.event(&Event::StopConfirmed { axis, reaction_us, elapsed_us, standstill });
        if matches!(self.state, State::Stopping(_)) {
            self.enter_rest(now, self.holds_after_stop(), out);
        } else {
            self.tell_state(before, out);
        }
    }

    /// A stop came to nothing. After so many of them the motor counts as unreachable (GUARANTEES
    /// G4).
    fn count_unconfirmed(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let enough = self.config.stops_before_unreachable();
        if self.stop_mut().is_some_and(|stop| stop.count_unconfirmed(now, enough)) {
            self.rest(now, out);
        }
    }

    /// The motor is unreachable: from now on it is sent two stops between silences.
    pub(super) fn rest(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let silence = self.unreachable_silence();
        if let Some(stop) = self.stop_mut() {
            stop.rest(now, silence);
        }
        self.becomes_unreachable(now, true, out);
    }

    /// Since when the stop has a frame to send that has not left, where nobody has been told of
    /// that.
    pub fn unsent_stop_since(&self) -> Option<Instant> {
        let stop = self.stop()?;
        if self.transactions.is_awaited() {
            return None;
        }
        let since = stop.unsent_since()?;
        Some(if stop.has_left() { self.transactions.not_before(false, since) } else { since })
    }

    /// The stop has not left for too long: it is not counted as sent, and stays owed. An axis that
    /// was at rest waits for it; of any other the motor may be turning.
    pub fn stop_not_sent(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let Some(stop) = self.stop_mut() else { return };
        stop.not_sent = true;
        if !stop.from_rest || stop.has_left() {
            self.becomes_unreachable(now, false, out);
        }
    }

    fn becomes_unreachable(&mut self, now: Instant, stop_transmitted: bool, out: &mut Outbox<'_>) {
        let before = self.state();
        if !self.stop_mut().is_some_and(|stop| stop.lose_motor(now)) {
            return;
        }
        self.trip(now, TripReason::StopUnconfirmed, out);
        self.no_longer_confirmed(now, before, out);
        out.event(&Event::AxisUnreachable { axis: self.index, stop_transmitted });
    }

    /// The stop of a tripped axis has to be confirmed anew, before anybody clears it.
    fn no_longer_confirmed(&mut self, now: Instant, before: AxisState, out: &mut Outbox<'_>) {
        self.fail(now, Error::StopNotConfirmed { axis: self.index }, out);
        if matches!(before, AxisState::Tripped { .. }) {
            self.tell_state(before, out);
        }
    }

    /// A speed that came late. Whatever it answered, it does not show standstill, but it can show
    /// that there is none.
    pub(super) fn late_speed(&mut self, seen: &Observation) {
        if self.still(seen) == Some(false)
            && let Some(stop) = self.stop_mut()
        {
            stop.standstill_readings = 0;
        }
    }

    /// Notices a stop that does not bring the motor to rest.
    pub(super) fn expire_stop(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if self.stop().and_then(Stop::gives_up_at).is_some_and(|at| at <= now) {
            self.transactions.preempt_all_but_a_stop();
            self.rest(now, out);
        }
    }

    /// When a stop command of the axis is due that the bus has not taken yet.
    pub fn stop_due_at(&self) -> Option<Instant> {
        let next = self.stop().filter(|_| self.transactions.is_idle())?.next();
        next.filter(|(exchange, _)| exchange.is_stop()).map(|(_, at)| at)
    }

    /// The stop that has not left has been reported.
    pub fn stop_reported(&mut self) {
        if let Some(stop) = self.stop_mut() {
            stop.delay_reported = true;
        }
    }
}
