//! A small deterministic random number generator: the same seed gives the same run.

use std::time::Duration;

/// The state between two numbers of `fastrand`'s generator: every seed is a good one.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> u64 {
        let mut random = fastrand::Rng::with_seed(self.0);
        let number = random.u64(..);
        self.0 = random.get_seed();
        number
    }

    /// One random byte.
    pub(crate) fn byte(&mut self) -> u8 {
        let [byte, ..] = self.next().to_le_bytes();
        byte
    }

    /// A time from `from` up to `to`, both included, in whole microseconds.
    pub(crate) fn between(&mut self, from: Duration, to: Duration) -> Duration {
        let width = u64::try_from(to.saturating_sub(from).as_micros()).unwrap_or(u64::MAX - 1);
        from + Duration::from_micros(self.next() % (width + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A newer `fastrand` with other numbers would make every run of a seed another one.
    #[test]
    fn the_numbers_of_a_seed_are_known() {
        let mut random = Random::new(0);
        assert_eq!([random.next(), random.next()], [0x9A45_CD88_8D59_F0D6, 0x0144_5B6A_1896_63F5]);
    }

    #[test]
    fn times_stay_between_their_bounds() {
        let mut random = Random::new(7);
        let (from, to) = (Duration::from_micros(10), Duration::from_micros(12));
        assert!((0..100).all(|_| (from..=to).contains(&random.between(from, to))));
        assert_eq!(random.between(to, to), to);
    }
}
