//! The state of a run as a key: equal for two runs only if the same steps lead both to the same.

use super::World;
use crate::plant::LINKS;
use std::fmt::Write;

impl World {
    /// The key of the state, in which no axis from `axes` on was ever used. `text` is where it is
    /// made.
    ///
    /// # Panics
    /// If somebody has something to read: it is no part of the key.
    #[must_use]
    pub fn state_key(&self, axes: usize, text: &mut String) -> u128 {
        text.clear();
        // No field is passed over in silence: one that is new belongs here.
        let Self {
            start_us: _,
            now_us,
            gateway,
            oracle,
            hosts,
            buses,
            motors,
            line,
            inputs,
            epochs,
            // Buses that nobody has to ask are asked all the same.
            named: _,
            // What the model knows too.
            told: _,
            counts: _,
            life,
            trace: _,
            // That breaks a promise: nothing follows.
            // What the next look at the deadline and the next event make anew.
            tick_due_us: _,
            tick_is_late: _,
            has_panicked: _,
            #[cfg(test)]
                swallows: _,
            #[cfg(test)]
                returns: _,
        } = self;
        let is_read = hosts.iter().all(|host| host.unread_until <= *now_us) && inputs.is_empty();
        assert!(is_read, "{LINKS} hosts read at once");
        let written = gateway
            .write_state(axes, text)
            .and_then(|()| oracle.write_state(axes, text))
            .and_then(|()| write!(text, "{now_us} {buses:?} {motors:?} {line:?} {epochs:?}"))
            .and_then(|()| life.write_state(text));
        // Writing to a string does not fail.
        assert!(written.is_ok());
        let mut hash = Hash::new();
        text.as_bytes().chunks(8).for_each(|chunk| {
            hash.add(chunk.iter().fold(0, |word, byte| word << 8 | u64::from(*byte)))
        });
        life.memory().iter().for_each(|word| hash.add((*word).into()));
        hash.finish()
    }
}

/// 128 bits: among a billion states two have the same by chance once in 10^21 runs.
struct Hash([u64; 2]);

impl Hash {
    const SEEDS: [u64; 2] = [0x9E37_79B9_7F4A_7C15, 0xD1B5_4A32_D192_ED03];
    const FACTORS: [u64; 2] = [0xBF58_476D_1CE4_E5B9, 0x94D0_49BB_1331_11EB];

    fn new() -> Self {
        Self(Self::SEEDS)
    }

    fn add(&mut self, word: u64) {
        for ((state, seed), factor) in self.0.iter_mut().zip(Self::SEEDS).zip(Self::FACTORS) {
            *state = fold(*state ^ word.wrapping_add(seed), factor) ^ seed;
        }
    }

    fn finish(self) -> u128 {
        let [high, low] = self.0;
        u128::from(high) << 64 | u128::from(low)
    }
}

/// Both halves of a product, each bit of which depends on many.
fn fold(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    #[allow(clippy::cast_possible_truncation)] // the low half
    let low = product as u64;
    low ^ (product >> 64) as u64
}
