//! The stop of a motor that has just become the axis's, or was given up, before anything else is
//! sent to it.
//!
//! It may have been told to move by somebody who is gone, or by this gateway before it lost its
//! power, and stand only because its own timeout has stopped it: what it hears then may set it in
//! motion.

use super::Axis;
use crate::protocol::{Exchange, Info};
use serde::{Deserialize, Serialize};

/// That stop: the stop command, and what ends a move to a position.
const STEPS: [Exchange; 2] = [Exchange::Stop, Exchange::PositionStop];

/// How much of it has left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FirstStop {
    /// How many of its [`STEPS`].
    left: u8,
    /// The motor has answered something since the first of them left; before that it may have left
    /// on a cut cable, acknowledged by another node.
    heard: bool,
}

impl FirstStop {
    pub const OWED: Self = Self { left: 0, heard: false };

    /// What has to leave next; `None` where all has left.
    fn step(self) -> Option<Exchange> {
        STEPS.get(usize::from(self.left)).copied()
    }
}

impl Axis {
    /// What goes out before anything that is asked of a motor at rest.
    pub(super) fn owed_first(&self) -> Option<Exchange> {
        let exchange = self.first_stop.step()?;
        let info = Info::of_axis(&self.config)?;
        (info.resumes_when_asked && self.can(exchange)).then_some(exchange)
    }

    /// A command has left, of whatever stop.
    pub(super) fn note_first_stop(&mut self, exchange: Exchange) {
        self.first_stop.left += u8::from(self.first_stop.step() == Some(exchange));
    }

    /// The motor has answered: before any of it had left that says nothing.
    pub(super) fn first_stop_heard(&mut self) {
        self.first_stop.heard = self.first_stop.left > 0;
    }

    /// The motor has not answered this: if it has answered nothing since its first stop, that is
    /// owed before the next question.
    pub(super) fn first_stop_may_be_lost(&mut self, exchange: Exchange) {
        if !self.first_stop.heard && !exchange.is_stop() {
            self.first_stop = FirstStop::OWED;
        }
    }
}
