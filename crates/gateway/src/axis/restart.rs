//! A restart of the motor: asked for, waited out, and seen by its run time, which has not gone on
//! as our clock has.

use super::{Axis, JobKind};
use crate::outbox::Outbox;
use crate::protocol::{self, Command, Exchange, Sets};
use crate::time::{Duration, Instant};
use core::num::NonZeroU64;
use host_protocol::{Error, TripReason};
use serde::{Deserialize, Serialize};

/// So long a motor that restarts may be silent (GUARANTEES G10).
const RESTARTS_WITHIN: Duration = Duration::from_millis(3_000);
/// How often it is asked whether it is back.
const BACK_POLL: Duration = Duration::from_millis(100);

/// A motor's clock may be slower than ours by a part in so many,
pub(super) const CLOCK_PART: NonZeroU64 = NonZeroU64::new(20).unwrap();
/// and its run time older by so much than the request for it.
const READING: Duration = Duration::from_millis(50);

/// A run time that the motor has told, and when; at first, of a motor that has told nothing, the
/// least that it can have been.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct RunTime {
    ms: u32,
    at: Instant,
}

impl RunTime {
    pub const UNKNOWN: Self = Self { ms: 0, at: Instant::from_micros(0) };

    /// Whether a motor has restarted since this reading that was asked at `asked` and tells
    /// `run_time_ms`: what it has run for must have grown by about the time between.
    fn is_before_a_restart(&self, asked: Instant, run_time_ms: u32) -> bool {
        let passed = asked.since(self.at);
        let before = Duration::from_millis(self.ms.into());
        // After 49.7 days the motor's count begins again, without a restart.
        let overflows = before + passed.times(2) > Duration::from_millis(u32::MAX.into());
        let least = before + (passed - passed.part(CLOCK_PART) - READING);
        !overflows && Duration::from_millis(run_time_ms.into()) < least
    }
}

impl Axis {
    /// The bus has taken a command, from when on it may leave also where a stop preempts it, or it
    /// has left. Whoever has the motor restart, and whatever ends the job, a stop or a bus that
    /// goes off, the motor's silence says nothing until it is back.
    pub(super) fn note_restart(&mut self, now: Instant, exchange: Exchange, command: &Command) {
        if self.is_restart(exchange, command) {
            self.restarts_until = now + RESTARTS_WITHIN;
        }
    }

    /// Whether it is the command that has the motor restart.
    pub(super) fn is_restart(&self, exchange: Exchange, command: &Command) -> bool {
        let restart = || protocol::command(Exchange::Restart, &self.config);
        exchange == Exchange::Restart
            || exchange == Exchange::Native && restart().as_ref() == Some(command)
    }

    /// Whether the job has told the motor to restart, and asks until it is back.
    pub(super) fn waits_for_restart(&self) -> bool {
        self.job.as_ref().is_some_and(|job| {
            job.kind == JobKind::Restart
                && job.sequence.step() == Some(Exchange::RunTime)
                && job.sequence.has_passed(Exchange::Restart)
        })
    }

    /// The job has read the run time. Whether that is not yet the one after the restart, so that it
    /// is asked again.
    pub(super) fn awaits_restart(&mut self, now: Instant, out: &mut Outbox<'_>) -> bool {
        if let Some(JobKind::Native { command, .. }) = self.job_kind()
            && command.sets() == Sets::AfterRestart
        {
            self.set_restart_owed(true);
        }
        let is_back = self.restarts_until == Instant::default();
        let awaits = self.waits_for_restart() && !is_back;
        if awaits {
            self.ask_restarted_again(now, Error::NotRestarted { axis: self.index }, out);
        }
        awaits
    }

    /// The motor tells its run time, asked for at `asked`. Where it has restarted an armed axis
    /// trips, as whatever the motor was told for this motion is lost, and perhaps the turns
    /// that it had counted (§2.33.4, index 4); one that holds is told to again.
    pub(super) fn note_run_time(
        &mut self,
        now: Instant,
        asked: Instant,
        run_time_ms: u32,
        out: &mut Outbox<'_>,
    ) {
        self.run_time_unread = 0;
        let before = core::mem::replace(&mut self.run_time, RunTime { ms: run_time_ms, at: now });
        if !before.is_before_a_restart(asked, run_time_ms) {
            return;
        }
        self.set_restart_owed(false);
        self.restarts_until = Instant::default();
        if self.is_armed() {
            self.trip(now, TripReason::MotorRestarted, out);
        } else if !self.waits_for_restart() {
            self.hold_again(now, out);
        }
    }

    /// Whether the motor has to restart before it may be armed.
    pub fn owes_restart(&self) -> bool {
        self.restart_owed
    }

    /// Whether the axis has to stay that of its motor until this has restarted. One that was given
    /// up, and not heard since, may be gone.
    pub fn is_kept_for_restart(&self) -> bool {
        self.owes_restart() && self.given_up_at <= self.heard_at
    }

    pub(super) fn set_restart_owed(&mut self, owed: bool) {
        self.is_unsaved |= owed != self.restart_owed;
        self.restart_owed = owed;
    }

    /// Asks again a little later, unless the motor has had its time: then the job fails.
    pub(super) fn ask_restarted_again(&mut self, now: Instant, error: Error, out: &mut Outbox<'_>) {
        if self.restarts_until <= now {
            self.fail(now, error, out);
        } else if let Some(job) = &mut self.job {
            job.since = now + BACK_POLL;
        }
    }
}

#[cfg(test)]
#[path = "../../tests/unit/restart.rs"]
mod tests;
