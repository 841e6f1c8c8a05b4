//! A slot of the retained words: two copies of the same payload, written one after the other, of
//! which at least one is whole at any time.
//!
//! A damaged copy is told from one that a reset has cut short, and from one that was never written.
//! `torn`: the memory names this slot as the one that was being written. Never written: every word
//! is 0, as the port's contract says of memory after power came on.
//!
//! | first copy | second copy | torn | what it means | what is read |
//! |---|---|---|---|---|
//! | whole | whole, the same | no | nothing has happened | that |
//! | whole, one newer | whole | yes | the reset fell between the copies, or into the note that they are done | the first |
//! | whole, else | whole | – | more than one word went wrong | the newer one, damaged |
//! | not whole | whole | yes | the reset cut the first copy short: nothing had followed from the change | the second |
//! | whole | not whole | yes | the reset cut the second copy short | the first |
//! | not whole | whole | no | the first is damaged, and it may have been the newer | the second, damaged |
//! | whole | not whole | no | the second is damaged | the first, damaged |
//! | never written | never written | – | the slot was never used | nothing |
//! | not whole | never written | yes | the reset cut the first write of all short | nothing |
//! | not whole | not whole, else | – | both are damaged | nothing, damaged |

use super::Store;
use crc::{CRC_32_ISCSI, Crc};

/// Before each payload its generation, after it the checksum.
const FRAME_WORDS: usize = 2;
const COPIES: usize = 2;

static CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Where a slot is and how many words it holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot {
    /// Its first word.
    pub at: usize,
    /// Words of its payload.
    pub payload: usize,
}

/// What a slot holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Found<'a> {
    /// The newest whole copy: its generation and its payload.
    pub newest: Option<(u32, &'a [u32])>,
    /// How far the copies can be trusted.
    pub condition: Condition,
}

/// How far the copies of a slot can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Condition {
    /// Both are whole and the same, or neither was ever written.
    Sound,
    /// A reset came while they were written: the newest whole one counts.
    Torn,
    /// A word has changed that nobody wrote: a newer copy may be lost.
    Damaged,
}

/// A copy as it lies in the memory.
enum Copied<'a> {
    NeverWritten,
    NotWhole,
    Whole(u32, &'a [u32]),
}

impl Slot {
    /// Words of a slot with this payload.
    pub const fn words(payload: usize) -> usize {
        COPIES * (payload + FRAME_WORDS)
    }

    /// Writes both copies, one after the other. A short payload is filled up with zeros.
    pub fn write(self, generation: u32, payload: &[u32], store: Store<'_>) {
        let payload = || payload.iter().copied().chain(core::iter::repeat(0)).take(self.payload);
        let checksum = self.checksum(generation, payload());
        for at in self.copies() {
            let words =
                core::iter::once(generation).chain(payload()).chain(core::iter::once(checksum));
            for (index, word) in (at..).zip(words) {
                store(index, word);
            }
        }
    }

    /// Makes it one that was never written.
    pub fn erase(self, store: Store<'_>) {
        (self.at..self.at + Self::words(self.payload)).for_each(|index| store(index, 0));
    }

    /// What is in a memory that has kept its words. `torn`: a reset came while this slot was
    /// written.
    pub fn read(self, words: &[u32], torn: bool) -> Found<'_> {
        use Copied::{NeverWritten, NotWhole, Whole};
        let interrupted = if torn { Condition::Torn } else { Condition::Damaged };
        let [first, second] = self.copies().map(|at| self.copy(at, words));
        let (newest, condition) = match (first, second) {
            (Whole(one, payload), Whole(other, same)) if one == other && payload == same => {
                (Some((one, payload)), Condition::Sound)
            }
            (Whole(one, payload), Whole(other, _)) if one == other.wrapping_add(1) => {
                (Some((one, payload)), interrupted)
            }
            (Whole(one, payload), Whole(other, older)) => {
                let newest = if other.wrapping_sub(one) < u32::MAX / 2 {
                    (other, older)
                } else {
                    (one, payload)
                };
                (Some(newest), Condition::Damaged)
            }
            (Whole(generation, payload), _) | (_, Whole(generation, payload)) => {
                (Some((generation, payload)), interrupted)
            }
            (NeverWritten, NeverWritten) => (None, Condition::Sound),
            (NotWhole, NeverWritten) => (None, interrupted),
            (_, NotWhole) => (None, Condition::Damaged),
        };
        Found { newest, condition }
    }

    fn copies(self) -> [usize; COPIES] {
        [self.at, self.at + self.payload + FRAME_WORDS]
    }

    fn copy(self, at: usize, words: &[u32]) -> Copied<'_> {
        let copy = words.get(at..at + self.payload + FRAME_WORDS).unwrap_or_default();
        match copy {
            [generation, payload @ .., checksum]
                if *checksum == self.checksum(*generation, payload.iter().copied()) =>
            {
                Copied::Whole(*generation, payload)
            }
            _ if copy.iter().all(|word| *word == 0) => Copied::NeverWritten,
            _ => Copied::NotWhole,
        }
    }

    /// Over place, generation and payload: a copy in the wrong place is no copy.
    fn checksum(self, generation: u32, payload: impl Iterator<Item = u32>) -> u32 {
        let mut digest = CHECKSUM.digest();
        let place = u32::try_from(self.at).unwrap_or(u32::MAX);
        for word in [place, generation].into_iter().chain(payload) {
            digest.update(&word.to_le_bytes());
        }
        digest.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOT: Slot = Slot { at: 3, payload: 2 };
    const COPY: usize = SLOT.payload + FRAME_WORDS;
    const MEMORY: usize = SLOT.at + Slot::words(SLOT.payload);

    fn write(words: &mut [u32], generation: u32, payload: &[u32]) {
        SLOT.write(generation, payload, &mut |index, word| words[index] = word);
    }

    fn written(generation: u32, payload: &[u32]) -> [u32; MEMORY] {
        let mut words = [0; MEMORY];
        write(&mut words, generation, payload);
        words
    }

    #[track_caller]
    fn assert_read(words: &[u32], torn: bool, newest: Option<(u32, &[u32])>, condition: Condition) {
        assert_eq!(SLOT.read(words, torn), Found { newest, condition }, "torn: {torn}");
    }

    #[test]
    fn the_bytes_of_a_slot_are_these() {
        // CRC-32C of the words 3, 1, 7, 8, little-endian.
        let copy = [1, 7, 8, 0x6CE4_48CB];
        assert_eq!(written(1, &[7, 8]), [0, 0, 0, copy[0], 7, 8, copy[3], copy[0], 7, 8, copy[3]]);
    }

    #[test]
    fn what_was_never_written_is_nothing_and_sound() {
        for torn in [false, true] {
            assert_read(&[0; MEMORY], torn, None, Condition::Sound);
            assert_read(&[], torn, None, Condition::Sound);
        }
    }

    #[test]
    fn a_write_cut_short_at_any_word_leaves_what_was_before_or_what_is_new() {
        for (before, older) in [([0; MEMORY], None), (written(2, &[3, 4]), Some((2, &[3, 4][..])))]
        {
            for whole in 0..=2 * COPY {
                for garbles in [false, true] {
                    let mut words = before;
                    let mut left = whole;
                    SLOT.write(3, &[5, 6], &mut |index, word| {
                        if left > 0 {
                            left -= 1;
                            words[index] = if garbles && left == 0 { !word } else { word };
                        }
                    });
                    let has_first = whole > COPY || whole == COPY && !garbles;
                    let newest = if has_first { Some((3, &[5, 6][..])) } else { older };
                    let found = SLOT.read(&words, true);
                    assert_eq!(found.newest, newest, "{whole} words, garbled: {garbles}");
                    assert_ne!(
                        found.condition,
                        Condition::Damaged,
                        "{whole} words, garbled: {garbles}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_flipped_bit_in_either_copy_leaves_the_other_and_is_known() {
        let words = written(2, &[1, 2]);
        for index in SLOT.at..MEMORY {
            for bit in 0..u32::BITS {
                let mut flipped = words;
                flipped[index] ^= 1 << bit;
                assert_read(&flipped, false, Some((2, &[1, 2])), Condition::Damaged);
            }
        }
    }

    #[test]
    fn two_damaged_copies_are_nothing_and_known() {
        let mut words = written(2, &[1, 2]);
        words[SLOT.at] ^= 1;
        words[SLOT.at + COPY + 1] ^= 1 << 31;
        for torn in [false, true] {
            assert_read(&words, torn, None, Condition::Damaged);
        }
        let mut wiped = written(2, &[1, 2]);
        wiped[SLOT.at..SLOT.at + COPY].fill(0);
        assert_read(&wiped, false, Some((2, &[1, 2])), Condition::Damaged);
        wiped[MEMORY - 1] ^= 1;
        assert_read(&wiped, true, None, Condition::Damaged);
    }

    #[test]
    fn copies_of_different_writes_are_sound_only_where_a_reset_fell_between_them() {
        for (first, second, torn, expected) in [
            (3, 2, true, (3, Condition::Torn)),
            (0, u32::MAX, true, (0, Condition::Torn)),
            (3, 2, false, (3, Condition::Damaged)),
            (2, 3, true, (3, Condition::Damaged)),
            (5, 2, true, (5, Condition::Damaged)),
        ] {
            let mut words = written(first, &[first, 9]);
            let other = written(second, &[second, 9]);
            words[SLOT.at + COPY..].copy_from_slice(&other[SLOT.at + COPY..]);
            assert_read(&words, torn, Some((expected.0, &[expected.0, 9])), expected.1);
        }
    }

    #[test]
    fn a_copy_in_another_place_is_no_copy() {
        let words = written(2, &[1, 2]);
        let elsewhere = Slot { at: 2, payload: 2 }.read(&words[1..], false);
        assert_eq!(elsewhere, Found { newest: None, condition: Condition::Damaged });
    }
}
