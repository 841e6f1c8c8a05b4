//! What an armed axis is promised: its setpoints are sent, and its motor's faults read, or it trips
//! (G2, G3).

use crate::axis::{Axis, Cause};
use crate::motor::Question;
use crate::oracle::Oracle;
use crate::violation::Check;
use crate::wire::Told;

/// Allowance: how long after its time something is sent that is no stop. What goes before it in
/// turn are exchanges with every axis of its bus; one whose motor does not answer takes two reply
/// windows, and is asked again.
const TURN_US: u64 = 60_000;
const TURN_WINDOWS: u64 = 4;
/// G1: two readings, at least so far apart.
const UNCOMMANDED_SPAN_US: u64 = 20_000;

impl Oracle {
    /// Time that the bounds do not count for an axis on its bus.
    pub(crate) fn not_ours_us(&self, at: u64, axis: &Axis) -> u64 {
        let bus = axis.bus().and_then(|bus| self.buses.get(bus));
        bus.map_or(0, |bus| bus.not_ours_us(at, axis.outranked_us))
    }

    /// Setpoints that were accepted are sent, and faults are read.
    pub(crate) fn check_delivery(&mut self, now: u64) {
        for index in 0..self.axes.len() {
            let axis = &self.axes[index];
            let Some(bus) = axis.bus().and_then(|bus| self.buses.get(bus)).filter(|_| axis.armed)
            else {
                continue;
            };
            let outside = self.not_ours_us(now, axis);
            let turn = TURN_US
                + TURN_WINDOWS * bus.window_us * self.axes_on(axis.bus().unwrap_or_default());
            let overdue = |(since, before): (u64, u64), within: u64| {
                (now - since).saturating_sub(outside.saturating_sub(before)) > within + turn
            };
            let refresh = axis.refresh_us();
            if let Some(undelivered) = axis.undelivered.filter(|since| overdue(*since, refresh)) {
                let seen = format!("axis {index}: a setpoint of {} µs is not sent", undelivered.0);
                self.axes[index].undelivered = None;
                self.broken(Check::NotDelivered, now, seen);
            } else if overdue(axis.faults_asked, axis.fault_poll_us()) {
                let seen = format!(
                    "axis {index}: its faults were asked for at {} µs",
                    axis.faults_asked.0
                );
                self.axes[index].faults_asked = (now, outside);
                self.broken(Check::FaultsUnread, now, seen);
            }
        }
    }

    /// A setpoint of an axis is in force that has not been sent.
    pub(crate) fn deliver(&mut self, now: u64, index: usize) {
        let outside = self.not_ours_us(now, &self.axes[index]);
        let axis = &mut self.axes[index];
        if axis.permits.iter().any(|permit| permit.in_force && !permit.sent) {
            axis.undelivered.get_or_insert((now, outside));
        }
    }

    /// A frame for an axis has left: a setpoint, or a question.
    pub(super) fn delivered(
        &mut self,
        now: u64,
        index: usize,
        data: &[u8],
        is_setpoint: bool,
        handed_us: u64,
    ) {
        let outside = self.not_ours_us(now, &self.axes[index]);
        let axis = &mut self.axes[index];
        if is_setpoint && axis.undelivered.is_some_and(|(since, _)| since <= handed_us) {
            axis.undelivered = None;
        }
        if axis.protocol().and_then(|protocol| protocol.question(data)) == Some(Question::Faults) {
            axis.faults_asked = (now, outside);
        }
    }

    /// A speed was measured: of an armed axis that nobody has set in motion?
    pub(super) fn watch_speed(&mut self, now: u64, index: usize, speed: f64) {
        let axis = &mut self.axes[index];
        let turns = axis.uncommanded().is_some_and(|threshold| speed > threshold);
        if !turns || axis.told != Told::Armed || !axis.permits.is_empty() {
            axis.turns_since = None;
        } else if *axis.turns_since.get_or_insert(now) + UNCOMMANDED_SPAN_US <= now {
            axis.turns_since = None;
            self.owe_stop(index, Cause::Uncommanded, now);
        }
    }
}
