//! The stop of a motor that has just become the axis's, before anything else is sent to it.
//!
//! It may have been told to move by somebody who is gone, or by this gateway before it lost its
//! power, and stand only because its own timeout has stopped it: what it hears then may set it in
//! motion.

use super::Axis;
use crate::protocol::{Exchange, Info};
use serde::{Deserialize, Serialize};

/// What of that stop has still to leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum FirstStop {
    Owed,
    /// What ends a move to a position.
    EndOwed,
    Over,
}

impl Axis {
    /// What goes out before anything that is asked of a motor at rest.
    pub(super) fn owed_first(&self) -> Option<Exchange> {
        let exchange = match self.first_stop {
            FirstStop::Owed => Exchange::Stop,
            FirstStop::EndOwed => Exchange::PositionStop,
            FirstStop::Over => return None,
        };
        let info = Info::of_axis(&self.config)?;
        (info.resumes_when_asked && self.can(exchange)).then_some(exchange)
    }

    /// A command has left, of whatever stop.
    pub(super) fn note_first_stop(&mut self, exchange: Exchange) {
        self.first_stop = match (self.first_stop, exchange) {
            (FirstStop::Owed, Exchange::Stop) => FirstStop::EndOwed,
            (FirstStop::EndOwed, Exchange::PositionStop) => FirstStop::Over,
            (known, _) => known,
        };
    }
}
