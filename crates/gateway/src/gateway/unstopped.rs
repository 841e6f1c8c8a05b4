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

/// The axes that must stop and have still to be reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Unstopped {
    /// By the latest event.
    axes: Set,
    why: Why,
    since: Instant,
    /// By trips in their groups, and whose trips these are.
    grouped: Set,
    origins: Set,
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
}

impl Unstopped {
    pub const NONE: Self = Self {
        axes: Set::NONE,
        why: Why::EStop,
        since: Instant::from_micros(0),
        grouped: Set::NONE,
        origins: Set::NONE,
    };

    pub fn is_empty(self) -> bool {
        self.axes().is_empty()
    }

    pub fn axes(self) -> Set {
        self.axes.with(self.grouped)
    }

    /// Those of them that stop from rest as well.
    pub fn stopped_at_rest_too(self) -> Set {
        if matches!(self.why, Why::EStop | Why::Asked) { self.axes } else { Set::NONE }
    }

    /// When they are due.
    pub fn since(self) -> Option<Instant> {
        (!self.is_empty()).then_some(self.since)
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
        self.unstopped = Unstopped { axes, why, since: now, ..Unstopped::NONE };
        self.touch_buses_of(axes);
    }

    /// Has the others of their groups stop where axes have tripped.
    #[inline(always)]
    pub(crate) fn spread_trips(&mut self) {
        let origins = self.axes.which(Is::Spreading);
        if !origins.is_empty() {
            self.spread(origins);
        }
    }

    #[inline(never)]
    fn spread(&mut self, origins: Set) {
        if self.unstopped.is_empty() {
            self.unstopped = Unstopped { since: self.now, ..Unstopped::NONE };
        }
        for origin in origins {
            let Some(axis) = self.axes.get_mut(origin) else { continue };
            let Some(group) = axis.take_spreading_trip() else { continue };
            let is_other =
                |axis: &Axis| axis.trip_group() == Some(group) && usize::from(axis.index) != origin;
            let others = self.axes.those(self.axes.which(Is::Configured), is_other);
            self.unstopped.origins.add(Set::of(origin));
            self.unstopped.grouped.add(others);
            self.touch_buses_of(others);
        }
        self.settle(self.now);
    }

    fn touch_buses_of(&mut self, axes: Set) {
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
        self.spread_trips();
        if !self.unstopped.is_empty() {
            self.reach_first(bus);
        }
    }

    /// Whether one more axis of a bus may be reached: there is one, and none is owed its first stop
    /// that was reached before.
    #[inline(never)]
    pub(crate) fn may_begin_stop(&self, bus: u8) -> bool {
        let (since, here) = (self.unstopped.since, self.axes.on(bus));
        let is_reached = |axis: &Axis| axis.stop().is_some_and(|stop| stop.since >= since);
        !self.unstopped.axes().and(here).is_empty()
            && !self.axes.of(self.axes.which(Is::FirstStop).and(here)).any(is_reached)
    }

    /// As long as the first stop of one that was reached is owed, it keeps back what those of the
    /// others would. One from before may have been held up for too long to do so: who does not stop
    /// yet begins beside it.
    #[inline(never)]
    fn reach_first(&mut self, bus: u8) {
        while self.may_begin_stop(bus) {
            let here = self.axes.on(bus);
            let unstopped = self.unstopped.axes().and(here);
            let owed = self.axes.which(Is::FirstStop).and(here);
            let stopping = if owed.is_empty() { Set::NONE } else { self.axes.which(Is::Stopping) };
            let begin = self.axes.of(unstopped.without(stopping));
            let waits = |axis: &Axis| axis.transactions.with_port().is_some();
            let key = |axis: &&Axis| (waits(axis), protocol::stop_id(&axis.config));
            let Some(first) = begin.min_by_key(key) else { return };
            self.reach(Set::of(first.index));
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
                let arming = self.axes.those(self.unstopped.axes(), is_arming);
                if !arming.is_empty() {
                    self.reach(arming);
                }
            }
            Event::Tick => self.reach(self.unstopped.axes().lowest()),
            _ => self.finish_stops(),
        }
    }

    /// Reaches all others, and the groups of those that trip.
    #[inline(always)]
    pub(crate) fn finish_stops(&mut self) {
        self.spread_trips();
        while !self.unstopped.is_empty() {
            self.reach(self.unstopped.axes());
        }
    }

    #[inline(never)]
    fn reach(&mut self, axes: Set) {
        let Unstopped { why, since: at, grouped, .. } = self.unstopped;
        let grouped = grouped.and(axes);
        let axes = self.unstopped.axes.and(axes);
        self.unstopped.axes.put(axes, false);
        self.unstopped.grouped.put(grouped, false);
        let mut out = Outbox::new(at, &mut self.links);
        self.axes.each(axes, |axis| match why {
            Why::EStop => axis.trip(at, TripReason::EStop, &mut out),
            Why::Asked => {}
            Why::HostSilent if axis.state() == AxisState::Active => {
                axis.trip(at, TripReason::HostSilent, &mut out)
            }
            Why::HostSilent | Why::Released => axis.disarm(at, &mut out),
            Why::Expired => axis.expire(at, &mut out),
        });
        if matches!(why, Why::EStop | Why::Asked) {
            self.halt_those(at, axes);
        }
        for axis in grouped {
            self.trip_with_group(axis);
        }
        self.retention.is_complete = false;
        self.settle(self.now);
        self.spread_trips();
    }

    /// An axis trips as another one of its group has.
    fn trip_with_group(&mut self, index: usize) {
        let Self { axes, links, unstopped, .. } = self;
        let group = axes.get(index).and_then(Axis::trip_group);
        let origin = axes.of(unstopped.origins).find(|origin| origin.trip_group() == group);
        let Some(axis) = origin.map(|origin| origin.index) else { return };
        let Some(other) = axes.get_mut(index) else { return };
        other.trip(self.now, TripReason::Group { axis }, &mut Outbox::new(self.now, links));
        other.take_spreading_trip();
    }

    fn halt_those(&mut self, now: Instant, those: Set) {
        let Self { axes, buses, links, .. } = self;
        let mut out = Outbox::new(now, links);
        axes.each(those, |axis| {
            // Where no bus carries it an axis at rest has no motor; on one that is off its stop
            // waits until the bus is back.
            let carried = !matches!(ready_bus(buses, axis), Err(Error::BusNotConfigured { .. }));
            // What has begun to stop just now, as by this e-stop, is not asked again.
            let has_just_begun = axis.stop().is_some_and(|stop| stop.since == now);
            if !has_just_begun && (!axis.is_idle_or_holding() || carried) {
                axis.halt(now, &mut out);
            }
        });
    }
}
