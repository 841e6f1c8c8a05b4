//! What stops many axes at once: of each bus the first stop leaves before the core takes in what
//! follows for all of them.
//!
//! Sixteen axes take the core longer than a frame takes the bus. So the event only notes whom it
//! has still to reach, and why; that is stored. Who then polls a bus has the axis stopped there
//! whose stop can go first. All others are due at once: each tick reaches one of them, and no
//! request is executed before.

use crate::axis::{Axis, Is};
use crate::gateway::Gateway;
use crate::gateway::requests::ready_bus;
use crate::outbox::Outbox;
use crate::port::Event;
use crate::protocol;
use crate::set::Set;
use crate::time::Instant;
use host_protocol::{AxisState, Error, TripReason};
use serde::{Deserialize, Serialize};

/// The axes that the latest event stops and has still to reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Unstopped {
    axes: Set,
    why: Why,
    since: Instant,
}

/// Why many axes stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Why {
    /// The e-stop: also those at rest, as something else may have set their motors in motion.
    EStop,
    /// A host asks for it.
    Asked,
    /// The host in command is silent: what moves trips, what is armed is disarmed.
    HostSilent,
    /// The host in command wants it no longer.
    Released,
    /// Their setpoints expire together.
    Expired,
    /// This axis of their group has tripped.
    Group { axis: u8 },
}

impl Unstopped {
    pub const NONE: Self =
        Self { axes: Set::NONE, why: Why::EStop, since: Instant::from_micros(0) };

    pub fn is_empty(self) -> bool {
        self.axes.is_empty()
    }

    pub fn axes(self) -> Set {
        self.axes
    }

    /// When they are due.
    pub fn since(self) -> Option<Instant> {
        (!self.axes.is_empty()).then_some(self.since)
    }
}

impl Gateway {
    /// Latches the e-stop and stops every axis.
    pub(crate) fn e_stop(&mut self, now: Instant) {
        self.stop_many(now, self.axes.which(Is::Configured), Why::EStop);
        if !self.e_stopped {
            self.e_stopped = true;
            self.outbox(now).event(&host_protocol::Event::EStopLatched {});
        }
    }

    /// Has these axes stop. What was to be stopped before is reached first.
    pub(crate) fn stop_many(&mut self, now: Instant, axes: Set, why: Why) {
        self.finish_stops();
        self.unstopped = Unstopped { axes, why, since: now };
        for bus in (0u8..).take(self.buses.len()) {
            if !self.axes.on(bus).and(axes).is_empty() {
                self.touch_buses(Set::of(bus));
            }
        }
    }

    /// Has what is to be stopped on a bus begin with the axis whose stop can go first: one whose
    /// frame the port still has waits for that.
    #[inline(always)]
    pub(crate) fn begin_stops(&mut self, bus: u8) {
        if !self.unstopped.is_empty() {
            self.reach_first(bus);
        }
    }

    #[inline(never)]
    fn reach_first(&mut self, bus: u8) {
        while self.axes.which_on(Is::FirstStop, bus).is_empty() {
            let here = self.axes.of(self.unstopped.axes.and(self.axes.on(bus)));
            let waits = |axis: &Axis| axis.transactions.has_with_port(|_| true);
            let first = here.min_by_key(|axis| (waits(axis), protocol::stop_id(&axis.config)));
            let Some(axis) = first else { return };
            self.reach(Set::of(axis.index));
        }
    }

    /// Goes on before an event is taken in: what buses do is as if it had come before, but ends no
    /// arming; a tick reaches one axis more, and all else waits for all.
    #[inline(always)]
    pub(crate) fn go_on_stops(&mut self, event: &Event<'_>) {
        if self.unstopped.is_empty() {
            return;
        }
        match event {
            Event::CanReceived { .. }
            | Event::SerialReceived { .. }
            | Event::Transmitted { .. }
            | Event::Cancelled { .. }
            | Event::HostBytes { .. } => {
                let is_arming = |axis: &Axis| axis.state() == AxisState::Arming;
                let arming = self.axes.those(self.unstopped.axes, is_arming);
                if !arming.is_empty() {
                    self.reach(arming);
                }
            }
            Event::Tick => self.reach(self.unstopped.axes.lowest()),
            _ => self.finish_stops(),
        }
    }

    /// Reaches all others.
    #[inline(always)]
    pub(crate) fn finish_stops(&mut self) {
        if !self.unstopped.is_empty() {
            self.reach(self.unstopped.axes);
        }
    }

    #[inline(never)]
    fn reach(&mut self, axes: Set) {
        self.unstopped.axes.put(axes, false);
        let Unstopped { why, since: at, .. } = self.unstopped;
        let mut out = Outbox::new(at, &mut self.links);
        self.axes.each(axes, |axis| match why {
            Why::EStop => axis.trip(at, TripReason::EStop, &mut out),
            Why::Asked => {}
            Why::HostSilent if axis.state() == AxisState::Active => {
                axis.trip(at, TripReason::HostSilent, &mut out)
            }
            Why::HostSilent | Why::Released => axis.disarm(at, &mut out),
            Why::Expired => axis.expire(at, &mut out),
            Why::Group { axis: origin } => {
                axis.trip(at, TripReason::Group { axis: origin }, &mut out);
                axis.take_spreading_trip();
            }
        });
        if matches!(why, Why::EStop | Why::Asked) {
            self.halt_those(at, axes);
        }
        self.retention.has_tripped();
        self.settle(self.now);
    }

    fn halt_those(&mut self, now: Instant, those: Set) {
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

    /// One axis of a trip group has tripped: the others do.
    pub(crate) fn spread_trips(&mut self, now: Instant) {
        while self.unstopped.is_empty()
            && let Some(axis) = self.axes.which(Is::Spreading).into_iter().next()
        {
            let Some(axis) = self.axes.get_mut(axis) else { return };
            let (origin, Some(group)) = (axis.index, axis.take_spreading_trip()) else { continue };
            self.settle(now);
            let is_other = |axis: &Axis| axis.index != origin && axis.trip_group() == Some(group);
            let others = self.axes.those(self.axes.which(Is::Configured), is_other);
            self.stop_many(now, others, Why::Group { axis: origin });
        }
    }
}
