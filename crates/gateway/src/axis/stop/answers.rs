//! What a motor's answers, refusals and silences make of a stop.

use super::{BRAKE_LOCKS_WITHIN, BRAKE_POLL, BRAKE_WAIT, Backoff, CONFIRM_POLL, Detour};
use super::{REFUSED_PAUSE, STANDSTILL_READINGS, STANDSTILL_WITHIN_ANEW, STOPS_AT_LEAST};
use super::{Stop, ends_moves};
use crate::config::AxisConfig;
use crate::measured::Observation;
use crate::protocol::{self, Exchange};
use crate::time::Instant;
use crate::transaction::Transaction;

/// What an answer to a stop means beyond its next step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::axis) enum StopEffect {
    None,
    /// It has come to nothing, once more.
    CameToNothing,
    /// The brake is taken for locked, unseen.
    BrakeUnverified,
}

impl Stop {
    /// A request has been answered, or needs no answer. `still`: whether the speed in the answer is
    /// standstill, where it has one.
    pub(in crate::axis) fn answered(
        &mut self,
        now: Instant,
        request: &Transaction,
        seen: &Observation,
        still: Option<bool>,
        config: &AxisConfig,
    ) -> StopEffect {
        self.went_on_at = now;
        let exchange = request.exchange;
        let not_taken = self.step() == Some(exchange)
            && request.unambiguous
            && seen.commanded_zero == Some(false);
        let answered = protocol::is_answered(&request.command, config);
        self.hears |= answered;
        self.refuses &= exchange != Exchange::Stop;
        if answered && !not_taken {
            if matches!(exchange, Exchange::Stop | Exchange::CommandedSpeed) {
                self.unconfirmed = 0;
            }
            if self.is_resting() {
                self.backoff = Backoff::None;
                self.give_up_at = now + STANDSTILL_WITHIN_ANEW;
            }
        }
        if self.step() != Some(exchange) {
            return StopEffect::None;
        }
        match (self.detour, exchange) {
            (Detour::None, Exchange::Stop) if answered => {
                self.acknowledged |= request.unambiguous;
                self.command_answered(now, config);
            }
            (Detour::None, Exchange::Stop) => self.turn_aside(now, Detour::ReadBack),
            (Detour::None, Exchange::PendingWrite) if seen.write_pending == Some(true) => {
                self.turn_aside(now, Detour::Overwrite);
            }
            (Detour::None, Exchange::Velocity) => self.speed_read(now, still, config),
            (Detour::None, Exchange::Faults)
                if !config.verifies_brake() && now.since(self.step_since) < BRAKE_LOCKS_WITHIN =>
            {
                self.next_at = now + BRAKE_POLL;
            }
            (Detour::None, Exchange::Faults) if !config.verifies_brake() => {
                self.advance(now, config);
                return StopEffect::BrakeUnverified;
            }
            // The stop holds the motor, until the brake does.
            (Detour::None, Exchange::Faults) if seen.brake_locked != Some(true) => {
                self.command_again_after_a_pause(now);
                return StopEffect::CameToNothing;
            }
            // It may be the answer to another one.
            (Detour::None, Exchange::PositionStop) if !request.unambiguous => {
                self.next_at = now + CONFIRM_POLL;
            }
            (Detour::None, _) => self.advance(now, config),
            (Detour::ReadFaults, _) => self.turn_aside(now, Detour::ReadVelocity),
            (Detour::ReadVelocity, _)
                if ends_moves(config) && self.sequence.step() == Some(Exchange::Stop) =>
            {
                self.turn_aside(now, Detour::EndMove);
            }
            (Detour::ReadVelocity | Detour::EndMove, _) => self.command_again_after_a_pause(now),
            (Detour::ReadBack, _) => {
                self.acknowledged |= request.unambiguous && seen.commanded_zero == Some(true);
                if not_taken {
                    return self.not_taken(now);
                }
                self.command_again(now);
                self.command_answered(now, config);
            }
            (Detour::Overwrite, _) if !self.acknowledged => self.command_again(now),
            (Detour::Overwrite, _) => {
                self.detour = Detour::None;
                self.sequence.pass_over(|step| step != Exchange::Velocity);
                self.begin_step(now);
            }
        }
        StopEffect::None
    }

    /// What was read back shows that the motor has not taken the stop: as with a refusal. The
    /// first stop may have been lost, so the second one does not wait.
    fn not_taken(&mut self, now: Instant) -> StopEffect {
        if self.sent < STOPS_AT_LEAST || self.is_resting() {
            self.command_again(now);
        } else {
            self.turn_aside(now, Detour::ReadFaults);
        }
        StopEffect::CameToNothing
    }

    /// The motor refuses what the stop asks of it: that confirms nothing. Read the fault and the
    /// speed, and send the stop again.
    pub(in crate::axis) fn refused(
        &mut self,
        now: Instant,
        exchange: Exchange,
        config: &AxisConfig,
    ) -> StopEffect {
        self.hears = true;
        self.refuses |= exchange == Exchange::Stop;
        if self.is_confirmed() {
            // Or a host's question is refused.
            if !exchange.is_stop() {
                return StopEffect::None;
            }
        } else if self.detour == Detour::EndMove {
            self.command_again_after_a_pause(now);
            return StopEffect::None;
        } else if exchange.is_stop() && !self.is_resting() {
            self.turn_aside(now, Detour::ReadFaults);
        } else if exchange == Exchange::Stop && ends_moves(config) {
            self.turn_aside(now, Detour::EndMove);
        } else if matches!(
            self.detour,
            Detour::ReadFaults | Detour::ReadVelocity | Detour::ReadBack
        ) {
            self.command_again(now);
        }
        if !self.is_resting() && !exchange.is_stop() {
            self.next_at = now + REFUSED_PAUSE;
        }
        came_to_nothing_by(exchange)
    }

    /// A request that had left was not answered. `is_of_job`: it was asked for by a host as well.
    pub(in crate::axis) fn unanswered(
        &mut self,
        now: Instant,
        exchange: Exchange,
        is_of_job: bool,
        config: &AxisConfig,
    ) -> StopEffect {
        self.went_on_at = now;
        // With the first stop that comes to nothing it has to be heard anew.
        self.hears &= self.unconfirmed > 0 || exchange == Exchange::Velocity;
        let may_wait = protocol::is_served(Exchange::OverwritePending, config);
        match (self.detour, self.sequence.step()) {
            // A motor that hears and does not answer may keep a speed that waits, for anybody's 05:
            // that is overwritten unasked.
            (Detour::None, Some(Exchange::Stop | Exchange::PendingWrite))
            | (Detour::ReadBack, _)
                if may_wait =>
            {
                self.turn_aside(now, Detour::Overwrite);
            }
            (Detour::Overwrite, _) if !self.acknowledged => {
                self.command_again(now);
                return StopEffect::None;
            }
            (Detour::None, Some(Exchange::Stop)) if ends_moves(config) => {
                self.turn_aside(now, Detour::EndMove);
            }
            (Detour::EndMove, _) => {
                self.command_again(now);
                return StopEffect::None;
            }
            (Detour::ReadFaults | Detour::ReadVelocity | Detour::ReadBack, _) => {
                self.command_again(now);
            }
            // It holds by the stop, which it has to hear from time to time, until the brake does.
            (Detour::None, Some(Exchange::LockBrake)) => self.command_again(now),
            (Detour::None, Some(Exchange::Faults)) if config.verifies_brake() => {
                self.command_again(now);
            }
            // Past the wait the brake is locked even if the speed cannot be read.
            (Detour::None, Some(Exchange::Velocity)) => self.lock_when_overdue(now, config),
            // What is not needed for the stop itself, or confirmed already.
            _ => {}
        }
        if exchange == Exchange::Stop && !self.is_confirmed() {
            self.missed();
        }
        if is_of_job { StopEffect::None } else { came_to_nothing_by(exchange) }
    }

    /// The motor has not answered a stop command, or was not heard for its own timeout: it may have
    /// let go by that, answers the first command after it, and ignores it. It takes two again, and
    /// where it is to hold, what they led to is read anew.
    pub(in crate::axis) fn missed(&mut self) {
        self.sent = 0;
        let reads = self.sequence.step() == Some(Exchange::Velocity) && !self.is_braked();
        if reads && self.detour == Detour::None && !self.sequence.comes_again(Exchange::LockBrake) {
            self.acknowledged = false;
            self.sequence.restart();
        }
    }

    /// It came to nothing where that says nothing of the motor: it takes its turn from now on.
    pub(in crate::axis) fn goes_unheard(&mut self) {
        self.unconfirmed = self.unconfirmed.saturating_add(1).min(STOPS_AT_LEAST);
    }

    /// It came to nothing once more. Returns whether that makes `enough` for a motor that is not
    /// left alone yet.
    pub(in crate::axis) fn count_unconfirmed(&mut self, now: Instant, enough: u8) -> bool {
        self.went_on_at = now;
        self.unconfirmed = self.unconfirmed.saturating_add(1);
        self.unconfirmed >= enough && !self.is_resting()
    }

    /// Past the last stop command: on to what confirms it.
    /// One whose answers may be late ones to others is sent again, and leaves the line to others
    /// in between.
    fn command_answered(&mut self, now: Instant, config: &AxisConfig) {
        if self.sent < STOPS_AT_LEAST {
            return;
        }
        if self.acknowledged {
            self.advance(now, config);
        } else {
            self.next_at = self.next_at.max(now + CONFIRM_POLL);
        }
    }

    /// On to the stop command again, but not at once: the motor has refused something.
    fn command_again_after_a_pause(&mut self, now: Instant) {
        self.command_again(now);
        self.next_at = self.next_at.max(now + REFUSED_PAUSE);
    }

    fn speed_read(&mut self, now: Instant, still: Option<bool>, config: &AxisConfig) {
        let still = still == Some(true);
        self.standstill_readings = if still { self.standstill_readings + 1 } else { 0 };
        if self.standstill_readings >= STANDSTILL_READINGS {
            self.advance(now, config);
        } else {
            self.lock_when_overdue(now, config);
        }
    }

    fn lock_when_overdue(&mut self, now: Instant, config: &AxisConfig) {
        if self.sequence.step_behind() == Some(Exchange::LockBrake)
            && now.since(self.step_since) >= BRAKE_WAIT
        {
            self.advance(now, config);
        }
    }
}

/// A speed that cannot be read is made up for by the stop command, which is repeated.
fn came_to_nothing_by(exchange: Exchange) -> StopEffect {
    if exchange == Exchange::Velocity { StopEffect::None } else { StopEffect::CameToNothing }
}
