//! Leaving motion: trips, stops and disarming, and the way from one state to another.

use super::{Axis, Stop};
use crate::outbox::Outbox;
use crate::protocol::{self, Exchange, Info};
use crate::time::Instant;
use host_protocol::{
    AxisParameter, AxisState, Error, Event, StateField, StopAction, Trip, TripReason,
};

impl Axis {
    /// Latches a trip with its reason and starts the stop. Only states in which motion is possible
    /// can trip.
    pub fn trip(&mut self, now: Instant, reason: TripReason, out: &mut Outbox<'_>) {
        let can_trip = matches!(
            self.state,
            AxisState::Arming | AxisState::Armed | AxisState::Active | AxisState::Stopping
        );
        if !can_trip {
            return;
        }
        let trip = Trip {
            reason,
            time_us: now.as_micros(),
            velocity_rad_s: self.measured.number(StateField::Velocity),
            position_rad: self.measured.number(StateField::Position),
            current_a: self.measured.number(StateField::Current),
            unreachable: false,
        };
        self.trip = Some(trip);
        self.trip_spreads = self.trip_group().is_some();
        self.trip_unrecorded = true;
        if self.stop.is_none() {
            self.begin_stop(now);
        } else if reason != TripReason::StopUnconfirmed {
            self.stop_again(now);
        }
        self.state = AxisState::Tripped { confirmed: false };
        self.interrupt(now, Error::Tripped { axis: self.index, reason }, out);
        out.event(&Event::Tripped { axis: self.index, trip });
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
        self.state = AxisState::Stopping;
        self.trip(now, reason, out);
        if unreachable {
            self.rest(now, out);
        }
    }

    /// The trip that has still to go into the history.
    pub fn take_unrecorded_trip(&mut self) -> Option<Trip> {
        if core::mem::take(&mut self.trip_unrecorded) { self.trip } else { None }
    }

    /// Whether its trip has still to go into the history.
    pub fn trip_is_unrecorded(&self) -> bool {
        self.trip_unrecorded
    }

    /// Axes that trip together have the same.
    pub fn trip_group(&self) -> Option<u32> {
        self.config.unsigned(AxisParameter::TripGroup)
    }

    /// Whether a new trip of this axis has still to reach the others of its group.
    pub fn trip_spreads(&self) -> bool {
        self.trip_spreads
    }

    /// The group that a new trip of this axis has still to reach.
    pub fn take_spreading_trip(&mut self) -> Option<u32> {
        core::mem::take(&mut self.trip_spreads).then(|| self.trip_group()).flatten()
    }

    /// Stops and disarms on request: from any state in which the motor may move, and from rest,
    /// where a stop does no harm.
    pub fn stop(&mut self, now: Instant, out: &mut Outbox<'_>) {
        match self.state {
            AxisState::Unconfigured => {}
            AxisState::Stopping => self.stop_again(now),
            AxisState::Tripped { .. } => {
                // Who clears must not have a stop forgotten that was asked for since.
                self.give_up_clearing(now, out);
                self.stop_again(now);
            }
            AxisState::Idle
            | AxisState::Holding
            | AxisState::Arming
            | AxisState::Armed
            | AxisState::Active => {
                let aborted = match self.state {
                    AxisState::Arming => {
                        Error::ArmingAborted { axis: self.index, state: AxisState::Stopping }
                    }
                    _ => Error::Busy { axis: self.index },
                };
                self.begin_stop(now);
                self.state = AxisState::Stopping;
                self.interrupt(now, aborted, out);
                self.announce(out);
            }
        }
    }

    /// Disarms: an axis that is neither arming nor armed has nothing to disarm.
    pub fn disarm(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if matches!(self.state, AxisState::Arming | AxisState::Armed | AxisState::Active) {
            self.stop(now, out);
        }
    }

    /// Leaves a trip whose stop the motor does not confirm, or a stop that cannot be sent. Unsafe:
    /// the motor may be turning.
    pub fn clear_unreachable(&mut self, out: &mut Outbox<'_>) -> Result<(), Error> {
        if !self.is_unreachable() && !self.stop.as_ref().is_some_and(Stop::is_not_sent) {
            return Err(Error::NothingToClear { axis: self.index });
        }
        self.trip = None;
        self.stop = None;
        self.doubt_motor_timeout();
        self.displace();
        self.enter(AxisState::Idle, out);
        Ok(())
    }

    /// Goes to a state and tells the hosts.
    pub(super) fn enter(&mut self, state: AxisState, out: &mut Outbox<'_>) {
        if self.state != state {
            self.state = state;
            self.announce(out);
        }
    }

    /// From now on at rest: holding where the motor's output is on.
    pub(super) fn enter_rest(&mut self, now: Instant, output_on: bool, out: &mut Outbox<'_>) {
        self.state_poll_at = now;
        self.enter(if output_on { AxisState::Holding } else { AxisState::Idle }, out);
    }

    /// Whether the motor's output is on after a confirmed stop. The brake holds by itself.
    pub(super) fn holds_after_stop(&self) -> bool {
        self.config.stop_action() == Some(StopAction::Hold)
    }

    /// Whether the axis holds and must be polled for it.
    pub fn is_kept_holding(&self) -> bool {
        self.state == AxisState::Holding && self.holds_while_polled()
    }

    fn holds_while_polled(&self) -> bool {
        Info::of_axis(&self.config).is_some_and(|info| info.polled_to_hold)
    }

    /// Whether a stop of this axis is confirmed only at standstill.
    pub(super) fn must_stand(&self) -> bool {
        self.config.stop_action() != Some(StopAction::Coast)
    }

    /// Whether the motor has a command that switches its output off.
    pub fn can_let_go(&self) -> bool {
        protocol::command(Exchange::OutputOff, &self.config).is_some()
    }

    /// Whether the motor has a command that makes it start anew.
    pub fn can_restart(&self) -> bool {
        protocol::command(Exchange::Restart, &self.config).is_some()
    }

    /// Whether the motor must be kept polled once it is stopped, for the same reason.
    pub(super) fn must_hold(&self) -> bool {
        self.holds_while_polled() && self.config.stop_action() == Some(StopAction::Hold)
    }

    fn announce(&self, out: &mut Outbox<'_>) {
        out.event(&Event::StateChanged { axis: self.index, state: self.state });
    }

    /// Stale motion is purged, and what is under way makes room.
    fn begin_stop(&mut self, now: Instant) {
        self.motion = None;
        self.displace();
        self.stop = Some(Stop::new(now, self.is_idle_or_holding()));
    }
}
