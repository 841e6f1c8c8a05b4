//! The stop: sent first, sent again until the motor has confirmed it, and repeated while the axis
//! is tripped (GUARANTEES G4). Its steps are those of the stop action's table.

mod answers;

pub(super) use answers::StopEffect;

use super::sequence::Sequence;
use crate::config::AxisConfig;
use crate::protocol::{self, Exchange};
use crate::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// Every stop is sent at least this often.
const STOPS_AT_LEAST: u8 = 2;
/// Speed readings below the threshold that make a standstill.
const STANDSTILL_READINGS: u8 = 2;
/// Pause between the readings of a motor that is slowing down, and between stops that are answered
/// without being proven.
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
/// How often what is asked for again puts off the end of a stop.
const STAYS_AT_MOST: u8 = 2;
/// How long the brake waits for standstill (GUARANTEES G4, stop table).
const BRAKE_WAIT: Duration = Duration::from_millis(1_000);
/// A brake that does not show it counts as locked so long after it was told (GUARANTEES G4, stop
/// table).
const BRAKE_LOCKS_WITHIN: Duration = Duration::from_millis(1_000);
/// How often the motor is asked meanwhile: one that hears nothing lets go by its own timeout.
const BRAKE_POLL: Duration = Duration::from_millis(20);

/// What a stop does between the steps of its table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Detour {
    /// Nothing: it goes through its table.
    None,
    /// The motor refused it: the fault word is read before the next one.
    ReadFaults,
    /// Then the speed.
    ReadVelocity,
    /// The motor does not answer writes: the commanded speed is read back.
    ReadBack,
    /// An asynchronous write waits in the motor, or may: it is overwritten.
    Overwrite,
    /// The stop command was not answered or refused: a device that moves to a position is told that
    /// this is over as well.
    EndMove,
}

/// A motor that turns on is left to its own timeout, which all that it hears may be feeding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Backoff {
    None,
    Silence {
        until: Instant,
        then: Then,
        /// A host has had a stop sent in this silence; another one would keep the own timeout of a
        /// motor that hears us from acting.
        asked: bool,
    },
}

/// What follows a silence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Then {
    /// The first of two stops: the motor is unreachable, until it answers one of them.
    First,
    /// The second one, without a silence between.
    Second,
    /// The stop that is repeated: the motor has confirmed that it coasts, and turns.
    Repeat,
}

/// A stop under way, or confirmed and being repeated.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Stop {
    sequence: Sequence,
    detour: Detour,
    /// A confirmed stop that is repeated: what ends a move to a position comes next.
    end_follows: bool,
    /// The trip or the request.
    pub since: Instant,
    /// It began at rest, where a stop is only to be sure.
    pub from_rest: bool,
    /// The hosts have been told that it is late to leave.
    pub delay_reported: bool,
    /// Stop commands that have left; counts to `STOPS_AT_LEAST`.
    sent: u8,
    /// When the first one had.
    first_left: Option<Instant>,
    /// When the latest command had, of [those that are repeated](Self::command).
    last_left: Option<Instant>,
    pub acknowledged: bool,
    pub(super) standstill_readings: u8,
    /// Stop commands in a row that were not answered, or were refused.
    unconfirmed: u8,
    /// The motor has answered something since the first of these: it hears us.
    pub hears: bool,
    /// It has refused the last one that it has answered.
    pub refuses: bool,
    /// So many stops came to nothing, or the motor did not come to rest, and no stop has been
    /// confirmed since.
    pub unreachable: bool,
    backoff: Backoff,
    /// When a motor that answers and does not come to rest is given up.
    give_up_at: Instant,
    /// When the next step is due.
    next_at: Instant,
    /// When the stop command is due again although the step is another one.
    repeat_at: Instant,
    /// When one is due that a host has asked for, or that was taken back: nothing but its leaving
    /// ends that.
    owed_at: Option<Instant>,
    /// That one takes its turn.
    takes_turn: bool,
    /// What follows the stop command has been put off for one that is owed: not again before it
    /// is over.
    put_off: bool,
    /// How often a step was done again for one that was asked for.
    stayed: u8,
    /// When its step began.
    step_since: Instant,
    /// When something of the stop last went on: a frame had left, was answered, or was given up
    /// after it had left.
    went_on_at: Instant,
    /// A frame of it has waited for so long to leave that it counts as not sent, and waits still.
    pub not_sent: bool,
    /// After a repeated stop the speed is read once, so that a coasting motor's standstill becomes
    /// known.
    read_after_repeat: bool,
    /// How often a motor that holds must hear something to go on holding.
    hold_poll: Option<Duration>,
}

impl Stop {
    /// Gives the stop its table again, which a snapshot leaves out.
    pub fn attach(&mut self, config: &AxisConfig) {
        self.sequence.attach(protocol::stop_steps(config));
    }

    pub fn new(now: Instant, from_rest: bool, config: &AxisConfig) -> Self {
        Self {
            sequence: Sequence::new(protocol::stop_steps(config)),
            detour: Detour::None,
            end_follows: false,
            since: now,
            from_rest,
            delay_reported: false,
            sent: 0,
            first_left: None,
            last_left: None,
            acknowledged: false,
            standstill_readings: 0,
            unconfirmed: 0,
            hears: false,
            refuses: false,
            unreachable: false,
            backoff: Backoff::None,
            give_up_at: now + STANDSTILL_WITHIN,
            next_at: now,
            repeat_at: now + UNCONFIRMED_REPEAT,
            owed_at: None,
            takes_turn: false,
            put_off: false,
            stayed: 0,
            step_since: now,
            went_on_at: now,
            not_sent: false,
            read_after_repeat: false,
            hold_poll: None,
        }
    }

    /// Since when no command of it has left, if that has not been reported.
    pub fn unreported_since(&self) -> Option<Instant> {
        (!self.has_left() && !self.delay_reported).then_some(self.since)
    }

    /// No stop command had left at `at`.
    pub fn had_not_left(&self, at: Instant) -> bool {
        self.first_left.is_none_or(|left| left >= at)
    }

    /// A stop command has left on the bus.
    pub fn has_left(&self) -> bool {
        self.first_left.is_some()
    }

    /// From the trip or the request until the first command had left.
    pub fn reaction(&self, now: Instant) -> Duration {
        self.first_left.unwrap_or(now).since(self.since)
    }

    /// The motor has confirmed it.
    pub fn is_confirmed(&self) -> bool {
        self.step().is_none()
    }

    /// The next stop command goes before all that is no stop: not where several were missed, nor
    /// where a host asks for it again and again.
    pub fn is_urgent(&self) -> bool {
        self.unconfirmed < STOPS_AT_LEAST && !self.takes_turn
    }

    fn is_resting(&self) -> bool {
        matches!(self.backoff, Backoff::Silence { then: Then::First | Then::Second, .. })
    }

    /// It is confirmed, its motor turns all the same, and is left to its own timeout.
    pub fn is_left_alone(&self, now: Instant) -> bool {
        let is_before = |until| now < until;
        matches!(self.backoff, Backoff::Silence { until, then: Then::Repeat, .. } if is_before(until))
    }

    fn step(&self) -> Option<Exchange> {
        match self.detour {
            Detour::None => self.sequence.step(),
            Detour::ReadFaults => Some(Exchange::Faults),
            Detour::ReadVelocity => Some(Exchange::Velocity),
            Detour::ReadBack => Some(Exchange::CommandedSpeed),
            Detour::Overwrite => Some(Exchange::OverwritePending),
            Detour::EndMove => Some(Exchange::PositionStop),
        }
    }

    /// What is repeated: behind a locked brake the stop command would switch the output on again.
    fn command(&self) -> Exchange {
        if self.is_braked() { Exchange::OutputOff } else { Exchange::Stop }
    }

    /// The brake is locked and the output off.
    fn is_braked(&self) -> bool {
        self.sequence.has_passed(Exchange::OutputOff)
    }

    /// Once the brake is being locked the stop command would switch the output on again.
    fn repeats(&self) -> bool {
        let locks =
            |step| matches!(step, Exchange::LockBrake | Exchange::Faults | Exchange::OutputOff);
        self.detour != Detour::None || !self.sequence.step().is_some_and(locks)
    }

    /// What the stop wants next, and from when on.
    pub fn next(&self) -> Option<(Exchange, Instant)> {
        let next = self.next_step();
        let goes_first = |at: &Instant| next.is_none_or(|(_, next)| *at <= next);
        let owed = self.owed_at.filter(|at| self.repeats() && goes_first(at));
        owed.map(|at| (self.command(), at)).or(next)
    }

    fn next_step(&self) -> Option<(Exchange, Instant)> {
        let step = match self.step() {
            Some(Exchange::Stop) => return Some((self.command(), self.next_at)),
            None if self.read_after_repeat || self.hold_poll.is_some() => Some(Exchange::Velocity),
            step => step,
        };
        let step = step.map(|exchange| (exchange, self.next_at));
        let repeated = if self.end_follows { Exchange::PositionStop } else { self.command() };
        let repeat = self.repeats().then_some((repeated, self.repeat_at));
        match (repeat, step) {
            (Some(repeat), Some(next)) => Some(if repeat.1 <= next.1 { repeat } else { next }),
            (repeat, next) => repeat.or(next),
        }
    }

    /// A stop is asked for again: the stop command goes out now, or soon if one has just left.
    /// Returns whether what is under way makes room for it.
    pub fn ask_again(&mut self, now: Instant, config: &AxisConfig) -> bool {
        if !self.has_left() {
            return false;
        }
        if !self.repeats() {
            return self.lock_again(now, config);
        }
        if self.hears
            && let Backoff::Silence { until, then, asked } = &mut self.backoff
            && (*then != Then::Repeat || now < *until)
            && core::mem::replace(asked, true)
        {
            return false;
        }
        let has_left_within = |time| self.last_left.map(|left| left + time).filter(|at| *at > now);
        let just_left = has_left_within(ASKED_AGAIN);
        if self.owed_at.is_none() {
            self.takes_turn = has_left_within(UNCONFIRMED_REPEAT).is_some();
        }
        let puts_off = self.owe(just_left.unwrap_or(now));
        puts_off && just_left.is_none()
    }

    /// A brake that does not show whether it has locked is told so once more; not for ever. Returns
    /// whether it is now. The stop command would switch the output on again.
    fn lock_again(&mut self, now: Instant, config: &AxisConfig) -> bool {
        let locks_unseen = self.step() == Some(Exchange::Faults) && !config.verifies_brake();
        let may = locks_unseen && self.stayed < STAYS_AT_MOST;
        if may {
            self.stayed += 1;
            self.sequence.step_back();
            self.begin_step(now);
        }
        may
    }

    /// The stop command goes out once more at `at`, before the next reading. Returns whether a
    /// reading under way is put off for it.
    fn owe(&mut self, at: Instant) -> bool {
        self.owed_at = Some(self.owed_at.map_or(at, |owed| owed.min(at)));
        if self.step() == Some(Exchange::Stop) {
            return true;
        }
        let puts_off = !core::mem::replace(&mut self.put_off, true);
        if puts_off {
            self.next_at = self.next_at.max(at);
        }
        puts_off
    }

    /// A request has ended while there is a stop: behind a reading the next one may be put off.
    pub(super) fn request_over(&mut self, exchange: Exchange) {
        self.put_off &= exchange.is_stop();
    }

    /// When a motor that answers and does not come to rest is given up.
    pub fn gives_up_at(&self) -> Option<Instant> {
        let hears_us = self.has_left() && !self.not_sent;
        (hears_us && !self.is_confirmed() && !self.is_resting()).then_some(self.give_up_at)
    }

    /// Since when a frame of the stop should have left, while it is neither confirmed nor known as
    /// one that could not be sent.
    pub fn unsent_since(&self) -> Option<Instant> {
        if self.is_confirmed() || self.unreachable || self.not_sent {
            return None;
        }
        if !self.has_left() {
            return Some(self.since);
        }
        let repeat_at = self.went_on_at + UNCONFIRMED_REPEAT;
        Some(repeat_at)
    }

    /// The bus has taken an exchange of the stop.
    pub fn handed(&mut self, now: Instant, exchange: Exchange, config: &AxisConfig) {
        if exchange == self.command() {
            (self.owed_at, self.takes_turn) = (None, false);
        }
        let is_confirmed = self.is_confirmed();
        let repeat = if is_confirmed { config.stop_repeat() } else { UNCONFIRMED_REPEAT };
        match exchange {
            Exchange::OutputOff if self.step() != Some(Exchange::OutputOff) => {
                self.repeat_at = now + repeat;
                self.read_after_repeat = is_confirmed;
            }
            Exchange::PositionStop if is_confirmed => {
                self.end_follows = false;
                self.repeat_at = now + repeat;
            }
            Exchange::Stop => {
                self.end_follows = is_confirmed && ends_moves(config);
                self.repeat_at = if self.end_follows { now } else { now + repeat };
                self.next_at = now;
                if let Backoff::Silence { until, then, asked } = &mut self.backoff {
                    *asked &= *then == Then::Second || now < *until;
                }
                self.read_after_repeat = is_confirmed;
            }
            Exchange::Velocity => {
                self.next_at = now + self.hold_poll.unwrap_or(CONFIRM_POLL);
                self.read_after_repeat = false;
            }
            _ => self.next_at = now,
        }
    }

    /// The bus has cancelled an exchange of the stop: it has not left.
    pub fn cancelled(&mut self, now: Instant, exchange: Exchange) {
        if exchange == self.command() && self.repeats() {
            self.owe(now);
        } else if exchange == Exchange::PositionStop && self.is_confirmed() {
            (self.end_follows, self.repeat_at) = (true, now);
        } else {
            self.next_at = self.next_at.min(now);
        }
    }

    /// A frame of the stop has left. An unreachable motor is sent nothing for `silence` after two
    /// stops (GUARANTEES G4).
    pub fn transmitted(&mut self, now: Instant, exchange: Exchange, silence: Duration) {
        self.went_on_at = now;
        if core::mem::take(&mut self.not_sent) {
            self.give_up_at = now + STANDSTILL_WITHIN;
        }
        if exchange == self.command() {
            self.last_left = Some(now);
        }
        if exchange == Exchange::PositionStop
            && let Backoff::Silence { until, then: Then::First, .. } = &mut self.backoff
        {
            // The silence begins behind what a motor has heard last.
            *until = now + silence;
        }
        if exchange != Exchange::Stop {
            return;
        }
        self.sent = self.sent.saturating_add(1);
        self.first_left.get_or_insert(now);
        if let Backoff::Silence { until, then, .. } = &mut self.backoff {
            (*until, *then) = match then {
                Then::First => (now, Then::Second),
                Then::Second => (now + silence, Then::First),
                Then::Repeat => return,
            };
            self.next_at = *until;
        }
    }

    /// From now on two stops go between silences. The silence is for a motor that hears us: what
    /// has not left has fed no timeout, and a stop that has never left is due.
    pub(super) fn rest(&mut self, now: Instant, silence: Duration) {
        let fed_at = |left| if self.hears { now } else { left };
        let until = self.last_left.map_or(now, |left| fed_at(left) + silence);
        self.backoff = Backoff::Silence { until, then: Then::First, asked: false };
    }

    /// The motor that has confirmed it turns on. Where that takes as long as for one that must
    /// stand, nothing is sent for `silence` from now on.
    pub(super) fn coasts_on(&mut self, now: Instant, silence: Duration) {
        if now.since(self.since) < STANDSTILL_WITHIN {
            return;
        }
        let until = now + silence;
        let asked = matches!(self.backoff, Backoff::Silence { asked: true, .. });
        self.backoff = Backoff::Silence { until, then: Then::Repeat, asked };
        self.repeat_at = self.repeat_at.max(until);
    }

    /// The motor that has confirmed it stands: it needs no silence.
    pub(super) fn stands(&mut self) {
        if matches!(self.backoff, Backoff::Silence { then: Then::Repeat, .. }) {
            self.backoff = Backoff::None;
        }
    }

    /// Nothing is known of the motor any more, a locked brake included: all of the stop begins
    /// again. Returns whether the motor counted as reachable.
    pub(super) fn lose_motor(&mut self, now: Instant) -> bool {
        self.hold_poll = None;
        self.acknowledged = false;
        self.sent = 0;
        self.sequence.restart();
        self.command_again(now);
        !core::mem::replace(&mut self.unreachable, true)
    }

    /// It has just been confirmed, and goes on as the stop of a tripped axis.
    pub(super) fn goes_on_confirmed(&mut self, repeat_at: Instant, hold_poll: Option<Duration>) {
        self.unreachable = false;
        self.repeat_at = repeat_at;
        self.hold_poll = hold_poll;
    }

    /// Where one more is owed the last step is done again behind it.
    /// A host that asks without a pause does not keep it from being confirmed for ever.
    pub(super) fn stays_while_owed(&mut self, config: &AxisConfig) {
        if let Some(owed) = self.owed_at.filter(|_| self.is_confirmed())
            && self.stayed < STAYS_AT_MOST
        {
            self.next_at = self.next_at.max(owed);
            self.stayed += 1;
            self.standstill_readings = STANDSTILL_READINGS - 1;
            self.sequence.step_back();
            while self.sequence.step().is_some_and(|step| !protocol::is_served(step, config)) {
                self.sequence.step_back();
            }
        }
    }

    fn turn_aside(&mut self, now: Instant, detour: Detour) {
        self.detour = detour;
        self.next_at = now;
    }

    /// On to the stop command again, unless the brake holds already.
    fn command_again(&mut self, now: Instant) {
        (self.detour, self.end_follows) = (Detour::None, false);
        if !self.is_braked() {
            self.sequence.restart();
        }
        self.next_at = match self.backoff {
            Backoff::Silence { until, then: Then::First | Then::Second, .. } => now.max(until),
            _ => now,
        };
    }

    fn advance(&mut self, now: Instant, config: &AxisConfig) {
        self.sequence.advance();
        self.sequence.pass_over(|step| !protocol::is_served(step, config));
        self.begin_step(now);
    }

    fn begin_step(&mut self, now: Instant) {
        self.next_at = now;
        self.step_since = now;
        self.standstill_readings = 0;
    }
}

/// Whether the stop command alone ends no move of this motor: it is told that as well.
fn ends_moves(config: &AxisConfig) -> bool {
    protocol::is_served(Exchange::PositionStop, config)
}
