//! What changes while axes move, one word each.

use crate::set::Set;
use serde::{Deserialize, Serialize};

/// Words of the states: those of [`States`].
pub(super) const STATES_WORDS: usize = 6;

/// Bits of the flags word.
pub(super) const E_STOPPED: u32 = 1;
/// Rows that change together are being stored: some are as before.
pub(super) const MIXED: u32 = 2;

/// What the gateway and its axes are in the middle of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct States {
    /// Starts since power came on.
    pub starts: u32,
    /// Axes that may move: arming, armed, active or stopping.
    pub moving: Set,
    /// Axes that are tripped.
    pub tripped: Set,
    /// Those of the axes whose motor counts as unreachable.
    pub unreachable: Set,
    pub flags: u32,
    /// Silence of the host in command that trips, µs.
    pub silence_us: u32,
}

impl States {
    pub const NONE: Self = Self {
        starts: 0,
        moving: Set::NONE,
        tripped: Set::NONE,
        unreachable: Set::NONE,
        flags: 0,
        silence_us: 0,
    };

    pub fn words(self) -> [u32; STATES_WORDS] {
        let [moving, tripped, unreachable] =
            [self.moving, self.tripped, self.unreachable].map(Set::bits);
        [self.starts, moving, tripped, unreachable, self.flags, self.silence_us]
    }

    pub fn from_words(words: &[u32]) -> Option<Self> {
        let [starts, moving, tripped, unreachable, flags, silence_us] = *words else { return None };
        let [moving, tripped, unreachable] = [moving, tripped, unreachable].map(Set::from_bits);
        Some(Self { starts, moving, tripped, unreachable, flags, silence_us })
    }
}

#[cfg(test)]
#[path = "../../../tests/unit/retained_states.rs"]
mod tests;
