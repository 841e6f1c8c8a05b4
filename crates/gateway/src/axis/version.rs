//! Which version of its protocol the motor speaks: what its answers say, and whether the axis says
//! otherwise.

use super::{Axis, JobKind};
use crate::measured::Versions;
use crate::outbox::Outbox;
use crate::protocol::{self, Exchange};
use crate::time::Instant;
use host_protocol::Error;
use host_protocol::replies::Recognition;

impl Axis {
    /// What the motor said when it was asked last.
    pub fn recognition(&self) -> Recognition {
        self.evidence.report()
    }

    /// A read that tells the version is over; no versions where it was not answered. Returns
    /// whether the job goes on: an axis that its motor contradicts is not armed.
    pub(super) fn version_read(
        &mut self,
        now: Instant,
        read: u8,
        data: &[u8],
        versions: Versions,
        out: &mut Outbox<'_>,
    ) -> bool {
        let Some(job) = &self.job else { return true };
        if job.sequence.has_passed(Exchange::Version(read)) {
            self.evidence.again(read, data, versions);
        } else {
            self.evidence.first(read, data, versions);
        }
        let is_last = !matches!(job.sequence.step_behind(), Some(Exchange::Version(_)));
        let arms = matches!(job.kind, JobKind::Arm { .. });
        let stated = protocol::stated_version(&self.config);
        if !is_last || !arms || self.evidence.allows(stated) {
            return true;
        }
        let possible = self.recognition().possible;
        self.fail(now, Error::DialectContradicted { axis: self.index, stated, possible }, out);
        false
    }
}
