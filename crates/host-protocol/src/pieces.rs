//! A stream of bytes in pieces that are worth a look.

use crate::frame::DELIMITER;

/// Holds bytes of a stream until they end a frame, or `SIZE` of them have come.
///
/// Who takes them in is busy with a piece for as long as with a frame, so it is spared what it could
/// only keep; and it gets one frame at a time, so that what follows from a frame can go before the
/// next one. A [`Deframer`](crate::Deframer) finds the same frames in the pieces as in the stream.
#[derive(Debug, Clone)]
pub struct Pieces<const SIZE: usize> {
    bytes: [u8; SIZE],
    /// Of these some have been given.
    given: usize,
    /// And so many have come.
    come: usize,
    /// What was given last has ended a frame: a delimiter behind it begins one, and says nothing.
    is_between_frames: bool,
}

impl<const SIZE: usize> Default for Pieces<SIZE> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const SIZE: usize> Pieces<SIZE> {
    /// Of a stream of which nothing has come.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; SIZE], given: 0, come: 0, is_between_frames: true }
    }

    /// Where the next bytes of the stream go; not empty once [`next`](Self::next) has given all it
    /// can. How many came is told by [`add`](Self::add).
    pub fn room(&mut self) -> &mut [u8] {
        self.bytes.copy_within(self.given..self.come, 0);
        (self.given, self.come) = (0, self.come - self.given);
        self.bytes.get_mut(self.come..).unwrap_or_default()
    }

    /// So many bytes have come; more than there was room for count as that.
    pub fn add(&mut self, length: usize) {
        self.come = self.come.saturating_add(length).min(SIZE);
    }

    /// What comes next is no more of the frame that has begun: it ends here.
    pub fn end(&mut self) {
        if let Some(place) = self.room().first_mut() {
            *place = DELIMITER;
            self.add(1);
        }
    }

    /// The next piece: as far as the end of a frame, or all where that fills the room.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> Option<&[u8]> {
        let bytes = self.bytes.get(self.given..self.come)?;
        let is_delimiter = |byte: &u8| *byte == DELIMITER;
        let is_opening = |byte: &&u8| self.is_between_frames && is_delimiter(byte);
        let opening = bytes.iter().take_while(is_opening).count();
        let length = match bytes.iter().skip(opening).position(is_delimiter) {
            Some(inside) => opening + inside + 1,
            None if bytes.len() == SIZE => SIZE,
            None => return None,
        };
        let piece = bytes.get(..length)?;
        self.is_between_frames = piece.last().is_some_and(is_delimiter);
        self.given += length;
        Some(piece)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::{Deframer, Kind, MAX_FRAME, encode_body};
    use std::vec::Vec;

    const SIZE: usize = 16;

    /// What comes out of what comes at once.
    fn pieces(of: &mut Pieces<SIZE>, mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut given = Vec::new();
        while !bytes.is_empty() {
            let room = of.room();
            let (now, later) = bytes.split_at(room.len().min(bytes.len()));
            room[..now.len()].copy_from_slice(now);
            of.add(now.len());
            while let Some(piece) = of.next() {
                given.push(piece.to_vec());
            }
            bytes = later;
        }
        given
    }

    #[test]
    fn a_piece_is_a_frame_and_the_beginning_of_the_next_waits() {
        let mut stream = Pieces::new();
        assert_eq!(pieces(&mut stream, &[0, 2, 7]), [[0; 0]; 0]);
        assert_eq!(pieces(&mut stream, &[0, 0, 3, 1]), [[0, 2, 7, 0]]);
        assert_eq!(pieces(&mut stream, &[1, 0, 2, 9, 0]), [&[0, 3, 1, 1, 0][..], &[2, 9, 0]]);
        assert_eq!(pieces(&mut stream, &[0, 0]), [[0; 0]; 0], "delimiters alone say nothing");
    }

    #[test]
    fn what_fills_the_room_is_given_and_its_end_as_well() {
        let mut stream = Pieces::new();
        assert_eq!(pieces(&mut stream, &[1; SIZE + 2]), [[1; SIZE]]);
        assert_eq!(pieces(&mut stream, &[0]), [[1, 1, 0]]);
        assert_eq!(pieces(&mut stream, &[1; SIZE]), [[1; SIZE]]);
        assert_eq!(pieces(&mut stream, &[0, 0]), [[0]], "the second one opens a frame");
    }

    #[test]
    fn a_frame_that_is_cut_off_ends() {
        let mut stream = Pieces::new();
        assert_eq!(pieces(&mut stream, &[0, 2]), [[0; 0]; 0]);
        stream.end();
        assert_eq!(stream.next(), Some(&[0, 2, 0][..]));
        stream.end();
        assert_eq!(stream.next(), None, "nothing had begun");
    }

    #[test]
    fn the_frames_are_those_of_the_stream() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..2_000 {
            let mut line = Vec::new();
            for _ in 0..random.usize(1..6) {
                let mut out = [0; MAX_FRAME];
                let body: Vec<u8> = (0..random.usize(..40)).map(|_| random.u8(..3)).collect();
                let length = encode_body(Kind::Request, 7, 1, &body, &mut out).unwrap();
                line.extend_from_slice(&out[..length]);
                line.extend((0..random.usize(..4)).map(|_| random.u8(..2)));
            }
            let frames = |bytes: &[u8]| {
                let mut deframer = Deframer::new();
                let ends: Vec<_> = bytes
                    .iter()
                    .filter_map(|byte| deframer.push(*byte).map(|end| std::format!("{end:?}")))
                    .collect();
                ends
            };
            let (mut stream, mut given) = (Pieces::new(), Vec::new());
            let mut rest = &line[..];
            while !rest.is_empty() {
                let (now, later) = rest.split_at(random.usize(1..=rest.len()));
                for piece in pieces(&mut stream, now) {
                    assert!(frames(&piece).len() <= 1, "{piece:?}");
                    given.extend_from_slice(&piece);
                }
                rest = later;
                // Nothing that has come whole is held.
                let come = &line[..line.len() - rest.len()];
                assert_eq!(frames(&given), frames(come));
            }
        }
    }
}
