//! The requests that move an axis otherwise than by a setpoint: native commands and relative moves.

use super::Result;
use crate::axis::JobKind;
use crate::bus_rules;
use crate::gateway::Gateway;
use crate::outbox::Ticket;
use crate::protocol::{self, Demand, Effect, Exchange, Native, Sets};
use crate::set::Set;
use crate::time::Instant;
use host_protocol::{
    AxisParameter, AxisState, Bytes, Error, Reply, StopTarget, Value, replies, requests,
};

impl Gateway {
    /// Does what the decoded bytes ask for, under the rules of what they do (GUARANTEES G2).
    pub(crate) fn native(
        &mut self,
        now: Instant,
        request: &requests::Native,
        ticket: Ticket,
    ) -> Result<()> {
        let index = request.axis;
        let native = self.decode(request)?;
        let permitted = self.axis(index)?.is_armed_in(request.epoch);
        let idle = self.axis(index)?.state() == AxisState::Idle;
        match native.effect {
            Effect::Asks => self.ask_natively(now, index, native, ticket),
            Effect::Rests(demand) if permitted => {
                self.move_natively(now, request, native, demand, ticket)
            }
            Effect::Stops | Effect::Rests(_) if !idle => {
                self.stop(now, StopTarget::Axis(index))?;
                let reply = Reply::Native(replies::NativeReply { data: Bytes::new() });
                self.outbox(now).answer(ticket, Ok(&reply));
                Ok(())
            }
            Effect::Stops | Effect::Rests(_) | Effect::Changes { .. } => {
                self.change_natively(now, index, native, ticket)
            }
            Effect::Moves(demand) | Effect::MovesOnce(demand) => {
                self.move_natively(now, request, native, demand, ticket)
            }
        }
    }

    /// The command that the bytes are to the motor of the axis.
    fn decode(&self, request: &requests::Native) -> Result<Native> {
        let axis = self.axis(request.axis)?;
        if !axis.is_configured() {
            return Err(axis.not_configured());
        }
        let kind = self.bus(axis.config.bus().unwrap_or(u8::MAX))?.kind();
        protocol::native(request.axis, &request.data, kind, &axis.config)
    }

    /// Whether a native command does the same as the request to stop: that needs no place for its
    /// reply (GUARANTEES G9).
    pub(crate) fn is_native_stop(&self, request: &requests::Native) -> bool {
        let (Ok(axis), Ok(native)) = (self.axis(request.axis), self.decode(request)) else {
            return false;
        };
        let stops = match native.effect {
            Effect::Stops => true,
            Effect::Rests(_) => !axis.is_armed_in(request.epoch),
            _ => false,
        };
        stops && axis.state() != AxisState::Idle
    }

    pub(crate) fn move_relative(
        &mut self,
        now: Instant,
        request: &requests::MoveRelative,
        ticket: Ticket,
    ) -> Result<()> {
        self.refuse_e_stopped(request.axis)?;
        let (distance, speed) = (request.distance_rad, request.speed_limit_rad_s);
        self.with_axis(now, request.axis, |axis, out| {
            let expires = axis.permission(now, request.epoch, request.expires_at_us)?;
            axis.move_relative(now, expires, distance, speed, ticket, out)
        })?
    }

    /// A command that only asks is as free as reading the state, but not told from what is known
    /// already.
    fn ask_natively(
        &mut self,
        now: Instant,
        index: u8,
        native: Native,
        ticket: Ticket,
    ) -> Result<()> {
        let axis = self.axis(index)?;
        let free = matches!(
            axis.state(),
            AxisState::Idle
                | AxisState::Holding
                | AxisState::Armed
                | AxisState::Active
                | AxisState::Tripped { confirmed: true }
        );
        if !free {
            return Err(match axis.state() {
                AxisState::Tripped { .. } => Error::StopNotConfirmed { axis: index },
                _ => Error::Busy { axis: index },
            });
        }
        if let Some(velocity_rad_s) = axis.left_alone_at_rad_s(now) {
            return Err(Error::NotStandstill { axis: index, velocity_rad_s });
        }
        self.ready_bus(axis)?;
        self.start(now, index, JobKind::Native { command: native.command, asks: true }, ticket)
    }

    fn change_natively(
        &mut self,
        now: Instant,
        index: u8,
        native: Native,
        ticket: Ticket,
    ) -> Result<()> {
        let changes = matches!(native.effect, Effect::Changes { .. });
        if changes {
            self.authority.check(ticket)?;
            self.refuse_saving()?;
        }
        self.authority.take(now, ticket)?;
        if changes {
            self.refuse_e_stopped(index)?;
        }
        let axis = self.idle_axis(index)?;
        if axis.state() == AxisState::Holding && axis.can(Exchange::OutputOff) {
            return Err(Error::NotIdle { axis: index, state: axis.state() });
        }
        self.with_axis(now, index, |axis, out| axis.make_way(now, out))?;
        if self.axis(index)?.is_busy() {
            return Err(Error::Busy { axis: index });
        }
        self.check_row_after(index, &native)?;
        self.check_bitrate_after(index, &native)?;
        self.admit_frames_after(index, &native)?;
        if native.effect == (Effect::Changes { timeout: true }) {
            self.axis_mut(index)?.may_change_timeout(native.command.sets());
        }
        self.start(now, index, JobKind::Native { command: native.command, asks: false }, ticket)
    }

    /// Refuses what the axis could not be configured for beside the others (GUARANTEES G7), and
    /// what would leave its stops unconfirmed.
    fn check_row_after(&self, index: u8, native: &Native) -> Result<()> {
        let before = &self.axis(index)?.config;
        let (parameter, value) = match native.command.sets() {
            Sets::Node(node) | Sets::NextNode(node) => (AxisParameter::Node, node.into()),
            Sets::Row(parameter, value) => (parameter, value),
            _ => return Ok(()),
        };
        if before.unsigned(parameter) == Some(value) {
            return Ok(());
        }
        let mut after = before.clone();
        after.set(parameter, Value::Unsigned(value))?;
        self.check_axis(index, &after)?;
        if protocol::can_confirm(before) && !protocol::can_confirm(&after) {
            return Err(Error::CannotConfirm { axis: index });
        }
        Ok(())
    }

    /// Refuses a bitrate of the motor that the axis's bus cannot have: nobody would reach it any
    /// more, and only at its rate it could be set back.
    fn check_bitrate_after(&self, index: u8, native: &Native) -> Result<()> {
        let Sets::Bitrate(bitrate) = native.command.sets() else { return Ok(()) };
        let Some(bus) = self.axis(index)?.config.bus() else { return Ok(()) };
        let rates = self.bus(bus)?.port().bitrates.iter().copied();
        if rates.clone().any(|rate| protocol::is_within_tolerance(bitrate, rate)) {
            return Ok(());
        }
        let offered = rates.filter(|rate| protocol::can_be_set_to(*rate));
        Err(bus_rules::not_offered(bus, bitrate, offered))
    }

    /// Refuses frames that the motor would send by itself, or answer with, and that the bus could
    /// not carry beside what its axes need, or in time for their motors. Those that it sends by
    /// itself count from now on, and fewer only once the motor has taken them.
    fn admit_frames_after(&mut self, index: u8, native: &Native) -> Result<()> {
        let Sets::Row(parameter, value) = native.command.sets() else { return Ok(()) };
        let axis = self.axis_mut(index)?;
        let before = axis.config.clone();
        axis.config.set(parameter, Value::Unsigned(value))?;
        let after = &axis.config;
        let answers_more =
            protocol::replies_to_motion(after) > protocol::replies_to_motion(&before);
        let sends_more = protocol::stream(after)
            .is_some_and(|stream| stream.is_heavier_than(protocol::stream(&before)));
        // How long others wait then follows.
        self.settle(self.now);
        let admitted = if answers_more || sends_more {
            let bus = self.axis(index)?.config.bus().map_or(Set::NONE, Set::of);
            self.check_axis_load(index).and_then(|()| self.check_timeouts(bus, Set::NONE))
        } else {
            Ok(())
        };
        let axis = self.axis_mut(index)?;
        axis.config = before;
        if admitted.is_ok() && sends_more {
            axis.motor_was_told(parameter, value)?;
        }
        admitted
    }

    fn move_natively(
        &mut self,
        now: Instant,
        request: &requests::Native,
        native: Native,
        demand: Demand,
        ticket: Ticket,
    ) -> Result<()> {
        self.authority.take(now, ticket)?;
        self.refuse_e_stopped(request.axis)?;
        self.with_axis(now, request.axis, |axis, out| {
            let expires = axis.permission(now, request.epoch, request.expires_at_us)?;
            axis.move_natively(now, expires, native, demand, ticket, out)
        })?
    }

    /// While the e-stop is latched nothing moves; an axis that tripped says why by itself.
    pub(crate) fn refuse_e_stopped(&self, axis: u8) -> Result<()> {
        if self.axis(axis)?.trip_reason().is_none() { self.refuse_latched() } else { Ok(()) }
    }

    pub(crate) fn refuse_latched(&self) -> Result<()> {
        if self.e_stopped || self.e_stop_input_open { Err(Error::EStopped {}) } else { Ok(()) }
    }
}
