//! How long rounds took, and how that is spread.

use std::time::Duration;

/// The times of some rounds, sorted.
pub struct Spread {
    times: Vec<Duration>,
    rate: f64,
}

impl Spread {
    /// Of rounds that took `all` together.
    pub fn of(mut times: Vec<Duration>, all: Duration) -> Self {
        times.sort_unstable();
        #[expect(clippy::cast_precision_loss, reason = "a number of rounds")]
        let rate = times.len() as f64 / all.as_secs_f64().max(1e-9);
        Self { times, rate }
    }

    /// The time that so many of 1000 rounds do not exceed.
    pub fn at(&self, permille: usize) -> Duration {
        let place = (self.times.len() * permille).div_ceil(1_000).max(1) - 1;
        self.times.get(place).copied().unwrap_or_default()
    }

    /// How far the 99th percentile is from the median.
    pub fn jitter(&self) -> Duration {
        self.at(990).saturating_sub(self.at(500))
    }

    /// Rounds in a second.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Each of them, the shortest first.
    pub fn times(&self) -> &[Duration] {
        &self.times
    }

    /// How many there were.
    pub fn rounds(&self) -> usize {
        self.times.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_times_that_were_measured() {
        let ms = Duration::from_millis;
        let spread = Spread::of((1..=1_000).rev().map(ms).collect(), ms(2_000));
        assert_eq!([500, 990, 999, 1_000].map(|at| spread.at(at)), [500, 990, 999, 1_000].map(ms));
        assert_eq!((spread.jitter(), spread.rounds()), (ms(490), 1_000));
        assert!((spread.rate() - 500.0).abs() < 1e-6);
        let few = Spread::of(vec![ms(3), ms(1), ms(2)], ms(6));
        assert_eq!((few.at(500), few.at(999)), (ms(2), ms(3)));
        assert_eq!(Spread::of(Vec::new(), ms(0)).at(500), ms(0));
    }
}
