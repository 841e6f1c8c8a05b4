//! The stop of a motor that has just become the axis's, or was given up, before anything else is
//! sent to it.
//!
//! It may have been told to move by somebody who is gone, or by this gateway before it lost its
//! power, and stand only because its own timeout has stopped it: what it hears then may set it in
//! motion.

use super::Axis;
use crate::protocol::{self, Exchange, Info, Received};
use serde::{Deserialize, Serialize};

/// That stop: the stop command, and what ends a move to a position.
const STEPS: [Exchange; 2] = [Exchange::Stop, Exchange::PositionStop];

/// How much of it the motor has heard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FirstStop {
    /// How many of its [`STEPS`] are done: answered, or left where the motor is set to return
    /// nothing for them. What is not answered may have left on a cut cable, acknowledged by another
    /// node.
    done: u8,
    /// The motor has answered something since the first of them was.
    heard: bool,
}

impl FirstStop {
    pub const OWED: Self = Self { done: 0, heard: false };

    /// What the motor has to hear next; `None` where it has heard all.
    fn step(self) -> Option<Exchange> {
        STEPS.get(usize::from(self.done)).copied()
    }

    fn does(&mut self, exchange: Exchange) {
        self.done += u8::from(self.step() == Some(exchange));
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
    pub(super) fn first_stop_left(&mut self, exchange: Exchange) {
        if exchange == Exchange::Stop && !protocol::can_confirm(&self.config) {
            self.first_stop.does(exchange);
        }
    }

    /// The motor has answered a command, of whatever stop, or a question: before any of it was
    /// done that says nothing.
    pub(super) fn first_stop_heard(&mut self, exchange: Exchange) {
        self.first_stop.does(exchange);
        self.first_stop.heard = self.first_stop.done > 0;
    }

    /// The motor has sent what answers nothing that is waited for: it has heard its stop where only
    /// that has it send such a frame.
    pub(super) fn first_stop_may_be_heard(&mut self, received: &Received) {
        if let Some(current) = self.transactions.current()
            && current.is_awaited()
            && protocol::is_returned_for(&current.command, received)
        {
            self.first_stop_heard(current.exchange);
        }
    }

    /// The motor has not answered this: if it has answered nothing since its first stop, that is
    /// owed before the next question.
    pub(super) fn first_stop_may_be_lost(&mut self, exchange: Exchange) {
        if !self.first_stop.heard && !exchange.is_stop() {
            self.first_stop = FirstStop::OWED;
        }
    }
}
