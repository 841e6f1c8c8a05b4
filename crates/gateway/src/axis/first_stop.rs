//! The stop of a motor that has just become the axis's, or was given up, before anything else is
//! sent to it.
//!
//! It may have been told to move by somebody who is gone, or by this gateway before it lost its
//! power, and stand only because its own timeout has stopped it: what it hears then may set it in
//! motion.

use super::Axis;
use crate::protocol::{Exchange, Info};
use serde::{Deserialize, Serialize};

/// What of that stop has still to leave.
/// `heard`: the motor has answered something since the stop command left; before that it may have
/// left on a cut cable, acknowledged by another node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum FirstStop {
    Owed,
    /// What ends a move to a position.
    EndOwed {
        heard: bool,
    },
    Over {
        heard: bool,
    },
}

impl Axis {
    /// What goes out before anything that is asked of a motor at rest.
    pub(super) fn owed_first(&self) -> Option<Exchange> {
        let exchange = match self.first_stop {
            FirstStop::Owed => Exchange::Stop,
            FirstStop::EndOwed { .. } => Exchange::PositionStop,
            FirstStop::Over { .. } => return None,
        };
        let info = Info::of_axis(&self.config)?;
        (info.resumes_when_asked && self.can(exchange)).then_some(exchange)
    }

    /// A command has left, of whatever stop.
    pub(super) fn note_first_stop(&mut self, exchange: Exchange) {
        self.first_stop = match (self.first_stop, exchange) {
            (FirstStop::Owed, Exchange::Stop) => FirstStop::EndOwed { heard: false },
            (FirstStop::EndOwed { heard }, Exchange::PositionStop) => FirstStop::Over { heard },
            (known, _) => known,
        };
    }

    /// The motor has answered.
    pub(super) fn first_stop_heard(&mut self) {
        if let FirstStop::EndOwed { heard } | FirstStop::Over { heard } = &mut self.first_stop {
            *heard = true;
        }
    }

    /// The motor has not answered this: if it has answered nothing since its first stop, that is
    /// owed before the next question.
    pub(super) fn first_stop_may_be_lost(&mut self, exchange: Exchange) {
        if let FirstStop::EndOwed { heard: false } | FirstStop::Over { heard: false } =
            self.first_stop
            && !exchange.is_stop()
        {
            self.first_stop = FirstStop::Owed;
        }
    }
}
