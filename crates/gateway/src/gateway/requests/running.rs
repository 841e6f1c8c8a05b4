//! The free-running cycle: the gateway itself sends the setpoints in force anew in each period,
//! reads what their replies do not tell, and tells the host in command how every axis is.
//!
//! Setpoints come as ever, by `Setpoint` and `Cycle`, and end as ever; the cycle belongs to the
//! right to command and ends with it.

use super::Result;
use super::cycle::axes_of;
use crate::axis::{Axis, Is, PERIOD_US, Waits};
use crate::bus::shortest_period;
use crate::gateway::Gateway;
use crate::set::Set;
use crate::time::{Duration, Instant};
use host_protocol::{
    Bytes, CycleEvent, Error, FixedU32, MAX_FRAME, Overruns, Quantity, StateFields, requests,
};
use serde::{Deserialize, Serialize};

/// A period.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Period {
    /// Counts from 0.
    number: u32,
    /// When it was due to begin, and how much later it did, µs.
    due: Instant,
    late_us: u32,
    /// Until every axis had ended its part, or the next was due, µs; nothing before.
    took_us: Option<u32>,
}

/// A free-running cycle.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Running {
    link: u8,
    axes: Set,
    fields: StateFields,
    length: Duration,
    /// The one under way, or the last one that ended.
    period: Period,
    /// The last one that ended, where the host has not been told of it.
    untold: Option<Period>,
    /// The least and the most that one was late, µs.
    lateness: (u32, u32),
    overruns: Overruns,
    /// The axis whose slow fields were told last.
    slow_axis: u8,
}

impl Running {
    /// When the next period is due to begin.
    pub fn deadline(&self) -> Instant {
        self.period.due + self.length
    }

    /// The period has ended. One of which the host has still to be told is lost.
    fn end(&mut self, now: Instant) {
        self.period.took_us = Some(now.since(self.period.due).as_micros_u32());
        if self.untold.replace(self.period).is_some() {
            count(&mut self.overruns.host, 1);
        }
    }

    /// Begins the period that is due now. Those that nobody could begin are passed over.
    fn begin(&mut self, now: Instant) {
        let length_us = self.length.as_micros().max(1);
        let passed = now.since(self.deadline()).as_micros() / length_us;
        let due = self.deadline() + self.length.times(passed);
        let passed = u32::try_from(passed).unwrap_or(u32::MAX);
        count(&mut self.overruns.gateway, passed);
        let late_us = now.since(due).as_micros_u32();
        self.lateness = (self.lateness.0.min(late_us), self.lateness.1.max(late_us));
        let number = self.period.number.wrapping_add(1).wrapping_add(passed);
        self.period = Period { number, due, late_us, took_us: None };
    }
}

fn count(counter: &mut u32, more: u32) {
    *counter = counter.saturating_add(more);
}

impl Gateway {
    pub(crate) fn run_cycle(
        &mut self,
        now: Instant,
        request: &requests::RunCycle,
        link: u8,
    ) -> Result<()> {
        let axes = axes_of(request.axes)?;
        request.fields.check()?;
        let period = Duration::from_micros(request.period_us.into());
        if !axes.is_empty() {
            Quantity::Period.check(request.period_us, PERIOD_US)?;
            self.check_period(axes, period, request.fields)?;
        }
        self.stop_running();
        if axes.is_empty() {
            return Ok(());
        }
        let late_us = 0;
        let running = Running {
            link,
            axes,
            fields: request.fields,
            length: period,
            period: Period { number: 0, due: now, late_us, took_us: None },
            untold: None,
            lateness: (late_us, late_us),
            overruns: Overruns::default(),
            slow_axis: u8::MAX,
        };
        let fields = request.fields;
        self.axes.each(axes, |axis| axis.begin_part(now, running.deadline(), fields));
        self.running = Some(running);
        Ok(())
    }

    /// Refuses a period that a bus could not keep at its best.
    fn check_period(&self, axes: Set, period: Duration, fields: StateFields) -> Result<()> {
        const ALL: u32 = 1_000;
        for bus in &self.buses {
            let Some(config) = bus.config() else { continue };
            let here = self.axes.of(self.axes.on(bus.index()).and(axes));
            let shortest = shortest_period(bus, config, here, fields);
            if shortest.is_none_or(|shortest| shortest > period) {
                let needed = shortest.map_or(u64::MAX, |shortest| {
                    (shortest.as_micros() * u64::from(ALL)).div_ceil(period.as_micros().max(1))
                });
                return Err(Error::BusOverloaded {
                    bus: bus.index(),
                    needed_permille: u32::try_from(needed).unwrap_or(u32::MAX),
                    available_permille: ALL,
                });
            }
        }
        Ok(())
    }

    /// The free-running cycle is over.
    pub(crate) fn stop_running(&mut self) {
        if let Some(running) = self.running.take() {
            self.axes.each(running.axes, Axis::leave_cycle);
        }
    }

    /// Begins the next period, if it is time.
    pub(crate) fn tick_running(&mut self, now: Instant) {
        let Self { running: Some(running), axes, links, .. } = self else { return };
        if now < running.deadline() {
            return;
        }
        if running.period.took_us.is_none() {
            let open = axes.which(Is::InPeriod).and(running.axes);
            match axes.of(open).filter_map(|axis| axis.part_waits(now)).max() {
                Some(Waits::ForBus) => count(&mut running.overruns.bus, 1),
                Some(Waits::ForMotor) => count(&mut running.overruns.motor, 1),
                None => {}
            }
            running.end(running.deadline());
            links.changed_by_cycle(running.link);
        }
        running.begin(now);
        let (next, fields) = (running.deadline(), running.fields);
        axes.each(running.axes, |axis| axis.begin_part(now, next, fields));
    }

    /// Ends a period in which every axis has ended its part.
    pub(crate) fn go_on_running(&mut self, now: Instant) {
        let Self { running: Some(running), axes, links, .. } = self else { return };
        if running.period.took_us.is_none() && axes.which(Is::InPeriod).and(running.axes).is_empty()
        {
            running.end(now);
            links.changed_by_cycle(running.link);
        }
    }

    /// Writes what a host is told of the period that has ended last, where it has not been.
    pub(crate) fn poll_cycle_event(
        &mut self,
        now: Instant,
        link: u8,
        out: &mut [u8; MAX_FRAME],
    ) -> Option<usize> {
        let Self { running, axes, links, .. } = self;
        let running = running.as_mut().filter(|running| running.link == link)?;
        let period = running.untold.take()?;
        let is_before = period.number != running.period.number;
        let mut event = CycleEvent {
            period: period.number,
            due_us: FixedU32(period.due.low_bits()),
            late_us: period.late_us,
            jitter_us: running.lateness.1 - running.lateness.0,
            took_us: period.took_us.unwrap_or(u32::MAX),
            overruns: running.overruns,
            fields: StateFields::from_bits(running.fields.bits() & CycleEvent::FAST.bits()),
            axes: 0,
            states: Bytes::new(),
            slow: None,
        };
        let fields = event.fields;
        axes.of(running.axes).for_each(|axis| event.push(axis.part_state(now, fields, is_before)));
        if fields != running.fields {
            let slow =
                running.axes.behind(running.slow_axis).next().and_then(|axis| axes.get(axis));
            event.slow = slow.map(|axis| axis.slow_state(now, running.fields));
            running.slow_axis = slow.map_or(u8::MAX, |axis| axis.index);
        }
        let now_us = now.as_micros();
        let link = links.get_mut(link)?;
        link.write(|sequence, lost| event.encode_frame(sequence, lost, now_us, out))
    }
}
