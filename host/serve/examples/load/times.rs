//! How long something took, each time.

use std::fmt;
use std::time::Duration;

/// All times of one kind.
#[derive(Default)]
pub struct Times(Vec<Duration>);

impl Times {
    pub fn note(&mut self, time: Duration) {
        self.0.push(time);
    }

    pub fn count(&self) -> usize {
        self.0.len()
    }
}

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        let ms = |place: usize| sorted.get(place).map_or(0.0, |time| time.as_secs_f64() * 1e3);
        let (count, last) = (sorted.len(), sorted.len().saturating_sub(1));
        write!(f, "{count:4}  median {:8.3} ms  longest {:8.3} ms", ms(count / 2), ms(last))
    }
}
