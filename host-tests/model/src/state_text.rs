//! The whole state as text, so that a search can tell whether it has been in a state before.

use crate::link::Record;
use crate::oracle::Oracle;
use crate::wire::Request;
use std::fmt::{Result, Write};

impl Oracle {
    /// Writes all that can influence what the model expects from now on: two models of one gateway
    /// that write the same text judge the same events alike.
    ///
    /// Left out is what only requests that are sent again and counts depend on: of the requests
    /// that have their result it keeps those to arm, as only what was asked for is armed. Left
    /// out as well are the axes from `axes` on, and what was broken: nobody goes on from there.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_state(&self, axes: usize, to: &mut impl Write) -> Result {
        // No field is passed over in silence: one that is new belongs here.
        let Self {
            axes: all,
            buses,
            links,
            listener,
            holder,
            silence_us,
            e_stopped,
            e_stop_open,
            e_stop_asked_us,
            starts,
            history,
            stored,
            unlisted,
            violations: _,
            motions: _,
            started: _,
            epochs: _,
        } = self;
        for axis in all.iter().take(axes) {
            write!(to, "{axis:?}")?;
        }
        for bus in buses {
            write!(to, "{bus:?}")?;
        }
        for link in links {
            write!(to, "{:?} {:?} {:?}", link.reads_since, link.drained_us, link.changes)?;
            let arms = |record: &&Record| {
                matches!(record.request, Request::Arm(_)) && !record.must_be_refused
            };
            link.records
                .iter()
                .filter(|record| record.result.is_none())
                .try_for_each(|record| write!(to, "{record:?}"))?;
            link.records
                .iter()
                .filter(arms)
                .try_for_each(|record| write!(to, "{:?}", record.request))?;
        }
        write!(to, "{listener} {holder:?} {silence_us} {history:?} {stored:?} {unlisted:?}")?;
        write!(to, "{e_stopped} {e_stop_open} {e_stop_asked_us:?} {starts}")
    }
}
