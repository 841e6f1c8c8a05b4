//! The stop: sent first, sent again until the motor has confirmed it, and repeated while the axis is tripped
//! (GUARANTEES G4).

use super::exchanges::Pending;
use super::{Axis, AxisConfig, Observation};
use crate::motor::{self, Exchange};
use crate::outbox::Outbox;
use crate::time::{Duration, Instant};
use host_protocol::{AxisState, Error, Event, Protocol, StopAction, TripReason};

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
/// Between two stop commands that hosts ask for; what is asked for more often must not keep the speed from being read.
const ASKED_AGAIN: Duration = Duration::from_millis(10);
/// How long the brake waits for standstill (GUARANTEES G4, stop table).
const BRAKE_WAIT: Duration = Duration::from_millis(1_000);

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
#[derive(Debug)]
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
    /// So many stops came to nothing, or the motor did not come to rest, and no stop has been confirmed since.
    unreachable: bool,
    /// An unreachable motor is left alone but for two stops between silences, until it answers one of them.
    resting: bool,
    /// The first of the two has gone.
    second_follows: bool,
    /// When the silence ends.
    rests_until: Instant,
    /// A host has had a stop sent in this silence; another one would keep the motor's own timeout from acting.
    asked_while_resting: bool,
    /// When a motor that answers and does not come to rest is given up.
    give_up_at: Instant,
    /// When the phase's next exchange is due.
    next_at: Instant,
    /// When the stop command is due again although the phase is another one.
    repeat_at: Instant,
    /// When the phase of reading the speed began.
    standstill_since: Instant,
    /// When something of the stop last went on: taken by the bus, answered, or given up.
    moved_at: Instant,
    /// The brake is locked and the output off.
    braked: bool,
    /// After a repeated stop the speed is read once, so that a coasting motor's standstill becomes known.
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
            moved_at: now,
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

    /// A stop is asked for again: the stop command goes out now, or soon if one has just left. Returns whether it does now.
    fn ask_again(&mut self, now: Instant) -> bool {
        let just_left = self.last_left.map(|left| left + ASKED_AGAIN).filter(|at| *at > now);
        if !self.has_left() || !self.repeats() || (self.resting && self.asked_while_resting) {
            return false;
        }
        let at = just_left.unwrap_or(now);
        self.asked_while_resting = self.resting;
        self.repeat_at = self.repeat_at.min(at);
        // Before the next reading, too.
        self.next_at = if self.phase == Phase::Command { self.next_at.min(at) } else { self.next_at.max(at) };
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
        self.phase != Phase::Confirmed && !self.resting && self.give_up_at <= now
    }

    /// When an unconfirmed stop counts as one that came to nothing, because the bus has not taken it.
    pub fn stalls_at(&self) -> Option<Instant> {
        let waits = self.phase != Phase::Confirmed && !self.resting;
        waits.then(|| self.moved_at.max(self.next_at) + UNCONFIRMED_REPEAT)
    }

    /// Once the brake is being locked the stop command would switch the output on again.
    fn repeats(&self) -> bool {
        !matches!(self.phase, Phase::LockBrake | Phase::VerifyBrake | Phase::OutputOff)
    }

    /// The bus has taken an exchange of the stop.
    pub fn handed(&mut self, now: Instant, exchange: Exchange, config: &AxisConfig, silence: Duration) {
        let repeat = if self.phase == Phase::Confirmed { config.stop_repeat() } else { UNCONFIRMED_REPEAT };
        self.moved_at = now;
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
                    // Two stops, then silence: whatever we send may be feeding the motor's own timeout (GUARANTEES G4).
                    self.second_follows = !self.second_follows;
                    self.rests_until = if self.second_follows { now } else { now + silence };
                    self.next_at = self.rests_until;
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

    /// A frame of the stop has left.
    pub fn left(&mut self, now: Instant, exchange: Exchange) {
        if exchange == Exchange::Stop {
            self.sent = self.sent.saturating_add(1);
            self.first_left.get_or_insert(now);
            self.last_left = Some(now);
        }
    }

    fn go(&mut self, now: Instant, phase: Phase) {
        self.phase = phase;
        self.next_at = if phase == Phase::Command && self.resting { now.max(self.rests_until) } else { now };
        self.moved_at = now;
        if phase == Phase::Standstill {
            self.standstill_since = now;
            self.standstill_readings = 0;
        }
    }
}

impl Axis {
    pub(super) fn stop_answered(
        &mut self,
        now: Instant,
        pending: &Pending,
        seen: &Observation,
        out: &mut Outbox<'_>,
    ) {
        let Some(stop) = &mut self.stop else { return };
        stop.moved_at = now;
        let answered = motor::is_answered(&pending.command, &self.config);
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
            (Phase::PositionStop, Exchange::PositionStop)
            | (Phase::OverwritePending, Exchange::OverwritePending) => self.seek_standstill(now),
            (Phase::PendingWrite, Exchange::PendingWrite) => match seen.write_pending {
                Some(true) => stop.go(now, Phase::OverwritePending),
                _ => self.seek_standstill(now),
            },
            (Phase::Standstill, Exchange::Velocity) => self.speed_read(now, seen),
            (Phase::LockBrake, Exchange::LockBrake) => stop.go(now, Phase::VerifyBrake),
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

    /// The motor refuses what the stop asks of it: that confirms nothing. Read the fault and the speed, and send the stop again.
    pub(super) fn stop_refused(&mut self, now: Instant, exchange: Exchange, out: &mut Outbox<'_>) {
        let Some(stop) = &mut self.stop else { return };
        match stop.phase {
            Phase::Confirmed if exchange.is_stop() => {}
            // Somebody else's question.
            Phase::Confirmed => return,
            _ if exchange.is_stop() && !stop.resting => stop.go(now, Phase::RefusedFaults),
            Phase::RefusedFaults | Phase::RefusedVelocity | Phase::ReadBack => stop.go(now, Phase::Command),
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

    pub(super) fn stop_unanswered(&mut self, now: Instant, exchange: Exchange, out: &mut Outbox<'_>) {
        let Some(stop) = &mut self.stop else { return };
        match stop.phase {
            // Nothing of these is needed for the stop itself, and confirmed it is already.
            Phase::Confirmed => {}
            Phase::RefusedFaults | Phase::RefusedVelocity | Phase::ReadBack => stop.go(now, Phase::Command),
            // Past the wait the brake is locked even if the speed cannot be read.
            Phase::Standstill => self.lock_when_overdue(now),
            _ => {}
        }
        // A poll that is lost while the speed is read is made up for by the stop command, which is repeated.
        if self.job_exchange() != Some(exchange) && exchange != Exchange::Velocity {
            self.count_unconfirmed(now, out);
        }
    }

    /// A stop came to nothing. After so many of them the motor counts as unreachable (GUARANTEES G4).
    fn count_unconfirmed(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let enough = self.config.stops_before_unreachable();
        let Some(stop) = &mut self.stop else { return };
        stop.moved_at = now;
        stop.unconfirmed = stop.unconfirmed.saturating_add(1);
        if stop.unconfirmed >= enough && !stop.resting {
            self.rest(now, out);
        }
    }

    /// The motor is unreachable: from now on it is sent two stops between silences, in which its own timeout can act.
    fn rest(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let silence = self.unreachable_silence();
        let Some(stop) = &mut self.stop else { return };
        let first_time = !core::mem::replace(&mut stop.unreachable, true);
        stop.resting = true;
        stop.hold_poll = None;
        // Nothing is known of the motor any more, a locked brake included: all of the stop begins again.
        stop.braked = false;
        stop.acknowledged = false;
        stop.second_follows = false;
        // The silence is for a motor that hears us: what has not left has fed no timeout, and a stop that has never left is due.
        stop.rests_until = stop.last_left.map_or(now, |left| left + silence);
        stop.go(now, Phase::Command);
        if !first_time {
            return;
        }
        if self.state == AxisState::Stopping {
            self.trip(now, TripReason::StopUnconfirmed, out);
        }
        if let Some(trip) = &mut self.trip {
            trip.unreachable = true;
        }
        self.no_longer_confirmed(now, out);
        out.event(&Event::AxisUnreachable { axis: self.index });
    }

    /// The stop of a tripped axis has to be confirmed anew, before anybody clears it.
    fn no_longer_confirmed(&mut self, now: Instant, out: &mut Outbox<'_>) {
        self.fail(now, Error::StopNotConfirmed { axis: self.index }, out);
        self.enter(AxisState::Tripped { confirmed: false }, out);
    }

    /// A stop is asked for although one is under way or confirmed: it is sent again at once, and what is under way makes room.
    pub(super) fn stop_again(&mut self, now: Instant) {
        let is_stop = self.pending.as_ref().is_some_and(|pending| pending.exchange.is_stop());
        if self.stop.as_mut().is_some_and(|stop| stop.ask_again(now)) && !is_stop {
            self.displace();
        }
    }

    /// Past the last stop command of the first phase: on to what confirms it.
    fn command_sent(&mut self, now: Instant) {
        let (protocol, action) = (self.config.protocol(), self.config.stop_action());
        let Some(stop) = &mut self.stop else { return };
        if !stop.acknowledged || stop.sent < STOPS_AT_LEAST {
            return;
        }
        if motor::command(Exchange::PositionStop, &self.config).is_some() {
            stop.go(now, Phase::PositionStop);
        } else if protocol == Some(Protocol::D5) {
            stop.go(now, Phase::PendingWrite);
        } else if action == Some(StopAction::Coast) {
            stop.go(now, Phase::Confirmed);
        } else {
            stop.go(now, Phase::Standstill);
        }
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

    /// A confirmed stop is watched: a motor that turns again is not stopped, and the stop begins anew.
    fn watch_confirmed(&mut self, now: Instant, seen: &Observation, out: &mut Outbox<'_>) {
        let turns = seen.velocity_rad_s.is_some_and(|velocity| !self.is_standstill(velocity));
        if turns && self.must_stand() && matches!(self.state, AxisState::Tripped { .. }) {
            self.stop = Some(Stop::new(now, false));
            self.no_longer_confirmed(now, out);
        }
    }

    /// Notices a stop that the bus does not take, or that does not bring the motor to rest.
    pub(super) fn expire_stop(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let Some(stop) = &self.stop else { return };
        if stop.is_overdue(now) {
            self.displace();
            self.rest(now, out);
        } else if self.pending.is_none() && stop.stalls_at().is_some_and(|at| at <= now) {
            self.count_unconfirmed(now, out);
        }
    }

    /// Reports a stop that has just been confirmed: a stopped axis is idle, a tripped one stays tripped.
    fn settle_stop(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let Some(stop) = &self.stop else { return };
        let settled = matches!(self.state, AxisState::Stopping | AxisState::Tripped { confirmed: false });
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
            self.hold_at_rest(now);
            self.enter(AxisState::Idle, out);
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
