//! What time brings about: expiry, silence, and stops that are due (G2 to G5).

use super::together::bit_of;
use crate::axis::{Cause, Duty};
use crate::bus::{ACKNOWLEDGE_FRAMES, ACKNOWLEDGE_US, Held, SOFTWARE_US};
use crate::oracle::Oracle;
use crate::violation::Check;
use crate::wire::Told;

/// Missing replies that trip must span this (G3).
const SILENT_SPAN_US: u64 = 50_000;
/// Allowance: how far apart the requests are whose replies are missed. An armed axis is asked or
/// refreshed every 20 ms where its motor's timeout is not known, else as often as its polls are
/// configured; each unanswered request takes two reply windows.
const SILENT_STEP_US: u64 = 50_000;
/// Allowance: how long a stop that was answered by nothing may take to be sent again, beside the
/// rhythm of G4: the steps of the brake are slow ones.
const REPEAT_SLACK_US: u64 = 400_000;
/// However a request ends, it has ended by then.
const RESULT_WITHIN_US: u64 = 4_000_000;

impl Oracle {
    /// Time passes up to `now`: what runs out does so at its own time.
    pub(crate) fn advance(&mut self, now: u64) {
        self.buses.iter_mut().for_each(|bus| bus.count_missed(now));
        if let Some((_, heard_us)) = self.holder
            && heard_us + self.silence_us <= now
        {
            self.lose_authority(heard_us + self.silence_us);
        }
        for index in 0..self.axes.len() {
            if !self.axes[index].armed {
                continue;
            }
            let axis = &mut self.axes[index];
            let expired =
                |p: &&crate::axis::Permit| p.in_force && p.expires_us.is_some_and(|at| at <= now);
            let at = axis.permits.iter().find(expired).and_then(|p| p.expires_us);
            axis.permits.retain(|p| p.expires_us.is_none_or(|at| at > now));
            if let Some(at) = at {
                // A host that does not read has not been told that its newer setpoint was taken: it
                // may have been.
                match axis
                    .permits
                    .iter_mut()
                    .rfind(|p| (!p.is_relative || p.sent) && !p.is_of_a_start_to_come())
                {
                    Some(newer) => newer.in_force = true,
                    None => {
                        self.owe_stop(index, Cause::Expired, at);
                        continue;
                    }
                }
            }
            self.watch_controller(now, index);
            self.watch_motor(now, index);
        }
    }

    /// A motion frame that nobody acknowledges.
    fn watch_controller(&mut self, now: u64, index: usize) {
        let axis = &self.axes[index];
        let Some(bus) = axis.bus().and_then(|bus| self.buses.get(bus)).filter(|bus| bus.is_can())
        else {
            return;
        };
        let number = u8::try_from(index).ok();
        let Some(held) = bus
            .held
            .iter()
            .find(|h| h.is_motion && !h.prepares && h.axis == number && !h.asked_back)
        else {
            return;
        };
        let within = (ACKNOWLEDGE_US + ACKNOWLEDGE_FRAMES * bus.frame_us()).min(axis.ttl_us());
        if held.handed_us + within <= now {
            let at = held.handed_us + within;
            self.owe_stop(index, Cause::NotAcknowledged, at);
        }
    }

    /// A motor that answers nothing at all.
    fn watch_motor(&mut self, now: u64, index: usize) {
        let axis = &self.axes[index];
        let Some(bus) = axis.bus().and_then(|bus| self.buses.get(bus)) else { return };
        let (heard_us, outside) = axis.heard;
        let silent = (now - heard_us).saturating_sub(bus.outside_us(now) - outside);
        let step = SILENT_STEP_US.max(axis.fault_poll_us().min(axis.state_poll_us()));
        let within = SILENT_SPAN_US + (axis.missed_replies() + 1) * (step + 2 * bus.window_us);
        if silent > within {
            self.owe_stop(index, Cause::Silent, now);
        }
    }

    /// Stops that should have left, motion that should have been asked back, results that should
    /// have come.
    pub(crate) fn check_due(&mut self, now: u64) {
        for index in 0..self.axes.len() {
            self.check_stop(now, index);
            self.check_unsent(now, index);
        }
        self.check_kept(now);
        self.check_bus_off(now);
        self.check_raw_open(now);
        for index in 0..self.links.len() {
            let link = &mut self.links[index];
            if link.drained_us == Some(now) {
                link.reads_since.get_or_insert(now);
            } else {
                link.reads_since = None;
            }
            if let Some(record) = link.overdue(now, RESULT_WITHIN_US) {
                let seen = format!("link {index}: {:?} of {} µs", record.request, record.at_us);
                // Said once.
                link.reads_since = None;
                self.broken(Check::ResultMissing, now, seen);
            }
        }
    }

    fn check_stop(&mut self, now: u64, index: usize) {
        let axis = &self.axes[index];
        let (Some(duty), Some(bus)) = (&axis.duty, axis.bus()) else { return };
        let axes = self.axes_on(bus);
        let outside = self.not_ours_us(now, axis);
        let bus = &self.buses[bus];
        let used =
            |from: u64, before: u64| (now - from).saturating_sub(outside.saturating_sub(before));
        let Some((last_us, outside_then)) = duty.last else {
            let used = used(duty.since_us, duty.outside_us);
            // What is on the wire now and goes before it is counted when it has ended.
            let number = u8::try_from(index).ok();
            let handed = bus.held.iter().any(|held| held.is_stop && held.axis == number);
            let on_the_wire = if handed { bus.frame_us() } else { 0 };
            let bound = bus.stop_bound_us(duty.k, axis.protocol(), axes) + on_the_wire;
            if used > bound && !duty.rests {
                let seen = format!(
                    "axis {index}: no stop after {used} µs, {:?} at {}",
                    duty.cause, duty.since_us
                );
                self.broken(Check::StopLate, now, seen);
                self.forgive(index, now, outside);
            }
            return;
        };
        // On a bus that is off there is nothing to repeat; a stop that ends idle is over.
        let watched = matches!(axis.told, Told::Tripped { .. } | Told::Stopping);
        let silence = axis.timeouts_ms().map(|ms| 1_500 * u64::from(ms)).max().unwrap_or(0);
        let rhythm = axis.stop_repeat_us().max(if axis.unreachable { silence } else { 0 });
        let within = rhythm + REPEAT_SLACK_US + 8 * bus.window_us;
        if watched && used(last_us, outside_then) > within {
            let seen = format!("axis {index}: the last stop left at {last_us}, {duty:?}");
            self.broken(Check::StopForgotten, now, seen);
            self.forgive(index, now, outside);
        }
    }

    /// What has been told once is not told at every instant.
    fn forgive(&mut self, index: usize, now: u64, outside: u64) {
        if let Some(Duty { last, .. }) = &mut self.axes[index].duty {
            *last = Some((now, outside));
        }
    }

    /// A bus that has gone off has tripped what may move there, and everything was told.
    fn check_bus_off(&mut self, now: u64) {
        for index in 0..self.buses.len() {
            if self.buses[index].off_noticed_us.take() != Some(now) || self.unlisted.is_some() {
                continue;
            }
            let may_move =
                |told| matches!(told, Told::Arming | Told::Armed | Told::Active | Told::Stopping);
            let on = |axis: &crate::axis::Axis| axis.bus() == Some(index) && may_move(axis.told);
            if let Some(axis) = self.axes.iter().position(on) {
                let seen = format!("bus {index} is off, axis {axis} is {:?}", self.axes[axis].told);
                self.broken(Check::BusOffIgnored, now, seen);
            }
        }
    }

    /// A bus that was opened for raw frames.
    fn check_raw_open(&mut self, now: u64) {
        for index in 0..self.buses.len() {
            let opened = self.buses[index].raw_opened_us.take() == Some(now);
            if opened && self.buses[index].raw_open && !self.may_be_raw(index) {
                let seen = format!(
                    "bus {index} is opened while an axis is not at rest, or the e-stop latched"
                );
                self.broken(Check::RawUnopened, now, seen);
            }
        }
    }

    fn check_kept(&mut self, now: u64) {
        let mut kept = Vec::new();
        for bus in &mut self.buses {
            let is_can = bus.is_can();
            let may_wait = |held: &&mut Held| is_can || held.waits_until.is_some();
            let held = bus.held.iter_mut().filter(may_wait);
            for held in held.filter(|held| held.is_motion && !held.asked_back) {
                let started = held.start.as_ref().map_or(0, |start| start.members);
                let moved = (0u8..).zip(&self.axes).filter(|(index, _)| {
                    Some(*index) == held.axis || started & bit_of(*index) != 0
                });
                // A frame that has just been handed over may be on the wire as long as it takes to
                // look.
                let mut revoked =
                    moved.filter_map(|(_, axis)| axis.revoked.filter(|_| !axis.armed));
                if revoked.any(|(_, at)| at + SOFTWARE_US < now) {
                    held.asked_back = true;
                    kept.push(format!("motion of axis {:?} waits after its stop", held.axis));
                }
            }
        }
        for seen in kept {
            self.broken(Check::MotionKept, now, seen);
        }
    }
}
