//! Counts of delays in buckets that are the same everywhere, so that tables can be merged exactly.

use std::collections::BTreeMap;

/// Delays below this have a bucket of their own, µs; above it buckets are wider than 1 µs, and
/// narrower than a 32nd of what they hold.
const FINE_BITS: u32 = 6;
/// The longest delay that is counted, µs: a reply after that is none.
pub const LONGEST_US: u32 = 1_000_000;

/// Delays, µs: how many in each bucket, the least and the greatest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Histogram {
    least: u32,
    most: u32,
    /// By the least delay of the bucket.
    counts: BTreeMap<u32, u64>,
}

/// The least delay of the bucket that a delay is in.
fn bucket(delay_us: u32) -> u32 {
    delay_us & (u32::MAX << width_bits(delay_us))
}

/// The greatest delay of a bucket.
fn last_of(bucket: u32) -> u32 {
    bucket | !(u32::MAX << width_bits(bucket))
}

fn width_bits(delay_us: u32) -> u32 {
    (u32::BITS - delay_us.leading_zeros()).saturating_sub(FINE_BITS)
}

impl Histogram {
    /// One delay.
    pub fn of(delay_us: u32) -> Self {
        let counts = BTreeMap::from([(bucket(delay_us), 1)]);
        Self { least: delay_us, most: delay_us, counts }
    }

    /// As a table states it.
    ///
    /// # Errors
    /// What contradicts itself, and what is allowed.
    pub fn stated(least: u32, most: u32, counts: BTreeMap<u32, u64>) -> Result<Self, String> {
        let (Some(first), Some(last)) = (counts.keys().next(), counts.keys().next_back()) else {
            return Err("buckets are empty; give BUCKET:COUNT for each that has delays".to_owned());
        };
        if let Some(wrong) = counts.keys().find(|of| bucket(**of) != **of) {
            return Err(format!("{wrong} begins no bucket; it is in that of {}", bucket(*wrong)));
        }
        if counts.values().any(|count| *count == 0) {
            return Err("a bucket counts 0; leave empty buckets away".to_owned());
        }
        if counts.values().try_fold(0_u64, |sum, count| sum.checked_add(*count)).is_none() {
            return Err("the counts are too large together".to_owned());
        }
        if most > LONGEST_US {
            return Err(format!("max is {most}, and may be {LONGEST_US} µs at most"));
        }
        if least > most || bucket(least) != *first || bucket(most) != *last {
            return Err(format!(
                "min {least} and max {most} are not in the first bucket, {first} to {}, and the \
                 last, {last} to {}",
                last_of(*first),
                last_of(*last)
            ));
        }
        Ok(Self { least, most, counts })
    }

    /// These and those.
    pub fn add(&mut self, other: &Self) {
        self.least = self.least.min(other.least);
        self.most = self.most.max(other.most);
        for (bucket, count) in &other.counts {
            let sum = self.counts.entry(*bucket).or_default();
            *sum = sum.saturating_add(*count);
        }
    }

    /// How many.
    pub fn count(&self) -> u64 {
        self.counts.values().fold(0, |sum, count| sum.saturating_add(*count))
    }

    /// The shortest.
    pub fn least(&self) -> u32 {
        self.least
    }

    /// The longest.
    pub fn most(&self) -> u32 {
        self.most
    }

    /// So many of a hundred take no longer than this: the end of a bucket, or the longest.
    pub fn percentile(&self, percent: u64) -> u32 {
        let wanted = u128::from(self.count()) * u128::from(percent);
        let mut sum = 0;
        for (bucket, count) in &self.counts {
            sum += u128::from(*count) * 100;
            if sum >= wanted {
                return last_of(*bucket).min(self.most);
            }
        }
        self.most
    }

    /// The least delay of each bucket that has some, and how many.
    pub fn counts(&self) -> impl Iterator<Item = (u32, u64)> {
        self.counts.iter().map(|(bucket, count)| (*bucket, *count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_are_fine_below_64_and_a_32nd_above() {
        let ends = |delay| (bucket(delay), last_of(bucket(delay)));
        assert_eq!(ends(0), (0, 0));
        assert_eq!(ends(63), (63, 63));
        assert_eq!(ends(64), (64, 65));
        assert_eq!(ends(250), (248, 251));
        assert_eq!(ends(1_000), (992, 1_007));
        assert_eq!(ends(LONGEST_US), (999_424, 1_015_807));
        for delay in 1..200_000 {
            let (first, last) = ends(delay);
            assert!(first <= delay && delay <= last && (last - first) * 32 < first.max(32));
            assert_eq!((ends(first), ends(last)), ((first, last), (first, last)), "{delay}");
        }
    }

    #[test]
    fn percentiles_are_the_ends_of_buckets_and_never_beyond_the_longest() {
        let mut all = Histogram::of(40);
        (0..98).for_each(|_| all.add(&Histogram::of(250)));
        all.add(&Histogram::of(993));
        assert_eq!((all.count(), all.least(), all.most()), (100, 40, 993));
        assert_eq!(
            [1, 2, 50, 99, 100].map(|percent| all.percentile(percent)),
            [40, 251, 251, 251, 993]
        );
        assert_eq!(all.counts().collect::<Vec<_>>(), [(40, 1), (248, 98), (992, 1)]);
    }
}
