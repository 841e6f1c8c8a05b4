//! A stop that cannot leave its bus: what is told of it (G4).

use crate::axis::Cause;
use crate::oracle::Oracle;
use crate::violation::Check;

/// So long after its bound a stop that has not left is not counted as sent, µs (G4).
const UNSENT_US: u64 = 100_000;
/// Allowance: what of the axis is under way waits for its reply first, and is asked again.
const SLACK_US: u64 = 5_000;
const SLACK_WINDOWS: u64 = 4;

impl Oracle {
    /// An axis that was not at rest and whose stop has not left for so long is unreachable, and
    /// somebody has been told. Allowance: what a start has led to is told to nobody.
    pub(super) fn check_unsent(&mut self, now: u64, index: usize) {
        let axis = &self.axes[index];
        let (Some(duty), Some(bus)) = (&axis.duty, axis.bus()) else { return };
        let state = &self.buses[bus];
        let is_told = self.unlisted.is_none() && duty.cause != Cause::Reset;
        let has_left = duty.left + duty.left_before > 0 || duty.last.is_some() || duty.rests;
        let may_wait = duty.from_rest || duty.confirmed || duty.unsent_seen || axis.unreachable;
        if !is_told || has_left || may_wait || state.bitrate == 0 {
            return;
        }
        let axes = self.axes_on(bus);
        let bound = state.stop_bound_us(axes, axis.protocol(), axes)
            + SLACK_US
            + SLACK_WINDOWS * state.window_us;
        if now - duty.since_us > bound + UNSENT_US {
            let seen = format!(
                "axis {index}: its stop of {} µs has not left, and nobody is told",
                duty.since_us
            );
            self.broken(Check::UnsentUntold, now, seen);
            if let Some(duty) = &mut self.axes[index].duty {
                duty.unsent_seen = true;
            }
        }
    }

    /// An axis is told to be unreachable: because its stops came to nothing, or because none could
    /// be sent.
    pub(super) fn judge_unreachable(&mut self, now: u64, index: usize, stop_transmitted: bool) {
        let Some(duty) = self.axes.get(index).and_then(|axis| axis.duty.as_ref()) else { return };
        // What is owed since this very instant is not what came to nothing: that of before was, and
        // somebody has just cleared it.
        if duty.cause == Cause::Reset || duty.since_us >= now {
            return;
        }
        let none_has = duty.left + duty.left_before == 0 && duty.last.is_none();
        // Its frame may have left at the very instant at which time was up.
        let has_just = duty.last.is_some_and(|(at, _)| at < now && now < at + UNSENT_US);
        if if stop_transmitted { none_has } else { has_just } {
            let seen = format!("axis {index} is unreachable, sent: {stop_transmitted}; {duty:?}");
            self.broken(Check::UnsentUntold, now, seen);
        }
    }
}
