//! The stop: sent first, sent again until the motor has confirmed it, and repeated while the axis
//! is tripped (GUARANTEES G4).

mod confirm;
mod unreachable;

use super::AxisConfig;
use crate::protocol::Exchange;
use crate::time::{Duration, Instant};

/// Every stop is sent at least this often.
const STOPS_AT_LEAST: u8 = 2;
/// Speed readings below the threshold that make a standstill.
const STANDSTILL_READINGS: u8 = 2;
/// Pause between the readings of a motor that is slowing down.
const CONFIRM_POLL: Duration = Duration::from_millis(5);
/// How often the stop is sent again while the motor has not confirmed it.
const UNCONFIRMED_REPEAT: Duration = Duration::from_millis(50);
/// Pause before a stop that was refused is sent again.
const REFUSED_PAUSE: Duration = Duration::from_millis(20);
/// A stop that has not led to standstill for so long has failed, although the motor answers it.
const STANDSTILL_WITHIN: Duration = Duration::from_millis(5_000);
/// The same for a motor that did not come to rest before and has been left alone since.
const STANDSTILL_WITHIN_ANEW: Duration = Duration::from_millis(2_000);
/// Between two stop commands that hosts ask for; what is asked for more often must not keep the
/// speed from being read.
const ASKED_AGAIN: Duration = Duration::from_millis(10);
/// How long the brake waits for standstill (GUARANTEES G4, stop table).
const BRAKE_WAIT: Duration = Duration::from_millis(1_000);
/// A brake that does not show it counts as locked so long after it was told (GUARANTEES G4, stop
/// table).
const BRAKE_LOCKS_WITHIN: Duration = Duration::from_millis(1_000);

/// Where a stop stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// The stop command is sent, at least twice, until it is acknowledged.
    Command,
    /// The motor refused it: the fault word is read before the next one.
    RefusedFaults,
    /// Then the speed.
    RefusedVelocity,
    /// The motor does not answer writes: the commanded speed is read back.
    ReadBack,
    /// A device with a position controller is stopped there too.
    PositionStop,
    /// Whether an asynchronous write waits.
    PendingWrite,
    /// It does: it is overwritten.
    OverwritePending,
    /// The speed is read until it is zero.
    Standstill,
    /// Brake: locked,
    LockBrake,
    /// seen to be locked,
    VerifyBrake,
    /// and the output switched off.
    OutputOff,
    /// The motor has confirmed the stop.
    Confirmed,
}

/// A stop under way, or confirmed and being repeated.
#[derive(Debug, Clone)]
pub(crate) struct Stop {
    phase: Phase,
    /// The trip or the request.
    since: Instant,
    /// It began at rest, where a stop is only to be sure.
    from_rest: bool,
    /// The hosts have been told that it is late to leave.
    delay_reported: bool,
    /// Stop commands that have left; counts to `STOPS_AT_LEAST`.
    sent: u8,
    /// When the first one had.
    first_left: Option<Instant>,
    /// When the latest one had.
    last_left: Option<Instant>,
    acknowledged: bool,
    standstill_readings: u8,
    /// Stop commands in a row that were not answered, or were refused.
    unconfirmed: u8,
    /// So many stops came to nothing, or the motor did not come to rest, and no stop has been
    /// confirmed since.
    unreachable: bool,
    /// An unreachable motor is left alone but for two stops between silences, until it answers one
    /// of them.
    resting: bool,
    /// The first of the two has gone.
    second_follows: bool,
    /// When the silence ends.
    rests_until: Instant,
    /// A host has had a stop sent in this silence; another one would keep the motor's own timeout
    /// from acting.
    asked_while_resting: bool,
    /// When a motor that answers and does not come to rest is given up.
    give_up_at: Instant,
    /// When the phase's next exchange is due.
    next_at: Instant,
    /// When the stop command is due again although the phase is another one.
    repeat_at: Instant,
    /// When the phase of reading the speed began.
    standstill_since: Instant,
    /// When something of the stop last went on: a frame had left, was answered, or was given up
    /// after it had left.
    went_on_at: Instant,
    /// A frame of it has waited for so long to leave that it counts as not sent, and waits still.
    not_sent: bool,
    /// The brake is locked and the output off.
    braked: bool,
    /// After a repeated stop the speed is read once, so that a coasting motor's standstill becomes
    /// known.
    read_after_repeat: bool,
    /// How often a motor that holds must hear something to go on holding.
    hold_poll: Option<Duration>,
}

impl Stop {
    pub fn new(now: Instant, from_rest: bool) -> Self {
        Self {
            phase: Phase::Command,
            since: now,
            from_rest,
            delay_reported: false,
            sent: 0,
            first_left: None,
            last_left: None,
            acknowledged: false,
            standstill_readings: 0,
            unconfirmed: 0,
            unreachable: false,
            resting: false,
            second_follows: false,
            rests_until: now,
            asked_while_resting: false,
            give_up_at: now + STANDSTILL_WITHIN,
            next_at: now,
            repeat_at: now + UNCONFIRMED_REPEAT,
            standstill_since: now,
            went_on_at: now,
            not_sent: false,
            braked: false,
            read_after_repeat: false,
            hold_poll: None,
        }
    }

    pub fn since(&self) -> Instant {
        self.since
    }

    pub fn is_from_rest(&self) -> bool {
        self.from_rest
    }

    pub fn delay_is_reported(&self) -> bool {
        self.delay_reported
    }

    pub fn report_delay(&mut self) {
        self.delay_reported = true;
    }

    /// No stop command had left at `at`.
    pub fn had_not_left(&self, at: Instant) -> bool {
        self.first_left.is_none_or(|left| left >= at)
    }

    /// A stop command has left on the bus.
    pub fn has_left(&self) -> bool {
        self.first_left.is_some()
    }

    pub fn is_acknowledged(&self) -> bool {
        self.acknowledged
    }

    /// A stop is asked for again: the stop command goes out now, or soon if one has just left.
    /// Returns whether it does now.
    fn ask_again(&mut self, now: Instant) -> bool {
        let just_left = self.last_left.map(|left| left + ASKED_AGAIN).filter(|at| *at > now);
        if !self.has_left() || !self.repeats() || (self.resting && self.asked_while_resting) {
            return false;
        }
        let at = just_left.unwrap_or(now);
        self.asked_while_resting = self.resting;
        self.repeat_at = self.repeat_at.min(at);
        // Before the next reading, too.
        self.next_at =
            if self.phase == Phase::Command { self.next_at.min(at) } else { self.next_at.max(at) };
        just_left.is_none()
    }

    /// What the stop wants next, and from when on.
    pub fn next(&self) -> Option<(Exchange, Instant)> {
        let of_phase = match self.phase {
            Phase::Command => return Some((self.command(), self.next_at)),
            Phase::RefusedFaults => Some(Exchange::Faults),
            Phase::RefusedVelocity | Phase::Standstill => Some(Exchange::Velocity),
            Phase::ReadBack => Some(Exchange::CommandedSpeed),
            Phase::PositionStop => Some(Exchange::PositionStop),
            Phase::PendingWrite => Some(Exchange::PendingWrite),
            Phase::OverwritePending => Some(Exchange::OverwritePending),
            Phase::LockBrake => Some(Exchange::LockBrake),
            Phase::VerifyBrake => Some(Exchange::Faults),
            Phase::OutputOff => Some(Exchange::OutputOff),
            Phase::Confirmed => {
                (self.read_after_repeat || self.hold_poll.is_some()).then_some(Exchange::Velocity)
            }
        };
        let repeat = self.repeats().then_some((self.command(), self.repeat_at));
        let of_phase = of_phase.map(|exchange| (exchange, self.next_at));
        match (repeat, of_phase) {
            (Some(repeat), Some(next)) => Some(if repeat.1 <= next.1 { repeat } else { next }),
            (repeat, next) => repeat.or(next),
        }
    }

    /// What is repeated: behind a locked brake the stop command would switch the output on again.
    fn command(&self) -> Exchange {
        if self.braked { Exchange::OutputOff } else { Exchange::Stop }
    }

    /// The motor has not come to rest in good time.
    fn is_overdue(&self, now: Instant) -> bool {
        let hears_us = self.has_left() && !self.not_sent;
        self.phase != Phase::Confirmed && !self.resting && hears_us && self.give_up_at <= now
    }

    /// When a motor that answers and does not come to rest is given up.
    pub fn gives_up_at(&self) -> Option<Instant> {
        let turns =
            self.phase != Phase::Confirmed && !self.resting && self.has_left() && !self.not_sent;
        turns.then_some(self.give_up_at)
    }

    /// Since when a frame of the stop should have left, while it is neither confirmed nor known as
    /// one that could not be sent.
    fn unsent_since(&self) -> Option<Instant> {
        if self.phase == Phase::Confirmed || self.unreachable || self.not_sent {
            return None;
        }
        if !self.has_left() {
            return Some(self.since);
        }
        let repeat_at = self.went_on_at + UNCONFIRMED_REPEAT;
        // While the brake locks unseen there is nothing to send.
        Some(if self.repeats() { repeat_at } else { repeat_at.max(self.next_at) })
    }

    /// It has waited for so long that it counts as not sent, and waits still.
    pub fn is_not_sent(&self) -> bool {
        self.not_sent
    }

    /// Once the brake is being locked the stop command would switch the output on again.
    fn repeats(&self) -> bool {
        !matches!(self.phase, Phase::LockBrake | Phase::VerifyBrake | Phase::OutputOff)
    }

    /// The bus has taken an exchange of the stop.
    pub fn handed(&mut self, now: Instant, exchange: Exchange, config: &AxisConfig) {
        let repeat =
            if self.phase == Phase::Confirmed { config.stop_repeat() } else { UNCONFIRMED_REPEAT };
        match exchange {
            Exchange::OutputOff if self.phase != Phase::OutputOff => {
                self.repeat_at = now + repeat;
                self.read_after_repeat = self.phase == Phase::Confirmed;
            }
            Exchange::Stop => {
                self.repeat_at = now + repeat;
                self.next_at = now;
                if self.resting {
                    self.asked_while_resting &= self.second_follows || now < self.rests_until;
                }
                self.read_after_repeat = self.phase == Phase::Confirmed;
            }
            Exchange::Velocity => {
                self.next_at = now + self.hold_poll.unwrap_or(CONFIRM_POLL);
                self.read_after_repeat = false;
            }
            _ => self.next_at = now,
        }
    }

    /// The bus has given an exchange of the stop back: it has not left.
    pub fn given_back(&mut self, now: Instant, exchange: Exchange) {
        if exchange == self.command() && self.phase != Phase::Command && self.repeats() {
            self.repeat_at = now;
        } else {
            self.next_at = self.next_at.min(now);
        }
    }

    /// A frame of the stop has left. An unreachable motor hears nothing for `silence` after two
    /// stops: whatever we send may be feeding its own timeout (GUARANTEES G4).
    pub fn left(&mut self, now: Instant, exchange: Exchange, silence: Duration) {
        self.went_on_at = now;
        if core::mem::take(&mut self.not_sent) {
            self.give_up_at = now + STANDSTILL_WITHIN;
        }
        if exchange != Exchange::Stop {
            return;
        }
        self.sent = self.sent.saturating_add(1);
        self.first_left.get_or_insert(now);
        self.last_left = Some(now);
        if self.resting {
            self.second_follows = !self.second_follows;
            self.rests_until = if self.second_follows { now } else { now + silence };
            self.next_at = self.rests_until;
        }
    }

    fn go(&mut self, now: Instant, phase: Phase) {
        self.phase = phase;
        self.next_at =
            if phase == Phase::Command && self.resting { now.max(self.rests_until) } else { now };
        if phase == Phase::Standstill {
            self.standstill_since = now;
            self.standstill_readings = 0;
        }
    }
}
