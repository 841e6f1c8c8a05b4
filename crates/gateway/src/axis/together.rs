//! What an axis does in a start of several: it prepares or stands by, leads or follows.

use super::{Axis, JobKind};
use crate::outbox::Outbox;
use crate::protocol::{self, Exchange};
use crate::time::Instant;

impl Axis {
    /// Whether the axis takes part in a start and has not failed in it.
    pub fn takes_part(&self) -> bool {
        self.is_prepared() || matches!(self.job_kind(), Some(JobKind::StandBy { .. }))
    }

    /// Whether a speed waits in the motor, or is about to.
    pub(super) fn is_prepared(&self) -> bool {
        matches!(self.job_kind(), Some(JobKind::Prepare { .. }))
    }

    /// Whether all that it has to do before the start is done.
    pub fn has_taken_part(&self) -> bool {
        self.takes_part() && self.job_step().is_none()
    }

    /// The frame that starts all of them becomes the motion of this one. It goes out once.
    pub fn lead(&mut self, now: Instant, expires: Option<Instant>, out: &mut Outbox<'_>) {
        if let Some(command) = protocol::command(Exchange::ExecuteAll, &self.config) {
            self.take_motion(now, command, expires, true, out);
        }
    }

    /// Whether that frame has left.
    pub fn has_executed(&self) -> bool {
        let executes = protocol::command(Exchange::ExecuteAll, &self.config);
        let Some(motion) = self.motion().filter(|motion| Some(motion.command) == executes) else {
            return false;
        };
        let under_way = self.transactions.current().is_some_and(|c| c.exchange == Exchange::Motion);
        motion.due.is_none() && !under_way
    }

    /// It has started: its speed is its setpoint from now on, and is sent at once, so that the
    /// motor acknowledges it.
    pub fn follow(&mut self, now: Instant, expires: Option<Instant>, out: &mut Outbox<'_>) {
        let Some(JobKind::Prepare { command }) = self.job_kind() else { return };
        self.stand_down();
        // No manual prints a reply to the frame to all, but one that came would have the id of the
        // next frame.
        self.transactions.owes_reply(now, true);
        self.take_motion(now, protocol::at_once(command), expires, false, out);
    }

    /// It takes part no more.
    pub fn stand_down(&mut self) {
        if self.takes_part() {
            self.job = None;
        }
    }
}
