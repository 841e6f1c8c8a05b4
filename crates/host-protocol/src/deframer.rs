//! Frames out of a stream of bytes.

use crate::filled::Filled;
use crate::frame::{COBS_FULL, DELIMITER, Frame, FrameError, MAX_MESSAGE};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Takes bytes as they arrive and gives out frames. It undoes COBS while it stores, so one message
/// is all it holds.
///
/// Whatever arrives, the next delimiter starts afresh: garbage costs at most the frame it hits.
#[derive(Clone)]
pub struct Deframer {
    message: [u8; MAX_MESSAGE],
    progress: Progress,
}

/// How far a frame has come.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// Bytes of the message; [`TOO_LONG`] if it has not fitted.
    length: usize,
    /// Data bytes that the current COBS block still lacks.
    missing: u8,
    /// Whether a zero comes before the next block's data: not before the first one, nor after a
    /// full one.
    zero_next: bool,
}

const TOO_LONG: usize = MAX_MESSAGE + 1;

impl Progress {
    /// Nothing has come since the last delimiter.
    const NONE: Self = Self { length: 0, missing: 0, zero_next: false };
}

/// What has come of the message, and how far.
impl Serialize for Deframer {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        (Filled::of(&self.message, self.progress.length), self.progress).serialize(to)
    }
}

impl<'de> Deserialize<'de> for Deframer {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let (come, progress) = <(Filled<'_>, Progress)>::deserialize(from)?;
        Ok(Self { message: come.array()?, progress })
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
        Self { message: [0; MAX_MESSAGE], progress: Progress::NONE }
    }

    /// Takes the next byte. A delimiter completes a frame, if anything came before it.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame<'_>, FrameError>> {
        self.take(&mut &[byte][..])
    }

    /// Takes `bytes` off their front, as far as the delimiter that completes the next frame, or
    /// all.
    pub fn take(&mut self, bytes: &mut &[u8]) -> Option<Result<Frame<'_>, FrameError>> {
        let Progress { mut length, mut missing, mut zero_next } = self.progress;
        let mut line = bytes.iter();
        let completes = line.any(|&byte| {
            if byte == DELIMITER {
                return (Progress { length, missing, zero_next }) != Progress::NONE;
            }
            let data = match missing {
                0 => {
                    missing = byte - 1;
                    if !core::mem::replace(&mut zero_next, byte != COBS_FULL) {
                        return false;
                    }
                    0
                }
                _ => {
                    missing -= 1;
                    byte
                }
            };
            match self.message.get_mut(length) {
                Some(place) => {
                    *place = data;
                    length += 1;
                }
                None => length = TOO_LONG,
            }
            false
        });
        *bytes = line.as_slice();
        if !completes {
            self.progress = Progress { length, missing, zero_next };
            return None;
        }
        self.progress = Progress::NONE;
        Some(match self.message.get(..length) {
            None => Err(FrameError::TooLong),
            Some(_) if missing > 0 => Err(FrameError::Cobs),
            Some(message) => Frame::from_message(message),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode_body;
    use crate::frame::{Kind, MAX_FRAME};

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
