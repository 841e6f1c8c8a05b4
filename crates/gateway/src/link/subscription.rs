//! What a host has subscribed to: which axes are due to be told of, and which were not in time.

use host_protocol::{Error, Quantity, StateFields, requests};

/// Shortest and longest time between two samples of an axis, µs.
const PERIOD_US: (u32, u32) = (1_000, 10_000_000);
/// A host that has sent nothing valid for so long is not told any more, µs.
const SILENCE_US: u64 = 5_000_000;

/// A subscription in force.
#[derive(Debug, Clone)]
pub struct Subscription {
    /// Bit 0 is axis 0.
    axes: u32,
    fields: StateFields,
    period_us: u64,
    next_us: u64,
    /// Axes whose sample of this period has not gone out.
    due: u32,
    /// The axis that comes next, so that a slow link leaves out no axis for ever.
    next_axis: u8,
    /// Samples that were not out when the next were due.
    missed: u32,
}

impl Subscription {
    /// What the host asks for; `None` where it asks for nothing any more.
    pub fn new(now_us: u64, request: &requests::Subscribe) -> Result<Option<Self>, Error> {
        let (min, max) = PERIOD_US;
        if !(min..=max).contains(&request.period_us) {
            #[allow(clippy::cast_precision_loss)]
            let [value, min, max] = [request.period_us, min, max].map(|us| us as f32);
            return Err(Error::OutOfRange { quantity: Quantity::Period, value, min, max });
        }
        let subscription = Self {
            axes: request.axes,
            fields: request.fields,
            period_us: u64::from(request.period_us),
            next_us: now_us,
            due: 0,
            next_axis: 0,
            missed: 0,
        };
        Ok((request.axes != 0).then_some(subscription))
    }

    pub fn watches(&self, axis: u8) -> bool {
        axis_bit(axis) & self.axes != 0
    }

    /// Whether the host has been silent for too long to be told any more.
    pub fn has_lapsed(&self, now_us: u64, last_valid_us: u64) -> bool {
        now_us >= last_valid_us + SILENCE_US
    }

    /// When something is to be done for it.
    pub fn deadline(&self, last_valid_us: u64) -> u64 {
        self.next_us.min(last_valid_us + SILENCE_US)
    }

    /// Begins the next period, if it is time.
    pub fn tick(&mut self, now_us: u64) {
        if now_us < self.next_us {
            return;
        }
        self.missed = self.missed.saturating_add(self.due.count_ones());
        self.due = self.axes;
        // On the grid of the periods; those that nobody could serve are passed over.
        let late = (now_us - self.next_us) / self.period_us;
        self.next_us += (late + 1) * self.period_us;
    }

    pub fn is_due(&self) -> bool {
        self.due != 0
    }

    /// The next axis to tell of, what of it, and how many samples were missed since the last one.
    pub fn take(&mut self) -> Option<(u8, StateFields, u32)> {
        let later = self.due & u32::MAX.checked_shl(u32::from(self.next_axis)).unwrap_or(0);
        let from = if later == 0 { self.due } else { later };
        let axis = u8::try_from(from.trailing_zeros()).ok().filter(|_| from != 0)?;
        self.due &= !axis_bit(axis);
        self.next_axis = axis + 1;
        Some((axis, self.fields, core::mem::take(&mut self.missed)))
    }
}

fn axis_bit(axis: u8) -> u32 {
    1u32.checked_shl(u32::from(axis)).unwrap_or(0)
}

#[cfg(test)]
#[path = "../../tests/unit/subscription.rs"]
mod tests;
