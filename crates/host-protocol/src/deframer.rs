//! Frames out of a stream of bytes.

use core::mem::{swap, take};

use crate::filled::Filled;
use crate::frame::{COBS_FULL, DELIMITER, Frame, FrameError, MAX_FRAME, MAX_MESSAGE};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Longest frame without its delimiters.
const MAX_STUFFED: usize = MAX_FRAME - 2;

/// The length of one that has not fitted.
const TOO_LONG: usize = MAX_STUFFED + 1;

/// Takes bytes as they arrive and gives out frames. It keeps what has come of a frame as it came,
/// and undoes COBS in place when the frame has ended.
///
/// Whatever arrives, the next delimiter starts afresh: garbage costs at most the frame it hits.
#[derive(Clone)]
pub struct Deframer {
    stuffed: [u8; MAX_STUFFED],
    /// Bytes that have come since the last delimiter; [`TOO_LONG`] where they have not fitted.
    length: usize,
}

/// What has come of the frame.
impl Serialize for Deframer {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        (Filled::of(&self.stuffed, self.length), self.length).serialize(to)
    }
}

impl<'de> Deserialize<'de> for Deframer {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let (come, length) = <(Filled<'_>, usize)>::deserialize(from)?;
        Ok(Self { stuffed: come.array()?, length })
    }
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}

impl Deframer {
    /// One that has seen nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { stuffed: [0; MAX_STUFFED], length: 0 }
    }

    /// Takes the next byte. A delimiter completes a frame, if anything came before it.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame<'_>, FrameError>> {
        self.take(&mut &[byte][..])
    }

    /// Takes `bytes` off their front, as far as the delimiter that completes the next frame, or
    /// all.
    pub fn take(&mut self, bytes: &mut &[u8]) -> Option<Result<Frame<'_>, FrameError>> {
        if self.length == 0 {
            let between = bytes.iter().take_while(|byte| **byte == DELIMITER).count();
            *bytes = bytes.get(between..)?;
        }
        let end = find_delimiter(bytes);
        let (come, rest) = bytes.split_at_checked(end.unwrap_or(bytes.len()))?;
        let place = self.stuffed.get_mut(self.length..).and_then(|room| room.get_mut(..come.len()));
        match place {
            Some(place) => {
                place.copy_from_slice(come);
                self.length += come.len();
            }
            None => self.length = TOO_LONG,
        }
        *bytes = rest.get(1..).unwrap_or_default();
        end?;
        let stuffed = self.stuffed.get_mut(..take(&mut self.length));
        let message = stuffed.ok_or(FrameError::TooLong).and_then(|stuffed| unstuff(stuffed));
        Some(message.and_then(Frame::from_message))
    }
}

/// Where the first delimiter is. The words before it are passed over as such.
fn find_delimiter(bytes: &[u8]) -> Option<usize> {
    let (words, _) = bytes.as_chunks::<4>();
    // Taking 1 from each byte borrows where one is zero; its highest bit is then set, and was not.
    let has_none = |word: &&[u8; 4]| {
        let word = u32::from_ne_bytes(**word);
        word.wrapping_sub(0x0101_0101) & !word & 0x8080_8080 == 0
    };
    let passed = 4 * words.iter().take_while(has_none).count();
    let found = bytes.get(passed..)?.iter().position(|byte| *byte == DELIMITER);
    found.map(|at| passed + at)
}

/// Undoes COBS in place: a code byte says how far the next one is, which gives way to a zero. Only
/// behind a full block it leaves no zero, and what follows moves up.
fn unstuff(stuffed: &mut [u8]) -> Result<&[u8], FrameError> {
    let mut end = stuffed.len();
    let (mut code, mut next_at) = (1, 0);
    while let Some(behind @ [_, ..]) = stuffed.get_mut(next_at..end) {
        let mut moved = 0;
        if code == COBS_FULL {
            behind.iter_mut().rev().for_each(|byte| swap(byte, &mut moved));
            next_at -= 1;
            end -= 1;
        } else if let Some(next) = behind.first_mut() {
            swap(next, &mut moved);
        }
        code = moved;
        next_at += usize::from(code);
    }
    match stuffed.get(1..end) {
        Some(message) if message.len() > MAX_MESSAGE => Err(FrameError::TooLong),
        Some(message) if next_at == end => Ok(message),
        _ => Err(FrameError::Cobs),
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::encode_body;
    use crate::frame::Kind;
    use std::vec::Vec;

    const PING: [u8; 12] = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];

    /// The last frame or error that `bytes` bring, and how many they bring.
    fn last<'a>(
        deframer: &'a mut Deframer,
        bytes: &[u8],
    ) -> (usize, Option<Result<Frame<'a>, FrameError>>) {
        let (end, start) = bytes.split_last().unwrap();
        let earlier = start.iter().filter(|byte| deframer.push(**byte).is_some()).count();
        let last = deframer.push(*end);
        (earlier + usize::from(last.is_some()), last)
    }

    fn ping() -> Frame<'static> {
        Frame { kind: Kind::Request, sequence: 1, number: 2, body: &[], checksum: 0x8763_83CF }
    }

    #[test]
    fn a_frame_by_hand_is_read() {
        assert_eq!(last(&mut Deframer::new(), &PING), (1, Some(Ok(ping()))));
    }

    #[test]
    fn delimiters_with_nothing_between_are_ignored() {
        let mut deframer = Deframer::new();
        assert_eq!(last(&mut deframer, &[0; 1000]), (0, None));
        assert_eq!(last(&mut deframer, &PING), (1, Some(Ok(ping()))));
    }

    #[test]
    fn frames_may_share_a_delimiter() {
        let mut deframer = Deframer::new();
        last(&mut deframer, &PING);
        assert_eq!(last(&mut deframer, &PING[1..]), (1, Some(Ok(ping()))));
    }

    #[test]
    fn a_line_that_starts_within_a_frame_loses_only_that_one() {
        for start in 2..11 {
            let mut deframer = Deframer::new();
            let (_, first) = last(&mut deframer, &PING[start..]);
            assert!(first.unwrap().is_err(), "{start}");
            assert_eq!(last(&mut deframer, &PING), (1, Some(Ok(ping()))));
        }
    }

    #[test]
    fn what_is_wrong_is_told_apart() {
        const TOO_LONG: [u8; 600] = {
            let mut bytes = [0xFF; 600];
            bytes[599] = 0;
            bytes
        };
        let cases: [(&[u8], FrameError); 5] = [
            (&[0x05, 0x01, 0x00], FrameError::Cobs),
            (&[0x03, 0x01, 0x02, 0x00], FrameError::TooShort { length: 2 }),
            (
                &[0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x88, 0x00],
                FrameError::Checksum { computed: 0x8763_83CF, received: 0x8863_83CF },
            ),
            // Kind 9, sequence 0x0101, number 0x0101; the CRC-32C is from an independent
            // computation.
            (
                &[0x0A, 0x09, 0x01, 0x01, 0x01, 0x01, 0xBA, 0x31, 0xC9, 0x21, 0x00],
                FrameError::UnknownKind(9),
            ),
            (&TOO_LONG, FrameError::TooLong),
        ];
        for (bytes, error) in cases {
            let mut deframer = Deframer::new();
            let (_, result) = last(&mut deframer, bytes);
            assert_eq!(result, Some(Err(error)));
            assert_eq!(last(&mut deframer, &PING), (1, Some(Ok(ping()))));
        }
    }

    #[test]
    fn every_length_of_message_comes_back() {
        let body = [0x55u8; 503];
        let zeros = [0u8; 503];
        let mut out = [0; MAX_FRAME];
        for length in 0..=503 {
            for bytes in [&body[..length], &zeros[..length]] {
                let frame = encode_body(Kind::Event, 7, 0x8001, bytes, &mut out).unwrap();
                let mut deframer = Deframer::new();
                let (count, read) = last(&mut deframer, &out[..frame]);
                assert_eq!((count, read.unwrap().unwrap().body), (1, bytes));
            }
        }
    }

    #[test]
    fn the_frames_are_the_same_however_the_line_is_cut() {
        let mut random = fastrand::Rng::with_seed(2);
        for _ in 0..2_000 {
            let mut line = [0; 96];
            line.fill_with(|| random.u8(..) & random.u8(..) & random.u8(..));
            line[random.usize(..80)..][..PING.len()].copy_from_slice(&PING);
            let (mut whole, mut bytewise) = (Deframer::new(), Deframer::new());
            let mut rest = &line[..];
            while !rest.is_empty() {
                let before = rest.len();
                let mut piece = &rest[..random.usize(1..=before)];
                let cut = piece.len();
                let taken = whole.take(&mut piece);
                rest = &rest[cut - piece.len()..];
                let (count, same) = last(&mut bytewise, &line[96 - before..96 - rest.len()]);
                assert_eq!((taken, usize::from(taken.is_some())), (same, count));
            }
        }
    }

    /// COBS as it is defined: byte by byte, to somewhere else. Nothing where the last block is not
    /// complete.
    fn unstuffed(stuffed: &[u8]) -> Option<Vec<u8>> {
        let (mut message, mut rest) = (Vec::new(), stuffed);
        while let Some((code, behind)) = rest.split_first() {
            let (block, behind) = behind.split_at_checked(usize::from(*code) - 1)?;
            message.extend_from_slice(block);
            message.extend((*code < 255 && !behind.is_empty()).then_some(0));
            rest = behind;
        }
        Some(message)
    }

    #[test]
    fn cobs_is_undone_in_place_as_it_is_defined() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut found = [0; 3];
        for _ in 0..200_000 {
            // As many full blocks as fit, short ones, and a last one that may lack a few bytes.
            let mut line = Vec::new();
            for _ in 0..random.usize(1..5) {
                let code = *random.choice(&[255, 255, 254, 1, 2, 3, 9, 250]).unwrap();
                line.push(code);
                line.extend((1..code).map(|_| random.u8(1..)));
            }
            line.truncate(line.len() - random.usize(..4).min(line.len() - 1) % 2);
            let whole = unstuffed(&line);
            let mut stuffed = line.clone();
            let undone = unstuff(&mut stuffed);
            match whole {
                Some(message) if message.len() <= MAX_MESSAGE => {
                    assert_eq!(undone, Ok(&message[..]), "{line:02X?}");
                    found[0] += 1;
                }
                Some(_) => {
                    assert_eq!(undone, Err(FrameError::TooLong), "{line:02X?}");
                    found[1] += 1;
                }
                None => {
                    assert!(undone.is_err(), "{line:02X?}");
                    found[2] += 1;
                }
            }
        }
        assert!(found.iter().all(|count| *count > 1_000), "{found:?}");
    }

    #[test]
    fn a_frame_after_a_million_random_bytes_is_delivered() {
        let mut deframer = Deframer::new();
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..1_000_000 {
            assert!(!matches!(deframer.push(random.u8(..)), Some(Ok(_))));
        }
        // The first delimiter may close a piece of the garbage; the frame itself is not lost.
        assert!(matches!(last(&mut deframer, &PING), (_, Some(Ok(frame))) if frame == ping()));
    }
}
