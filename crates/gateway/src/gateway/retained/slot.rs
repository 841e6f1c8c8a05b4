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
use host_protocol::CHECKSUM;

/// Before each payload its generation, after it the checksum.
const FRAME_WORDS: usize = 2;
const COPIES: usize = 2;

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
#[path = "../../../tests/unit/retained_slot.rs"]
mod tests;
