//! Random numbers that are the same in every run.

use std::collections::VecDeque;

/// Where the numbers come from.
#[derive(Debug, Clone)]
pub enum Dice {
    /// SplitMix64: every seed is a good one.
    Seeded(u64),
    /// A fuzzer chooses them: as many bytes for each as it has use for, and zeros when there are
    /// none left.
    Given(VecDeque<u8>),
}

impl Dice {
    /// Whether the bytes of a fuzzer are used up.
    #[must_use]
    pub fn is_spent(&self) -> bool {
        matches!(self, Self::Given(bytes) if bytes.is_empty())
    }

    fn next(&mut self, end: u64) -> u64 {
        let state = match self {
            Self::Seeded(state) => state,
            Self::Given(bytes) => {
                let wanted = if end <= 1 << 8 { 1 } else { end.ilog2().div_ceil(8) };
                return (0..wanted)
                    .fold(0, |value, _| value << 8 | u64::from(bytes.pop_front().unwrap_or(0)));
            }
        };
        *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        self.next(end) % end
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
        self.next(1 << 8).to_le_bytes()[0]
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
