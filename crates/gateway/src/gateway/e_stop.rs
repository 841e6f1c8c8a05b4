//! The e-stop: of each bus the first stop leaves before the core takes in what follows from it.
//!
//! Sixteen axes take the core longer than a frame takes the bus. So the event only latches the
//! e-stop and notes whom it has still to reach; that is stored. Who then polls a bus has the axis
//! stopped there whose stop goes first. All others are due at once: the next event, a tick where
//! nothing else comes, begins with them, and no request is executed before.

use crate::axis::Is;
use crate::gateway::Gateway;
use crate::gateway::requests::ready_bus;
use crate::outbox::Outbox;
use crate::protocol;
use crate::set::Set;
use crate::time::Instant;
use host_protocol::{Error, Event, TripReason};

impl Gateway {
    /// Latches the e-stop and stops every axis, also those at rest: something else may have set
    /// their motors in motion.
    pub(crate) fn e_stop(&mut self, now: Instant) {
        self.unstopped = self.axes.which(Is::Configured);
        for bus in (0u8..).take(self.buses.len()) {
            if !self.axes.on(bus).is_empty() {
                self.touch_buses(Set::of(bus));
            }
        }
        if !self.e_stopped {
            self.e_stopped = true;
            self.outbox(now).event(&Event::EStopLatched {});
        }
    }

    /// Has the e-stop reach the axis on a bus whose stop goes first.
    #[inline(always)]
    pub(crate) fn begin_e_stop(&mut self, bus: u8) {
        if !self.unstopped.is_empty() {
            self.reach_first(bus);
        }
    }

    #[inline(never)]
    fn reach_first(&mut self, bus: u8) {
        while self.axes.which_on(Is::FirstStop, bus).is_empty() {
            let here = self.axes.of(self.unstopped.and(self.axes.on(bus)));
            let Some(axis) = here.min_by_key(|axis| protocol::stop_id(&axis.config)) else {
                return;
            };
            self.reach(Set::of(axis.index), self.now);
        }
    }

    /// Has the e-stop, which came at `at`, reach all others.
    #[inline(always)]
    pub(crate) fn finish_e_stop(&mut self, at: Instant) {
        if !self.unstopped.is_empty() {
            self.reach(self.unstopped, at);
        }
    }

    /// Trips what moves, and stops all.
    #[inline(never)]
    fn reach(&mut self, axes: Set, at: Instant) {
        self.unstopped.put(axes, false);
        let mut out = Outbox::new(at, &mut self.links);
        self.axes.each(axes, |axis| axis.trip(at, TripReason::EStop, &mut out));
        self.stop_those(at, axes);
        self.retention.has_tripped();
        self.settle(self.now);
    }

    /// Stops these axes.
    pub(crate) fn stop_those(&mut self, now: Instant, those: Set) {
        let Self { axes, buses, links, .. } = self;
        let mut out = Outbox::new(now, links);
        axes.each(those, |axis| {
            // Where no bus carries it an axis at rest has no motor; on one that is off its stop
            // waits until the bus is back.
            let carried = !matches!(ready_bus(buses, axis), Err(Error::BusNotConfigured { .. }));
            // What has begun to stop just now, as by this e-stop, is not asked again.
            let has_just_begun = axis.stop().is_some_and(|stop| stop.since() == now);
            if !has_just_begun && (!axis.is_idle_or_holding() || carried) {
                axis.halt(now, &mut out);
            }
        });
    }
}
