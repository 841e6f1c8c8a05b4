//! What the motor's answers do to a stop: acknowledged, at rest, confirmed (GUARANTEES G4).

use super::{
    BRAKE_LOCKS_WITHIN, BRAKE_WAIT, Phase, REFUSED_PAUSE, STANDSTILL_READINGS,
    STANDSTILL_WITHIN_ANEW, STOPS_AT_LEAST, Stop,
};
use crate::axis::exchanges::Pending;
use crate::axis::{Axis, Observation};
use crate::outbox::Outbox;
use crate::protocol::{self, Exchange};
use crate::time::Instant;
use host_protocol::{AxisState, Event, StopAction};

impl Axis {
    pub(in crate::axis) fn stop_answered(
        &mut self,
        now: Instant,
        pending: &Pending,
        seen: &Observation,
        out: &mut Outbox<'_>,
    ) {
        let verifies_brake = self.config.verifies_brake();
        let Some(stop) = &mut self.stop else { return };
        stop.went_on_at = now;
        let answered = protocol::is_answered(&pending.command, &self.config);
        if answered && matches!(pending.exchange, Exchange::Stop | Exchange::CommandedSpeed) {
            stop.unconfirmed = 0;
        }
        if answered && core::mem::take(&mut stop.resting) {
            stop.give_up_at = now + STANDSTILL_WITHIN_ANEW;
        }
        match (stop.phase, pending.exchange) {
            (Phase::Command, Exchange::Stop) => {
                if answered {
                    stop.acknowledged |= pending.unambiguous;
                    self.command_sent(now);
                } else {
                    stop.go(now, Phase::ReadBack);
                }
            }
            (Phase::ReadBack, Exchange::CommandedSpeed) => {
                stop.acknowledged |= pending.unambiguous && seen.commanded_zero == Some(true);
                stop.go(now, Phase::Command);
                self.command_sent(now);
            }
            (Phase::RefusedFaults, Exchange::Faults) => stop.go(now, Phase::RefusedVelocity),
            (Phase::RefusedVelocity, Exchange::Velocity) => {
                stop.go(now, Phase::Command);
                stop.next_at = now + REFUSED_PAUSE;
            }
            (Phase::OverwritePending, Exchange::OverwritePending) if !stop.acknowledged => {
                stop.go(now, Phase::Command);
            }
            (Phase::PositionStop, Exchange::PositionStop)
            | (Phase::OverwritePending, Exchange::OverwritePending) => self.seek_standstill(now),
            (Phase::PendingWrite, Exchange::PendingWrite) => match seen.write_pending {
                Some(true) => stop.go(now, Phase::OverwritePending),
                _ => self.seek_standstill(now),
            },
            (Phase::Standstill, Exchange::Velocity) => self.speed_read(now, seen),
            (Phase::LockBrake, Exchange::LockBrake) => {
                stop.go(now, Phase::VerifyBrake);
                if !verifies_brake {
                    stop.next_at = now + BRAKE_LOCKS_WITHIN;
                }
            }
            (Phase::VerifyBrake, Exchange::Faults) if !verifies_brake => {
                stop.go(now, Phase::OutputOff);
                out.event(&Event::BrakeUnverified { axis: self.index, locked: true });
            }
            (Phase::VerifyBrake, Exchange::Faults) if seen.brake_locked == Some(true) => {
                stop.go(now, Phase::OutputOff);
            }
            (Phase::VerifyBrake, Exchange::Faults) => {
                stop.go(now, Phase::LockBrake);
                stop.next_at = now + REFUSED_PAUSE;
                self.count_unconfirmed(now, out);
            }
            (Phase::OutputOff, Exchange::OutputOff) => {
                stop.braked = true;
                stop.go(now, Phase::Standstill);
            }
            (Phase::Confirmed, Exchange::Velocity) => self.watch_confirmed(now, seen, out),
            _ => {}
        }
        self.settle_stop(now, out);
    }

    /// The motor refuses what the stop asks of it: that confirms nothing. Read the fault and the
    /// speed, and send the stop again.
    pub(in crate::axis) fn stop_refused(
        &mut self,
        now: Instant,
        exchange: Exchange,
        out: &mut Outbox<'_>,
    ) {
        let Some(stop) = &mut self.stop else { return };
        match stop.phase {
            Phase::Confirmed if exchange.is_stop() => {}
            // Somebody else's question.
            Phase::Confirmed => return,
            _ if exchange.is_stop() && !stop.resting => stop.go(now, Phase::RefusedFaults),
            Phase::RefusedFaults | Phase::RefusedVelocity | Phase::ReadBack => {
                stop.go(now, Phase::Command)
            }
            _ => {}
        }
        if !stop.resting && !exchange.is_stop() {
            stop.next_at = now + REFUSED_PAUSE;
        }
        // A speed that cannot be read is made up for by the stop command, which is repeated.
        if exchange != Exchange::Velocity {
            self.count_unconfirmed(now, out);
        }
    }

    /// A request that had left was not answered.
    pub(in crate::axis) fn stop_unanswered(
        &mut self,
        now: Instant,
        exchange: Exchange,
        out: &mut Outbox<'_>,
    ) {
        let restarts = self.is_restarting();
        let may_wait = protocol::command(Exchange::OverwritePending, &self.config).is_some();
        let Some(stop) = &mut self.stop else { return };
        stop.went_on_at = now;
        // A motor that restarts misses stops, and its output is off.
        if restarts && stop.phase == Phase::Confirmed {
            return;
        }
        match stop.phase {
            // Nothing of these is needed for the stop itself, and confirmed it is already.
            Phase::Confirmed => {}
            // A motor that hears and does not answer may keep a speed that waits, for anybody's 05:
            // that is overwritten unasked.
            Phase::Command | Phase::ReadBack | Phase::PendingWrite if may_wait => {
                stop.go(now, Phase::OverwritePending);
            }
            Phase::OverwritePending if !stop.acknowledged => {
                stop.go(now, Phase::Command);
                return;
            }
            Phase::RefusedFaults | Phase::RefusedVelocity | Phase::ReadBack => {
                stop.go(now, Phase::Command)
            }
            // Past the wait the brake is locked even if the speed cannot be read.
            Phase::Standstill => self.lock_when_overdue(now),
            _ => {}
        }
        // A poll that is lost while the speed is read is made up for by the stop command, which is
        // repeated.
        if self.job_exchange() != Some(exchange) && exchange != Exchange::Velocity {
            self.count_unconfirmed(now, out);
        }
    }

    /// Past the last stop command of the first phase: on to what confirms it.
    fn command_sent(&mut self, now: Instant) {
        let steps = protocol::stop_steps(&self.config);
        let has = |step: &Exchange| protocol::command(*step, &self.config).is_some();
        let Some(stop) = &mut self.stop else { return };
        if !stop.acknowledged || stop.sent < STOPS_AT_LEAST {
            return;
        }
        let next = steps.iter().filter(|step| has(step)).find_map(|step| match step {
            Exchange::PositionStop => Some(Phase::PositionStop),
            Exchange::PendingWrite => Some(Phase::PendingWrite),
            Exchange::Velocity => Some(Phase::Standstill),
            _ => None,
        });
        stop.go(now, next.unwrap_or(Phase::Confirmed));
    }

    /// A coasting motor has confirmed with its acknowledgement; the others must stand still.
    fn seek_standstill(&mut self, now: Instant) {
        let coasts = self.config.stop_action() == Some(StopAction::Coast);
        if let Some(stop) = &mut self.stop {
            stop.go(now, if coasts { Phase::Confirmed } else { Phase::Standstill });
        }
    }

    fn speed_read(&mut self, now: Instant, seen: &Observation) {
        let still = seen.velocity_rad_s.is_some_and(|velocity| self.is_standstill(velocity));
        let brakes = self.config.stop_action() == Some(StopAction::Brake);
        let Some(stop) = &mut self.stop else { return };
        stop.standstill_readings = if still { stop.standstill_readings + 1 } else { 0 };
        if stop.standstill_readings >= STANDSTILL_READINGS {
            stop.go(now, if brakes && !stop.braked { Phase::LockBrake } else { Phase::Confirmed });
        } else {
            self.lock_when_overdue(now);
        }
    }

    /// A speed that came late. Whatever it answered, it does not show standstill, but it can show
    /// that there is none.
    pub(in crate::axis) fn late_speed(&mut self, seen: &Observation) {
        let turns = seen.velocity_rad_s.is_some_and(|velocity| !self.is_standstill(velocity));
        if let Some(stop) = self.stop.as_mut().filter(|_| turns) {
            stop.standstill_readings = 0;
        }
    }

    fn lock_when_overdue(&mut self, now: Instant) {
        let brakes = self.config.stop_action() == Some(StopAction::Brake);
        if let Some(stop) = &mut self.stop
            && brakes
            && !stop.braked
            && now.since(stop.standstill_since) >= BRAKE_WAIT
        {
            stop.go(now, Phase::LockBrake);
        }
    }

    /// A confirmed stop is watched: a motor that turns again is not stopped, and the stop begins
    /// anew.
    fn watch_confirmed(&mut self, now: Instant, seen: &Observation, out: &mut Outbox<'_>) {
        let turns = seen.velocity_rad_s.is_some_and(|velocity| !self.is_standstill(velocity));
        if turns && self.must_stand() && matches!(self.state, AxisState::Tripped { .. }) {
            self.stop = Some(Stop::new(now, false));
            self.no_longer_confirmed(now, out);
        }
    }

    /// Reports a stop that has just been confirmed: a stopped axis is idle or holds, a tripped one
    /// stays tripped.
    fn settle_stop(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let Some(stop) = &self.stop else { return };
        let settled =
            matches!(self.state, AxisState::Stopping | AxisState::Tripped { confirmed: false });
        if stop.phase != Phase::Confirmed || !settled {
            return;
        }
        if let Some(trip) = &mut self.trip {
            trip.unreachable = false;
        }
        let first_left = stop.first_left.unwrap_or(now);
        out.event(&Event::StopConfirmed {
            axis: self.index,
            reaction_us: first_left.since(stop.since).as_micros_u32(),
            elapsed_us: now.since(stop.since).as_micros_u32(),
            standstill: self.standstill(),
        });
        if self.state == AxisState::Stopping {
            self.stop = None;
            self.enter_rest(now, self.holds_after_stop(), out);
        } else {
            let repeat_at = now + self.config.stop_repeat();
            let hold_poll = self.must_hold().then(|| self.refresh());
            if let Some(stop) = &mut self.stop {
                stop.unreachable = false;
                stop.repeat_at = repeat_at;
                stop.hold_poll = hold_poll;
            }
            self.enter(AxisState::Tripped { confirmed: true }, out);
        }
    }
}
