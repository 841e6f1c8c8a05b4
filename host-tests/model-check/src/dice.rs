//! Random numbers that are the same in every run.

use std::collections::VecDeque;

/// Where the numbers come from.
#[derive(Debug, Clone)]
pub enum Dice {
    /// A seed: every one is a good one.
    Seeded(fastrand::Rng),
    /// A fuzzer chooses them: as many bytes for each as it has use for, and zeros when there are
    /// none left.
    Given(VecDeque<u8>),
}

impl Dice {
    /// The numbers of a seed.
    pub fn seeded(seed: u64) -> Self {
        Self::Seeded(fastrand::Rng::with_seed(seed))
    }

    /// Whether the bytes of a fuzzer are used up.
    #[must_use]
    pub fn is_spent(&self) -> bool {
        matches!(self, Self::Given(bytes) if bytes.is_empty())
    }

    /// A number below `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        match self {
            Self::Seeded(random) => random.u64(..end),
            Self::Given(bytes) => {
                let wanted = if end <= 1 << 8 { 1 } else { end.ilog2().div_ceil(8) };
                let next = |value, _| value << 8 | u64::from(bytes.pop_front().unwrap_or(0));
                (0..wanted).fold(0, next) % end
            }
        }
    }

    /// True once in so many times.
    pub fn one_in(&mut self, chance: u64) -> bool {
        self.below(chance) == 0
    }

    /// True so often in a hundred times.
    pub fn percent(&mut self, chance: u64) -> bool {
        self.below(100) < chance
    }

    /// Any byte.
    pub fn byte(&mut self) -> u8 {
        self.below(1 << 8).to_le_bytes()[0]
    }

    /// Fewer than `end` bytes.
    pub fn bytes(&mut self, end: u64) -> Vec<u8> {
        (0..self.below(end)).map(|_| self.byte()).collect()
    }

    /// One of these.
    pub fn pick<T: Clone>(&mut self, choices: &[T]) -> T {
        let index = self.below(u64::try_from(choices.len()).unwrap_or(1));
        choices[usize::try_from(index).unwrap_or(0)].clone()
    }

    /// A number from −1 to 1.
    pub fn fraction(&mut self) -> f32 {
        f32::from(self.byte()) / 127.5 - 1.0
    }
}
