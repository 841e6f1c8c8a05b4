//! A restart of the motor (RMD V3.6 §2.25): asked for, waited out, and seen by its run time (§2.28), which begins again.

use super::{Axis, JobKind};
use crate::motor::Exchange;
use crate::outbox::Outbox;
use crate::time::{Duration, Instant};
use host_protocol::{Error, TripReason};

/// So long a motor that restarts may be silent (GUARANTEES G10).
const RESTARTS_WITHIN: Duration = Duration::from_millis(3_000);
/// How often it is asked whether it is back.
const BACK_POLL: Duration = Duration::from_millis(100);

/// A motor that has restarted since something has run for at least so much less than since then: it was silent meanwhile.
const SILENT_AT_LEAST: Duration = Duration::from_millis(50);

/// A restart under way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Restart {
    /// When the motor's run time was read before it was told.
    since: Option<Instant>,
}

impl Restart {
    /// The step after which the motor restarts.
    const TELLS: usize = 1;
    /// The step in which it is asked until it is back.
    const WAITS: usize = 2;
    const STEPS: [Exchange; 3] = [Exchange::RunTime, Exchange::Restart, Exchange::RunTime];

    /// The exchange of a step; behind the restart come those before which a trip is cleared.
    pub fn step(index: usize, clearing: &[Exchange]) -> Option<Exchange> {
        match index.checked_sub(Self::STEPS.len()) {
            Some(further) => clearing.get(further).copied(),
            None => Self::STEPS.get(index).copied(),
        }
    }
}

/// Whether a motor that has run for so long now has restarted since a time.
fn has_restarted(now: Instant, since: Instant, run_time_ms: u32) -> bool {
    Duration::from_millis(u64::from(run_time_ms)) + SILENT_AT_LEAST < now.since(since)
}

impl Axis {
    /// Whether the motor has been told to restart and is not known to be back: its silence says nothing.
    pub(super) fn is_restarting(&self) -> bool {
        self.restart_under_way().is_some_and(|(step, _)| step == Restart::WAITS)
    }

    fn restart_under_way(&self) -> Option<(usize, Restart)> {
        let job = self.job.as_ref()?;
        match job.kind {
            JobKind::Restart(restart) => Some((job.step, restart)),
            _ => None,
        }
    }

    /// The motor tells its run time. Whether that is not yet the one after the restart, so that it is asked again.
    pub(super) fn awaits_restart(&mut self, now: Instant, run_time_ms: u32, out: &mut Outbox<'_>) -> bool {
        let Some((step, restart)) = self.restart_under_way() else { return false };
        match restart.since {
            Some(since) if step == Restart::WAITS && !has_restarted(now, since, run_time_ms) => {
                self.ask_restarted_again(now, Error::NotRestarted { axis: self.index }, out);
                true
            }
            None if step < Restart::TELLS => {
                let kind = JobKind::Restart(Restart { since: Some(now) });
                self.job.as_mut().into_iter().for_each(|job| job.kind = kind);
                false
            }
            _ => false,
        }
    }

    /// The motor tells its run time. One that is shorter than before has begun again: an armed axis trips, as whatever the motor was told
    /// for this motion is lost, and perhaps the turns that it had counted (§2.33.4, index 4).
    pub(super) fn note_run_time(&mut self, now: Instant, run_time_ms: u32, out: &mut Outbox<'_>) {
        let restarted = run_time_ms < core::mem::replace(&mut self.run_time_ms, run_time_ms);
        if self.owes_restart() && has_restarted(now, self.restart_owed_since, run_time_ms) {
            self.set_restart_owed(Instant::default());
        }
        if restarted && self.is_armed() {
            self.trip(now, TripReason::MotorRestarted, out);
        }
    }

    /// The motor is about to be told something that acts after a restart.
    pub fn owe_restart(&mut self, now: Instant) {
        self.set_restart_owed(now);
    }

    /// Whether the motor has to restart before it may be armed.
    pub fn owes_restart(&self) -> bool {
        self.restart_owed_since != Instant::default()
    }

    /// Another motor has a run time of its own, and owes nothing.
    pub(super) fn forget_run_time(&mut self) {
        self.run_time_ms = 0;
        self.set_restart_owed(Instant::default());
    }

    fn set_restart_owed(&mut self, since: Instant) {
        self.timeout_unsaved |= (since != Instant::default()) != self.owes_restart();
        self.restart_owed_since = since;
    }

    /// Asks again a little later, unless the motor has had its time: then the job fails.
    pub(super) fn ask_restarted_again(&mut self, now: Instant, error: Error, out: &mut Outbox<'_>) {
        let told_at = self.restart_under_way().and_then(|(_, restart)| restart.since);
        if told_at.is_none_or(|at| now.since(at) >= RESTARTS_WITHIN) {
            self.fail(now, error, out);
        } else if let Some(job) = &mut self.job {
            job.since = now + BACK_POLL;
        }
    }
}
