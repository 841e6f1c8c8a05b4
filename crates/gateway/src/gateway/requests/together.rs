//! Several motors set in motion by one frame.
//!
//! Each motor is told a speed that waits in it and asked whether it does; every other motor of the
//! bus is shown to have nothing that waits. Then one frame to all starts what waits, and from there
//! on each speed is a setpoint like any other (GUARANTEES G2, G10). Where one of them cannot go on,
//! all that were told a speed are stopped: their stop overwrites what waits.

use super::Result;
use crate::axis::{Axis, JobKind};
use crate::gateway::Gateway;
use crate::outbox::Ticket;
use crate::protocol::{self, Exchange};
use crate::rules;
use crate::set::Set;
use crate::time::Instant;
use host_protocol::{
    AxisState, Error, Reply, Setpoint, TogetherBar, replies, requests::StartTogether,
};
use serde::{Deserialize, Serialize};

/// A start under way.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Together {
    ticket: Ticket,
    /// Those that are to move.
    members: Set,
    /// Those of the bus that must not.
    others: Set,
    /// When the permission of all of them to move ends, where it does.
    expires: Option<Instant>,
    /// The frame that starts them is under way: it is the motion of the first of them.
    executes: bool,
}

impl Together {
    fn all(&self) -> Set {
        self.members.with(self.others)
    }

    pub fn deadline(&self) -> Option<Instant> {
        self.expires
    }
}

impl Gateway {
    /// Whether motors of this bus are about to start together.
    pub(crate) fn starts_together_on(&self, bus: u8) -> bool {
        let all = self.together.map_or(Set::NONE, |together| together.all());
        self.axes.of(all).any(|axis| axis.config.bus() == Some(bus))
    }

    pub(crate) fn start_together(
        &mut self,
        now: Instant,
        request: &StartTogether,
        ticket: Ticket,
    ) -> Result<()> {
        let StartTogether { expires_at_us, members } = request;
        let first = members.first().map_or(0, |member| member.axis);
        let barred = |axis, reason| Err(Error::CannotStartTogether { axis, reason });
        if self.together.is_some() {
            return Err(Error::Busy { axis: first });
        }
        if members.len() < 2 {
            return barred(first, TogetherBar::TooFew);
        }
        let first_config = &self.axis(first)?.config;
        let bus_index = first_config.bus().unwrap_or(u8::MAX);
        let extended = protocol::has_extended_request_id(first_config);
        let mut together = Together {
            ticket,
            members: Set::NONE,
            others: Set::NONE,
            expires: None,
            executes: false,
        };
        for member in members {
            let index = member.axis;
            self.refuse_e_stopped(index)?;
            let axis = self.axis(index)?;
            let expires = axis.permission(now, member.epoch, *expires_at_us)?;
            if let Some(protocol) = axis.config.protocol()
                && !axis.can(Exchange::ExecuteAll)
            {
                return Err(Error::Unsupported { axis: index, protocol });
            }
            if together.members.has(index) {
                return barred(index, TogetherBar::Twice);
            }
            if axis.config.bus() != Some(bus_index) {
                return barred(index, TogetherBar::OtherBus);
            }
            if protocol::has_extended_request_id(&axis.config) != extended {
                return barred(index, TogetherBar::OtherFrameType);
            }
            // That the right speed waits is known from the motor's echo alone.
            if !protocol::answers_stops(&axis.config) {
                return Err(Error::CannotConfirm { axis: index });
            }
            axis.refuse_busy()?;
            rules::command(
                index,
                Setpoint::Velocity { velocity_rad_s: member.velocity_rad_s },
                &axis.config,
            )?;
            together.members.add(Set::of(index));
            together.expires = together.expires.or(expires);
        }
        let bus = self.bus(bus_index)?;
        if bus.is_off() {
            return Err(Error::BusOff { bus: bus_index });
        }
        // A motor that is no axis would obey as well.
        if !bus.config().is_some_and(|config| config.exclusive) {
            return barred(first, TogetherBar::SharedBus);
        }
        for axis in self.axes.iter().filter(|axis| axis.config.bus() == Some(bus_index)) {
            if together.members.has(axis.index) || !axis.can(Exchange::ExecuteAll) {
                continue;
            }
            let index = axis.index;
            // Nor that nothing waits in one beside them.
            if !protocol::answers_stops(&axis.config) {
                return Err(Error::CannotConfirm { axis: index });
            }
            match axis.state() {
                AxisState::Idle | AxisState::Holding | AxisState::Armed | AxisState::Active => {}
                AxisState::Unconfigured => return Err(axis.not_configured()),
                state => return Err(Error::NotIdle { axis: index, state }),
            }
            axis.refuse_busy()?;
            together.others.add(Set::of(axis.index));
        }
        for member in members {
            let velocity = Setpoint::Velocity { velocity_rad_s: member.velocity_rad_s };
            let command = rules::command(member.axis, velocity, &self.axis(member.axis)?.config)?;
            let command = protocol::to_wait(command);
            self.with_axis(now, member.axis, |axis, out| {
                axis.start(now, JobKind::Prepare { command }, ticket, out);
            })?;
        }
        self.each_axis(now, together.others, |axis, out| {
            let clears = axis.state() != AxisState::Active;
            axis.start(now, JobKind::StandBy { clears }, ticket, out);
        });
        self.together = Some(together);
        Ok(())
    }

    /// Goes on with a start under way, or gives it up: after everything that happens.
    pub(crate) fn go_on_together(&mut self, now: Instant) {
        let Some(together) = self.together else { return };
        if !self.axes.of(together.all()).all(Axis::takes_part) {
            // An axis that does not any more has said why.
            return self.give_up_together(now, None);
        }
        if let Some(expired) = together.expires.filter(|at| *at <= now) {
            let (now_us, expires_at_us) = (now.low_bits(), expired.low_bits());
            return self.give_up_together(now, Some(Error::Stale { now_us, expires_at_us }));
        }
        if !together.executes {
            if self.axes.of(together.all()).all(Axis::has_taken_part) {
                // All is prepared: the first of the axes sends what starts them.
                self.together = Some(Together { executes: true, ..together });
                let leader = together.members.lowest();
                self.each_axis(now, leader, |axis, out| axis.lead(now, together.expires, out));
            }
            return;
        }
        if self.axes.of(together.members.lowest()).any(Axis::has_executed) {
            self.together = None;
            self.each_axis(now, together.all(), |axis, out| {
                if together.members.has(axis.index) {
                    axis.follow(now, together.expires, out);
                } else {
                    axis.stand_down();
                }
            });
            // Not within the call: there it would be a constant as large as the largest reply.
            let reply = Reply::StartTogether(replies::Done {});
            self.outbox(now).answer(together.ticket, Ok(&reply));
        }
    }

    /// Stops every axis in whose motor a speed may wait.
    fn give_up_together(&mut self, now: Instant, error: Option<Error>) {
        let Some(together) = self.together.take() else { return };
        if let Some(error) = error {
            self.outbox(now).answer(together.ticket, Err(error));
        }
        self.each_axis(now, together.all(), |axis, out| {
            axis.stand_down();
            if together.members.has(axis.index) && axis.is_armed() {
                axis.halt(now, out);
            }
        });
    }
}
