//! What a host has subscribed to: which axes are due to be told of, and which were not in time.

use crate::set::Set;
use host_protocol::requests::{self, SUBSCRIPTION_PERIOD_US};
use host_protocol::{Error, Quantity, StateFields};
use serde::{Deserialize, Serialize};

/// A subscription in force.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Subscription {
    axes: Set,
    fields: StateFields,
    period_us: u64,
    /// When the next period begins.
    pub next_us: u64,
    /// Axes whose sample of this period has not gone out.
    due: Set,
    /// The axis told of last: those behind it come first, so that a slow link leaves out none for
    /// ever.
    last_axis: u8,
    /// Samples that were not out when the next were due.
    missed: u32,
}

impl Subscription {
    /// What the host asks for; `None` where it asks for nothing any more.
    pub fn new(now_us: u64, request: &requests::Subscribe) -> Result<Option<Self>, Error> {
        Quantity::Period.check(request.period_us, SUBSCRIPTION_PERIOD_US)?;
        request.fields.check()?;
        let subscription = Self {
            axes: Set::from_bits(request.axes),
            fields: request.fields,
            period_us: u64::from(request.period_us),
            next_us: now_us,
            due: Set::NONE,
            last_axis: u8::MAX,
            missed: 0,
        };
        Ok((request.axes != 0).then_some(subscription))
    }

    pub fn watches(&self, axis: u8) -> bool {
        self.axes.has(axis)
    }

    /// Begins the next period, if it is time.
    pub fn tick(&mut self, now_us: u64) {
        if now_us < self.next_us {
            return;
        }
        self.missed = self.missed.saturating_add(self.due.len());
        self.due = self.axes;
        // On the grid of the periods; those that nobody could serve are passed over.
        let late = (now_us - self.next_us) / self.period_us;
        self.next_us += (late + 1) * self.period_us;
    }

    pub fn is_due(&self) -> bool {
        !self.due.is_empty()
    }

    /// The next axis to tell of, what of it, and how many samples were missed since the last one.
    pub fn take(&mut self) -> Option<(u8, StateFields, u32)> {
        let axis = u8::try_from(self.due.behind(self.last_axis).next()?).ok()?;
        self.due.put(Set::of(axis), false);
        self.last_axis = axis;
        Some((axis, self.fields, core::mem::take(&mut self.missed)))
    }
}

#[cfg(test)]
#[path = "../../tests/unit/subscription.rs"]
mod tests;
