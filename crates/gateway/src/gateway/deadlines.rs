//! What time alone brings about, and when it does.

use crate::MAX_LINKS_WIRE;
use crate::gateway::Gateway;
use crate::gateway::flight::FlightReading;
use crate::gateway::requests::{Running, Together};
use crate::gateway::unstopped::Why;
use crate::link::Link;
use crate::outbox::Outbox;
use crate::set::Set;
use crate::time::Instant;

impl Gateway {
    /// When [`handle`](Self::handle) must be called with [`Event::Tick`](crate::Event::Tick) if
    /// nothing else happens before: asked when what follows from an event has been sent, as it
    /// takes longer to find than that.
    pub fn next_deadline(&mut self) -> Option<Instant> {
        self.settle(self.now);
        self.spread_trips();
        if let Some(since) = self.unstopped.since() {
            return Some(since);
        }
        self.settle_buses();
        if cfg!(debug_assertions) {
            self.buses.iter().for_each(|bus| bus.assert_due(self.now, &self.axes));
        }
        let mut next = self.axes.due_again(self.now).min(self.links.due()).min(self.first_bus_due);
        let together = self.together.as_ref().and_then(Together::deadline);
        let running = self.running.as_ref().map(Running::deadline);
        let mut consider = |at: Option<Instant>| next = at.map_or(next, |at| next.min(at));
        consider(self.authority.deadline());
        consider(together);
        consider(running);
        consider(self.restart_at());
        consider(self.flight_reading.as_ref().map(FlightReading::deadline));
        (next < Instant::NEVER).then_some(next)
    }

    /// Works out anew when the buses are due that may have changed since, as of the latest event.
    pub(super) fn settle_buses(&mut self) {
        self.settle(self.now);
        for index in self.touched_buses.take() {
            if let Some(bus) = self.buses.get_mut(index) {
                bus.settle(self.now, &self.axes);
                // What is still to come makes it due.
                if !bus.may_expire(self.now) {
                    self.unwatched_buses.put(Set::of(index), false);
                }
            }
        }
        self.first_bus_due =
            self.buses.iter().fold(Instant::NEVER, |first, bus| first.min(bus.due()));
    }

    /// Everything that time alone brings about.
    pub(super) fn supervise(&mut self, now: Instant) {
        if self.authority.deadline().is_some_and(|deadline| deadline <= now) {
            self.lose_authority(now);
        }
        if self.links.due() <= now {
            self.tick_links(now);
        }
        self.give_up_flight_reading(now);
        // A period can wait until all that is to be stopped has been reached.
        if self.unstopped.is_empty() {
            self.tick_running(now);
        }
        self.settle(now);
        let due = self.axes.due(now);
        if !due.is_empty() {
            self.expire_axes(now, due);
        }
        // What of these is due may not have been worked out yet.
        let unwatched = self.unwatched_buses;
        let touched = self.touched_buses;
        let all_known = self.first_bus_due > now;
        let mut looked_at = if all_known { touched.with(unwatched) } else { Set::ALL };
        if !self.unstopped.is_empty() {
            looked_at = looked_at.and(self.buses_whose_stops_wait_for_time());
        }
        if !looked_at.is_empty() {
            self.unwatched_buses.put(looked_at, false);
            self.expire_buses(now, looked_at, unwatched);
        }
    }

    /// Buses on which a stop may come due by time alone; on the others it follows from an event,
    /// and all else can wait until all that is to be stopped has been reached.
    fn buses_whose_stops_wait_for_time(&self) -> Set {
        let waiting = self.buses.iter().filter(|bus| bus.stops_wait_for_time());
        waiting.map(|bus| bus.index()).collect()
    }

    /// What time has brought to these buses.
    fn expire_buses(&mut self, now: Instant, looked_at: Set, unwatched: Set) {
        let mut due = self.touched_buses.and(looked_at);
        let Self { buses, axes, links, .. } = self;
        let mut out = Outbox::new(now, links);
        for index in looked_at {
            let Some(bus) = buses.get_mut(index) else { break };
            let is_due = due.has(index) || bus.due() <= now;
            let may_act = is_due || unwatched.has(index) && bus.may_expire(now);
            let has_acted = may_act && bus.expire(now, axes, &mut out);
            due.put(Set::of(index), is_due || has_acted);
        }
        self.touched_buses.add(due);
        self.changed_buses.add(due);
        self.settle(now);
    }

    /// What time has brought to these axes; those that stop have it when they are reached.
    fn expire_axes(&mut self, now: Instant, due: Set) {
        if due.len() > 1 && self.unstopped.is_empty() {
            let expired = self.axes.those(due, |axis| axis.has_expired(now));
            if expired.len() > 1 {
                self.stop_many(now, expired, Why::Expired);
            }
        }
        let mut out = Outbox::new(now, &mut self.links);
        let due = due.without(self.unstopped.axes());
        self.axes.each(due, |axis| axis.expire(now, &mut out));
        self.settle(now);
    }

    /// Begins the periods of subscriptions that are due.
    fn tick_links(&mut self, now: Instant) {
        for link in 0..MAX_LINKS_WIRE {
            let deadline = self.links.get(usize::from(link)).and_then(Link::deadline);
            if deadline.is_none_or(|at| at > now.as_micros()) {
                continue;
            }
            let lapses = self.links.get_mut(link).is_some_and(|link| link.tick(now.as_micros()));
            self.links.touch(link);
            if lapses {
                self.watch();
            }
        }
    }
}
