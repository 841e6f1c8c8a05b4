//! What changes while axes move, one word each.

/// Words of the states: those of [`States`].
pub(super) const STATES_WORDS: usize = 6;

/// Bits of the flags word.
pub(super) const E_STOPPED: u32 = 1;

/// What the gateway and its axes are in the middle of. In a set of axes bit 0 is axis 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct States {
    /// Starts since power came on.
    pub starts: u32,
    /// Axes that may move: arming, armed, active or stopping.
    pub moving: u32,
    /// Axes that are tripped.
    pub tripped: u32,
    /// Those of the tripped axes whose motor counts as unreachable.
    pub unreachable: u32,
    pub flags: u32,
    /// Silence of the host in command that trips, µs.
    pub silence_us: u32,
}

impl States {
    pub const NONE: Self =
        Self { starts: 0, moving: 0, tripped: 0, unreachable: 0, flags: 0, silence_us: 0 };

    pub fn words(self) -> [u32; STATES_WORDS] {
        [self.starts, self.moving, self.tripped, self.unreachable, self.flags, self.silence_us]
    }

    pub fn from_words(words: &[u32]) -> Option<Self> {
        let [starts, moving, tripped, unreachable, flags, silence_us] = *words else { return None };
        Some(Self { starts, moving, tripped, unreachable, flags, silence_us })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::retained::layout::Place;

    const STATES: States = States {
        starts: 3,
        moving: 0b0010,
        tripped: 0b1101,
        unreachable: 0b1000,
        flags: E_STOPPED,
        silence_us: 250_000,
    };

    #[test]
    fn the_words_of_the_states_are_these() {
        let slot = Place::States.slot();
        let mut words = [0; 20];
        slot.write(1, &STATES.words(), &mut |index, word| words[index] = word);
        // CRC-32C of the words 4 (place), 1 (generation) and the payload, little-endian.
        let copy = [1, 3, 0b0010, 0b1101, 0b1000, 1, 250_000, 0xB2D4_5E44];
        assert_eq!(words[..4], [0; 4]);
        assert_eq!(words[4..12], copy);
        assert_eq!(words[12..], copy);
        let found = slot.read(&words, false);
        assert_eq!(found.newest.and_then(|(_, payload)| States::from_words(payload)), Some(STATES));
    }

    #[test]
    fn words_of_another_length_are_none() {
        assert_eq!(States::from_words(&STATES.words()[1..]), None);
        assert_eq!(States::from_words(&[]), None);
    }
}
