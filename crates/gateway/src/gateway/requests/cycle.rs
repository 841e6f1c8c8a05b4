//! The cycle: axes that are armed in one epoch take their setpoints from one request, which is
//! answered by the state of all of them.
//!
//! A setpoint of a cycle is a setpoint like any other (GUARANTEES G2), and each axis ends its own
//! part: by the reply of its motor, by the end of the time for that reply, or by a stop.

use super::Result;
use crate::MAX_AXES_WIRE;
use crate::axis::{Axis, Is, JobKind};
use crate::gateway::Gateway;
use crate::outbox::Ticket;
use crate::set::Set;
use crate::time::Instant;
use host_protocol::{
    Bytes, Error, FixedU32, MAX_CYCLE_AXES, Reply, Request, StateFields, replies, requests,
};
use serde::{Deserialize, Serialize};

/// Axes that are being armed in one epoch.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Arming {
    ticket: Ticket,
    axes: Set,
    epoch: u32,
}

/// A cycle under way.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Cycle {
    ticket: Ticket,
    axes: Set,
    fields: StateFields,
}

/// Refuses a request whose fields contradict each other, as one that cannot be read.
pub(crate) fn check_body(request: &Request) -> Result<()> {
    let is_whole = match request {
        Request::ArmTogether(request) => request.axes != 0,
        Request::Cycle(request) => {
            request.axes != 0 && request.axes.count_ones() as usize == request.setpoints.len()
        }
        Request::RunCycle(request) => request.axes.count_ones() as usize <= MAX_CYCLE_AXES,
        _ => true,
    };
    if is_whole { Ok(()) } else { Err(Error::BadBody { number: request.number() }) }
}

/// The axes of a mask.
pub(super) fn axes_of(mask: u32) -> Result<Set> {
    let axes = Set::from_bits(mask);
    match axes.numbers().find(|axis| *axis >= MAX_AXES_WIRE) {
        Some(axis) => Err(Error::UnknownAxis { axis, max_axes: MAX_AXES_WIRE }),
        None => Ok(axes),
    }
}

impl Gateway {
    pub(crate) fn arm_together(&mut self, now: Instant, mask: u32, ticket: Ticket) -> Result<()> {
        let axes = axes_of(mask)?;
        if let Some(arming) = &self.arming {
            let axis = self.axes.of(arming.axes).next().map_or(0, |axis| axis.index);
            return Err(Error::Busy { axis });
        }
        for axis in axes.numbers() {
            self.check_arm(now, axis)?;
        }
        let epoch = self.next_epoch()?;
        for axis in axes.numbers() {
            self.start(now, axis, JobKind::Arm { epoch, alone: false }, ticket)?;
        }
        self.arming = Some(Arming { ticket, axes, epoch });
        Ok(())
    }

    /// Ends the arming of several axes: when all are armed, or when one is not any more.
    pub(crate) fn go_on_arming(&mut self, now: Instant) {
        let Some(Arming { ticket, axes, epoch }) = self.arming else { return };
        let is_out = |axis: &&Axis| !axis.is_arming_in(epoch) && !axis.is_armed_in(epoch);
        let out = self.axes.of(axes).find(is_out).map(|out| (out.index, out.state()));
        if let Some((axis, state)) = out {
            self.arming = None;
            // One that was refused has said why, and this comes too late.
            self.outbox(now).answer(ticket, Err(Error::Aborted { axis, state }));
            self.each_axis(now, axes, |axis, out| {
                if axis.is_arming_in(epoch) || axis.is_armed_in(epoch) {
                    axis.disarm(now, out);
                }
            });
        } else if self.axes.of(axes).all(|axis| axis.is_armed_in(epoch)) {
            self.arming = None;
            let armed = Reply::ArmTogether(replies::ArmedTogether { epoch });
            self.outbox(now).answer(ticket, Ok(&armed));
        }
    }

    pub(crate) fn cycle(
        &mut self,
        now: Instant,
        request: &requests::Cycle,
        ticket: Ticket,
    ) -> Result<()> {
        let axes = axes_of(request.axes)?;
        request.fields.check()?;
        self.end_cycle(now);
        for (axis, setpoint) in axes.numbers().zip(&request.setpoints) {
            let setpoint = requests::Setpoint {
                axis,
                epoch: request.epoch.0,
                expires_at_us: request.expires_at_us.0,
                setpoint: *setpoint,
            };
            let taken = self.setpoint(now, &setpoint);
            self.axis_mut(axis)?.cycle(taken);
        }
        self.cycle = Some(Cycle { ticket, axes, fields: request.fields });
        Ok(())
    }

    /// Answers a cycle whose axes have all ended their parts.
    pub(crate) fn go_on_cycle(&mut self, now: Instant) {
        if let Some(cycle) = &self.cycle
            && self.axes.which(Is::Cycling).and(cycle.axes).is_empty()
        {
            self.end_cycle(now);
        }
    }

    /// Answers a cycle, whether its axes have ended their parts or not.
    fn end_cycle(&mut self, now: Instant) {
        let Some(Cycle { ticket, axes, fields }) = self.cycle.take() else { return };
        let mut report = replies::CycleReport {
            time_us: FixedU32(now.low_bits()),
            fields,
            axes: 0,
            states: Bytes::new(),
        };
        self.axes.of(axes).for_each(|axis| report.push(axis.cycle_state(now, fields)));
        self.outbox(now).answer(ticket, Ok(&Reply::Cycle(report)));
    }
}
