//! A slot of the retained words: two copies of a payload, of which at least one is whole at any time.

use crc::{CRC_32_ISCSI, Crc};

/// Before each payload its generation, after it the checksum.
const FRAME_WORDS: usize = 2;
const COPIES: usize = 2;

/// Enters every checksum. To be changed with the layout, so that another firmware's words count as none.
const LAYOUT_VERSION: u32 = 2;

static CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Where a slot is and how many words it holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot {
    /// Its first word.
    pub at: usize,
    /// Words of its payload.
    pub payload: usize,
}

impl Slot {
    /// Words of a slot with this payload.
    pub const fn words(payload: usize) -> usize {
        COPIES * (payload + FRAME_WORDS)
    }

    /// Writes the copy of a generation, its checksum last: until then the other copy is the whole one. A short payload is
    /// filled up with zeros.
    pub fn write(self, generation: u32, payload: &[u32], write: &mut dyn FnMut(usize, u32)) {
        let payload = || payload.iter().copied().chain(core::iter::repeat(0)).take(self.payload);
        let checksum = self.checksum(generation, payload());
        let at = self.copy_at(generation);
        let words = core::iter::once(generation).chain(payload()).chain(core::iter::once(checksum));
        for (index, word) in (at..).zip(words) {
            write(index, word);
        }
    }

    /// The newest whole copy: its generation and its payload.
    pub fn read(self, words: &[u32]) -> Option<(u32, &[u32])> {
        let (even, odd) = (self.read_copy(0, words), self.read_copy(1, words));
        match (even, odd) {
            (Some(even), Some(odd)) => {
                // The later of two neighbours, also where the counter wraps.
                let odd_is_later = odd.0.wrapping_sub(even.0) < u32::MAX / 2;
                Some(if odd_is_later { odd } else { even })
            }
            (even, odd) => even.or(odd),
        }
    }

    fn read_copy(self, parity: u32, words: &[u32]) -> Option<(u32, &[u32])> {
        let at = self.copy_at(parity);
        let copy = words.get(at..at + self.payload + FRAME_WORDS)?;
        let [generation, payload @ .., checksum] = copy else { return None };
        let whole = *checksum == self.checksum(*generation, payload.iter().copied());
        (whole && generation % 2 == parity).then_some((*generation, payload))
    }

    /// The copies take turns.
    fn copy_at(self, generation: u32) -> usize {
        self.at + if generation.is_multiple_of(2) { 0 } else { self.payload + FRAME_WORDS }
    }

    /// Over layout, place, generation and payload: a copy in the wrong place is no copy.
    fn checksum(self, generation: u32, payload: impl Iterator<Item = u32>) -> u32 {
        let mut digest = CHECKSUM.digest();
        let place = u32::try_from(self.at).unwrap_or(u32::MAX);
        for word in [LAYOUT_VERSION, place, generation].into_iter().chain(payload) {
            digest.update(&word.to_le_bytes());
        }
        digest.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOT: Slot = Slot { at: 3, payload: 2 };
    const MEMORY: usize = SLOT.at + Slot::words(SLOT.payload);

    fn write(words: &mut [u32], generation: u32, payload: &[u32]) {
        SLOT.write(generation, payload, &mut |index, word| words[index] = word);
    }

    #[test]
    fn nothing_is_read_from_memory_that_was_never_written() {
        for fill in [0, u32::MAX, 0xDEAD_BEEF] {
            assert_eq!(SLOT.read(&[fill; MEMORY]), None);
        }
        assert_eq!(SLOT.read(&[]), None);
    }

    #[test]
    fn the_bytes_of_a_copy_are_these() {
        let mut words = [0; MEMORY];
        write(&mut words, 1, &[7, 8]);
        // CRC-32C of the words 2, 3, 1, 7, 8, little-endian.
        assert_eq!(words, [0, 0, 0, 0, 0, 0, 0, 1, 7, 8, 0xFCD6_6B65]);
    }

    #[test]
    fn the_newer_copy_counts_also_where_the_counter_wraps() {
        let mut words = [0; MEMORY];
        for generation in [1, 2, 3, u32::MAX - 1, u32::MAX, 0, 1] {
            write(&mut words, generation, &[generation, 5]);
            assert_eq!(SLOT.read(&words), Some((generation, &[generation, 5][..])), "{generation}");
            if generation == 3 {
                words = [0; MEMORY];
            }
        }
    }

    #[test]
    fn a_write_cut_short_at_any_word_leaves_the_copy_before() {
        let mut before = [0; MEMORY];
        write(&mut before, 1, &[1, 2]);
        write(&mut before, 2, &[3, 4]);
        for whole in 0..SLOT.payload + FRAME_WORDS {
            let mut words = before;
            let mut left = whole;
            SLOT.write(3, &[5, 6], &mut |index, word| {
                if left > 0 {
                    words[index] = word;
                    left -= 1;
                }
            });
            assert_eq!(SLOT.read(&words), Some((2, &[3, 4][..])), "{whole} words");
        }
    }

    #[test]
    fn a_flipped_bit_or_another_place_is_no_copy() {
        let mut words = [0; MEMORY];
        write(&mut words, 2, &[1, 2]);
        for index in SLOT.at..SLOT.at + SLOT.payload + FRAME_WORDS {
            for bit in 0..u32::BITS {
                let mut flipped = words;
                flipped[index] ^= 1 << bit;
                assert_eq!(SLOT.read(&flipped), None, "word {index} bit {bit}");
            }
        }
        assert_eq!(Slot { at: 2, payload: 2 }.read(&words[1..]), None);
    }
}
