//! The state of an axis, with what belongs to it, and every way from one state to another.

use super::first_stop::FirstStop;
use super::setpoint::Motion;
use super::{Axis, Silence, Stop};
use crate::measured::Observation;
use crate::outbox::Outbox;
use crate::protocol::{self, Exchange, Info};
use crate::time::Instant;
use host_protocol::{
    AxisParameter, AxisState, CycleResult, Error, Event, StateField, StopAction, Trip, TripReason,
};
use serde::{Deserialize, Serialize};

/// Where an axis stands.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) enum State {
    /// A required parameter is missing.
    Unconfigured,
    /// At rest, the motor's output off or unknown.
    Idle,
    /// At rest, the motor's output on.
    Holding,
    /// The job under way arms it.
    Arming,
    /// Motion is allowed.
    Armed(Armed),
    /// It moves by this setpoint.
    Active(Armed, Motion),
    /// It is stopped on request.
    Stopping(Stop),
    /// It was stopped for this reason, and stays so until it is cleared.
    Tripped(Tripped, Stop),
}

/// What an armed axis remembers of its motor.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Armed {
    /// Setpoints must carry it.
    pub epoch: u32,
    /// Motions since arming: the number of the one in force.
    pub motions: u32,
    pub fault_poll_at: Instant,
    /// After a motion frame whatever else is due goes first, so that fast setpoints starve no
    /// poll.
    pub motion_was_last: bool,
    pub echo: EchoCheck,
    /// How long the motor has answered no motion, though perhaps polls.
    pub motion_silence: Silence,
    /// Since when it has been seen to turn without a setpoint.
    pub uncommanded_since: Option<Instant>,
    /// By when the first setpoint, or the first refresh of one, must leave that the bus has not
    /// taken, but for the time that its bus may take; [`Instant::NEVER`] where none waits.
    pub deliver_by: Instant,
}

/// Whether the motor carries out the last motion, as far as its replies tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct EchoCheck {
    /// It was answered by zeros: the speed is to be read, which tells whether that was a state
    /// (PROTOCOL-NOTES R30).
    pub is_doubtful: bool,
    /// It was thrown back once, and was sent again.
    pub was_echoed: bool,
}

/// A trip, and who still has to hear of it.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Tripped {
    trip: Trip,
    /// It has still to reach the others of its group.
    pub spreads: bool,
    /// It has still to go into the history.
    is_unrecorded: bool,
}

/// Every way from one state to another, and what takes it. ARCHITECTURE.md draws them.
const TRANSITIONS: &[(&str, &str, &str)] = &[
    ("Unconfigured", "Idle", "configured"),
    ("Idle", "Holding", "output on"),
    ("Holding", "Idle", "output off"),
    ("Idle", "Arming", "arm"),
    ("Holding", "Arming", "arm"),
    ("Arming", "Armed", "armed"),
    ("Arming", "Idle", "refused"),
    ("Arming", "Holding", "refused"),
    ("Armed", "Active", "setpoint"),
    ("Idle", "Stopping", "stop"),
    ("Holding", "Stopping", "stop"),
    ("Arming", "Stopping", "stop"),
    ("Armed", "Stopping", "stop"),
    ("Active", "Stopping", "stop"),
    ("Stopping", "Idle", "confirmed"),
    ("Stopping", "Holding", "confirmed"),
    ("Arming", "Tripped", "trip"),
    ("Armed", "Tripped", "trip"),
    ("Active", "Tripped", "trip"),
    ("Stopping", "Tripped", "trip"),
    ("Tripped", "Idle", "cleared"),
    ("Tripped", "Holding", "cleared"),
];

/// Panics in tests where there is no such transition.
fn check_transition(from: &str, to: &str) {
    debug_assert!(
        from == to || TRANSITIONS.iter().any(|(start, end, _)| (*start, *end) == (from, to)),
        "no axis goes from {from} to {to}"
    );
}

impl State {
    fn name(&self) -> &'static str {
        match self {
            Self::Unconfigured => "Unconfigured",
            Self::Idle => "Idle",
            Self::Holding => "Holding",
            Self::Arming => "Arming",
            Self::Armed(_) => "Armed",
            Self::Active(..) => "Active",
            Self::Stopping(_) => "Stopping",
            Self::Tripped(..) => "Tripped",
        }
    }

    /// The state as hosts know it.
    pub fn told(&self) -> AxisState {
        match self {
            Self::Unconfigured => AxisState::Unconfigured,
            Self::Idle => AxisState::Idle,
            Self::Holding => AxisState::Holding,
            Self::Arming => AxisState::Arming,
            Self::Armed(_) => AxisState::Armed,
            Self::Active(..) => AxisState::Active,
            Self::Stopping(_) => AxisState::Stopping,
            Self::Tripped(_, stop) => AxisState::Tripped { confirmed: stop.is_confirmed() },
        }
    }
}

impl Axis {
    /// The state as hosts know it.
    pub fn state(&self) -> AxisState {
        self.state.told()
    }

    /// The stop, under way or confirmed.
    pub fn stop(&self) -> Option<&Stop> {
        match &self.state {
            State::Stopping(stop) | State::Tripped(_, stop) => Some(stop),
            _ => None,
        }
    }

    pub(super) fn stop_mut(&mut self) -> Option<&mut Stop> {
        match &mut self.state {
            State::Stopping(stop) | State::Tripped(_, stop) => Some(stop),
            _ => None,
        }
    }

    pub(super) fn armed(&self) -> Option<&Armed> {
        match &self.state {
            State::Armed(armed) | State::Active(armed, _) => Some(armed),
            _ => None,
        }
    }

    pub(super) fn armed_mut(&mut self) -> Option<&mut Armed> {
        match &mut self.state {
            State::Armed(armed) | State::Active(armed, _) => Some(armed),
            _ => None,
        }
    }

    pub(super) fn motion(&self) -> Option<&Motion> {
        match &self.state {
            State::Active(_, motion) => Some(motion),
            _ => None,
        }
    }

    /// Why the axis has tripped.
    pub fn trip_reason(&self) -> Option<TripReason> {
        self.tripped().map(|trip| trip.reason)
    }

    /// The trip of the axis.
    pub fn tripped(&self) -> Option<Trip> {
        match &self.state {
            State::Tripped(tripped, stop) => {
                Some(Trip { unreachable: stop.unreachable, ..tripped.trip })
            }
            _ => None,
        }
    }

    /// Whether motion is allowed or under way, so that polls, limits and trips apply.
    pub fn is_armed(&self) -> bool {
        self.armed().is_some()
    }

    /// Whether motion is allowed to a host that knows this epoch.
    pub fn is_armed_in(&self, epoch: u32) -> bool {
        self.armed().is_some_and(|armed| armed.epoch == epoch)
    }

    pub fn is_configured(&self) -> bool {
        !matches!(self.state, State::Unconfigured)
    }

    /// Why one that is not configured does nothing: a parameter that it needs.
    pub fn not_configured(&self) -> Error {
        let parameter = self.config.missing().map_or(0, AxisParameter::number);
        Error::NotConfigured { axis: self.index, parameter }
    }

    /// Whether it is configured and nothing moves or may, the motor's output on or off.
    pub fn is_idle_or_holding(&self) -> bool {
        matches!(self.state, State::Idle | State::Holding)
    }

    /// Whether the axis may be configured: nothing is allowed, and nothing under way but a question.
    pub fn is_at_rest(&self) -> bool {
        (!self.is_configured() || self.is_idle_or_holding())
            && !self.is_busy_with_more_than_a_question()
    }

    /// Whether the axis needs its bus: it keeps its motor holding, may move or moves, or has yet to
    /// be stopped or cleared.
    pub fn is_in_use(&self) -> bool {
        match self.state {
            State::Unconfigured | State::Idle => false,
            State::Holding => self.is_polled_to_hold(),
            _ => true,
        }
    }

    /// Whether the axis holds and must be polled for it.
    pub fn is_kept_holding(&self) -> bool {
        matches!(self.state, State::Holding) && self.is_polled_to_hold()
    }

    /// Goes to a state and tells the hosts.
    pub(super) fn enter(&mut self, state: State, out: &mut Outbox<'_>) {
        let before = self.state();
        self.go_to(state);
        self.tell_state(before, out);
    }

    fn go_to(&mut self, state: State) {
        check_transition(self.state.name(), state.name());
        self.state = state;
        if !self.is_armed() {
            self.end_cycle(CycleResult::Stopped);
            self.stop_part();
        }
    }

    /// Tells the hosts of a state that is another one than before.
    pub(super) fn tell_state(&self, before: AxisState, out: &mut Outbox<'_>) {
        let state = self.state();
        if state != before {
            out.event(&Event::StateChanged { axis: self.index, state });
        }
    }

    /// From now on at rest: holding where the motor's output is on.
    pub(super) fn enter_rest(&mut self, now: Instant, output_on: bool, out: &mut Outbox<'_>) {
        self.state_poll_at = now;
        self.enter(if output_on { State::Holding } else { State::Idle }, out);
    }

    /// The motor has passed all checks of the arming.
    pub(super) fn enter_armed(&mut self, now: Instant, epoch: u32, out: &mut Outbox<'_>) {
        let armed = Armed {
            epoch,
            motions: 0,
            fault_poll_at: now + self.config.fault_poll(),
            motion_was_last: false,
            echo: EchoCheck::default(),
            motion_silence: Silence::NONE,
            uncommanded_since: None,
            deliver_by: Instant::NEVER,
        };
        self.state_poll_at = now + self.turn();
        self.enter(State::Armed(armed), out);
    }

    /// Latches a trip with its reason and starts the stop. Only states in which motion is possible
    /// can trip.
    pub fn trip(&mut self, now: Instant, reason: TripReason, out: &mut Outbox<'_>) {
        let stop = match self.state {
            State::Arming | State::Armed(_) | State::Active(..) => self.new_stop(now, false),
            State::Stopping(_) => {
                if reason != TripReason::StopUnconfirmed {
                    self.stop_again(now);
                }
                let Some(stop) = self.stop() else { return };
                stop.clone()
            }
            State::Unconfigured | State::Idle | State::Holding | State::Tripped(..) => return,
        };
        let trip = Trip {
            reason,
            time_us: now.as_micros(),
            velocity_rad_s: self.measured.number(StateField::Velocity),
            position_rad: self.measured.number(StateField::Position),
            current_a: self.measured.number(StateField::Current),
            unreachable: false,
        };
        let spreads = self.trip_group().is_some();
        self.go_to(State::Tripped(Tripped { trip, spreads, is_unrecorded: true }, stop));
        self.interrupt(now, Error::Tripped { axis: self.index, reason }, out);
        out.event(&Event::Tripped { axis: self.index, trip });
    }

    /// The fault word that is read first after a refused command tells why it was refused.
    pub(super) fn note_refusal(&mut self, seen: &Observation) {
        if seen.faults.is_some()
            && let State::Tripped(Tripped { trip, .. }, _) = &mut self.state
            && let TripReason::CommandRefused { faults: faults @ None } = &mut trip.reason
        {
            *faults = seen.faults;
        }
    }

    /// The axis was in motion, or tripped already, when the gateway was reset. A motor that was
    /// unreachable stays so until it confirms a stop; as none of this run has left, its first
    /// two go out before the silence.
    pub fn trip_after_reset(
        &mut self,
        now: Instant,
        reason: TripReason,
        unreachable: bool,
        out: &mut Outbox<'_>,
    ) {
        // It may have been doing anything.
        self.state = State::Arming;
        self.trip(now, reason, out);
        if unreachable {
            self.rest(now, out);
        }
    }

    /// Stops and disarms on request: from any state in which the motor may move, and from rest,
    /// where a stop does no harm.
    pub fn halt(&mut self, now: Instant, out: &mut Outbox<'_>) {
        match self.state {
            State::Unconfigured => return,
            State::Stopping(_) => return self.stop_again(now),
            State::Tripped(..) => {
                // Who clears must not have a stop forgotten that was asked for since.
                self.give_up_clearing(now, out);
                return self.stop_again(now);
            }
            _ => {}
        }
        let before = self.state();
        let from_rest = self.is_idle_or_holding();
        let stop = self.new_stop(now, from_rest);
        self.go_to(State::Stopping(stop));
        self.interrupt(now, self.aborted(), out);
        self.tell_state(before, out);
    }

    /// Disarms: an axis that is neither arming nor armed has nothing to disarm.
    pub fn disarm(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if matches!(self.state, State::Arming | State::Armed(_) | State::Active(..)) {
            self.halt(now, out);
        }
    }

    /// A stop that begins: what is under way makes room.
    fn new_stop(&mut self, now: Instant, from_rest: bool) -> Stop {
        self.transactions.preempt();
        Stop::new(now, from_rest, &self.config)
    }

    /// A stop is asked for although one is under way or confirmed: it is sent again, and what is
    /// under way makes room, but for a command of the stop: an answer to that counts.
    fn stop_again(&mut self, now: Instant) {
        let (State::Stopping(stop) | State::Tripped(_, stop)) = &mut self.state else { return };
        if stop.ask_again(now, &self.config)
            && !self.transactions.current().is_some_and(|current| current.exchange.is_stop())
        {
            self.transactions.preempt();
        }
    }

    /// Its first stop command has still to leave, and may.
    pub fn is_about_to_stop(&self) -> bool {
        self.stop().is_some_and(|stop| !stop.has_left() && !stop.not_sent)
    }

    /// Leaves a trip whose stop the motor does not confirm, or a stop that cannot be sent. Unsafe:
    /// the motor may be turning.
    pub fn clear_unreachable(&mut self, now: Instant, out: &mut Outbox<'_>) -> Result<(), Error> {
        if !self.stop().is_some_and(|stop| stop.unreachable || stop.not_sent) {
            return Err(Error::NothingToClear { axis: self.index });
        }
        self.doubt_motor_timeout();
        self.given_up_at = now;
        self.first_stop = FirstStop::OWED;
        self.transactions.preempt();
        self.enter(State::Idle, out);
        Ok(())
    }

    /// The trip is over, and the repeated stop with it.
    pub(super) fn cleared(&mut self, now: Instant, output_on: bool, out: &mut Outbox<'_>) {
        if matches!(self.state, State::Tripped(..)) {
            self.enter_rest(now, output_on, out);
        }
    }

    /// Whether the motor's output is on after a confirmed stop. The brake holds by itself.
    pub(super) fn holds_after_stop(&self) -> bool {
        self.config.stop_action() == Some(StopAction::Hold)
    }

    /// Whether a stop of this axis is confirmed only at standstill.
    pub(super) fn must_stand(&self) -> bool {
        self.config.stop_action() != Some(StopAction::Coast)
    }

    pub(super) fn is_polled_to_hold(&self) -> bool {
        Info::of_axis(&self.config).is_some_and(|info| info.polled_to_hold)
    }

    /// Whether the motor must be kept polled once it is stopped, to go on holding.
    pub(super) fn must_hold(&self) -> bool {
        self.is_polled_to_hold() && self.holds_after_stop()
    }

    /// Whether the motor has a command for an exchange.
    pub fn can(&self, exchange: Exchange) -> bool {
        protocol::is_served(exchange, &self.config)
    }

    /// The trip that has still to go into the history.
    pub fn take_unrecorded_trip(&mut self) -> Option<Trip> {
        let State::Tripped(tripped, _) = &mut self.state else { return None };
        if !core::mem::take(&mut tripped.is_unrecorded) {
            return None;
        }
        self.tripped()
    }

    /// Axes that trip together have the same.
    pub fn trip_group(&self) -> Option<u32> {
        self.config.unsigned(AxisParameter::TripGroup)
    }

    /// The group that a new trip of this axis has still to reach.
    pub fn take_spreading_trip(&mut self) -> Option<u32> {
        let State::Tripped(tripped, _) = &mut self.state else { return None };
        core::mem::take(&mut tripped.spreads).then(|| self.trip_group()).flatten()
    }
}
