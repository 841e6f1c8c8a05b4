//! The whole state as text, so that a search can tell whether it has been in a state before.

use crate::Gateway;
use core::fmt::{Result, Write};

impl Gateway {
    /// Writes all that can influence what the gateway does from now on: two gateways on one board
    /// that write the same text do the same at the same events.
    ///
    /// Left out is what only requests that are sent again, readers of the log and the numbers of
    /// events depend on: the results of requests that have theirs, the log, and how many
    /// requests and events there were. Left out as well are the axes from `axes` on, bytes of a
    /// host message that is not complete, and what waits for a host: a caller that compares states
    /// uses no more axes, sends whole messages, and reads what there is to read.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_state(&self, axes: usize, to: &mut impl Write) -> Result {
        // No field is passed over in silence: one that is new belongs here.
        let Self {
            board: _,
            axes: all,
            buses,
            links,
            authority,
            epoch,
            e_stopped,
            unstopped,
            e_stop_input_open,
            enabled,
            link_lost,
            starts,
            together,
            arming,
            cycle,
            running,
            history,
            retention,
            draft,
            stored,
            image,
            flight_reading,
            names,
            now,
            latest,
            // Functions of the others, or of who has asked since.
            touched_buses: _,
            first_bus_due: _,
            unwatched_buses: _,
            crowded_buses: _,
            changed_buses: _,
        } = self;
        for axis in all.iter().take(axes) {
            write!(to, "{axis:?}")?;
        }
        for bus in buses {
            write!(to, "{bus:?}")?;
        }
        for link in links.iter() {
            link.write_state(to)?;
        }
        write!(
            to,
            "{authority:?}{together:?}{arming:?}{cycle:?}{running:?}{history:?}{retention:?}{draft:?}{stored:?}{image:?}{flight_reading:?}{names:?}"
        )?;
        write!(
            to,
            "{epoch:?} {e_stopped} {unstopped:?} {e_stop_input_open} {enabled} {link_lost} {starts} {now:?} {latest:?}"
        )
    }
}
