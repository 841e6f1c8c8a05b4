//! A restart of the motor (RMD V3.6 §2.25): asked for, waited out, and seen by its run time (§2.28), which begins again.

use super::{Axis, JobKind};
use crate::motor::Exchange;
use crate::outbox::Outbox;
use crate::time::{Duration, Instant};
use host_protocol::Error;

/// So long a motor that restarts may be silent (GUARANTEES G10).
const RESTARTS_WITHIN: Duration = Duration::from_millis(3_000);
/// How often it is asked whether it is back.
const BACK_POLL: Duration = Duration::from_millis(100);

/// A restart under way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Restart {
    /// The motor's run time before it, ms, and when the motor was told.
    before: Option<(u32, Instant)>,
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
        match restart.before {
            Some((before_ms, _)) if step == Restart::WAITS && run_time_ms >= before_ms => {
                self.ask_restarted_again(now, Error::NotRestarted { axis: self.index }, out);
                true
            }
            None if step < Restart::TELLS => {
                let kind = JobKind::Restart(Restart { before: Some((run_time_ms, now)) });
                self.job.as_mut().into_iter().for_each(|job| job.kind = kind);
                false
            }
            _ => false,
        }
    }

    /// Asks again a little later, unless the motor has had its time: then the job fails.
    pub(super) fn ask_restarted_again(&mut self, now: Instant, error: Error, out: &mut Outbox<'_>) {
        let told_at = self.restart_under_way().and_then(|(_, restart)| restart.before).map(|(_, at)| at);
        if told_at.is_none_or(|at| now.since(at) >= RESTARTS_WITHIN) {
            self.fail(now, error, out);
        } else if let Some(job) = &mut self.job {
            job.since = now + BACK_POLL;
        }
    }
}
