//! How often something happens.

use std::time::Duration;

/// Of so much time.
const WINDOW: Duration = Duration::from_secs(1);

/// A count, and how many there were in a second of late.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rate {
    since: Duration,
    count: u64,
    per_second: Option<f64>,
}

impl Rate {
    /// One that begins now.
    pub fn from(now: Duration) -> Self {
        Self { since: now, ..Self::default() }
    }

    /// It has happened once more.
    pub fn count(&mut self) {
        self.count += 1;
    }

    /// Time has passed.
    pub fn tick(&mut self, now: Duration) {
        let span = now.saturating_sub(self.since);
        if span >= WINDOW {
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            let rate = self.count as f64 / span.as_secs_f64();
            *self = Self { since: now, count: 0, per_second: Some(rate) };
        }
    }

    /// In a second; nothing before the first second has passed.
    pub fn per_second(&self) -> Option<f64> {
        self.per_second
    }
}
