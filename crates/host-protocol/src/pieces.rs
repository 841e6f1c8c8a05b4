//! A stream of bytes in pieces that are worth a look.

use crate::frame::DELIMITER;

/// Holds bytes of a stream until they end a frame, or `SIZE` of them have come.
///
/// Who takes them in is busy with a piece for as long as with a frame, so it is spared what it could
/// only keep. A [`Deframer`](crate::Deframer) finds the same frames in the pieces as in the stream.
#[derive(Debug, Clone)]
pub struct Pieces<const SIZE: usize> {
    bytes: [u8; SIZE],
    /// So many have come.
    held: usize,
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
        Self { bytes: [0; SIZE], held: 0, is_between_frames: true }
    }

    /// Where the next bytes of the stream go; never empty. How many came is told by
    /// [`add`](Self::add).
    pub fn room(&mut self) -> &mut [u8] {
        self.bytes.get_mut(self.held..).unwrap_or_default()
    }

    /// So many bytes have come; more than there was room for count as that. Gives all that have,
    /// where they end something or fill the room.
    pub fn add(&mut self, length: usize) -> Option<&[u8]> {
        self.held = self.held.saturating_add(length).min(SIZE);
        let bytes = self.bytes.get(..self.held)?;
        let is_opening = |byte: &&u8| self.is_between_frames && **byte == DELIMITER;
        let said = bytes.get(bytes.iter().take_while(is_opening).count()..)?;
        let is_whole = said.last() == Some(&DELIMITER);
        if !is_whole && !said.contains(&DELIMITER) && self.held < SIZE {
            return None;
        }
        self.is_between_frames = bytes.last() == Some(&DELIMITER);
        self.held = 0;
        Some(bytes)
    }

    /// What comes next is no more of the frame that has begun: it ends here.
    pub fn end(&mut self) -> Option<&[u8]> {
        *self.room().first_mut()? = DELIMITER;
        self.add(1)
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
            given.extend(of.add(now.len()).map(Vec::from));
            bytes = later;
        }
        given
    }

    #[test]
    fn the_beginning_of_a_frame_waits_for_its_end() {
        let mut stream = Pieces::new();
        assert_eq!(pieces(&mut stream, &[0, 2, 7]), [[0; 0]; 0]);
        assert_eq!(pieces(&mut stream, &[0, 0, 3]), [[0, 2, 7, 0, 0, 3]]);
        assert_eq!(pieces(&mut stream, &[1]), [[0; 0]; 0]);
        assert_eq!(pieces(&mut stream, &[1, 0]), [[1, 1, 0]]);
        assert_eq!(pieces(&mut stream, &[0, 0]), [[0; 0]; 0], "delimiters alone say nothing");
        assert_eq!(pieces(&mut stream, &[2, 9, 0]), [[0, 0, 2, 9, 0]]);
    }

    #[test]
    fn what_fills_the_room_is_given_and_its_end_as_well() {
        let mut stream = Pieces::new();
        assert_eq!(pieces(&mut stream, &[1; SIZE + 2]), [[1; SIZE]]);
        assert_eq!(pieces(&mut stream, &[0]), [[1, 1, 0]]);
        assert_eq!(pieces(&mut stream, &[1; SIZE]), [[1; SIZE]]);
        assert_eq!(pieces(&mut stream, &[0]), [[0]]);
        assert_eq!(pieces(&mut stream, &[0]), [[0; 0]; 0], "this one opens a frame");
    }

    #[test]
    fn a_frame_that_is_cut_off_ends() {
        let mut stream = Pieces::new();
        assert_eq!(pieces(&mut stream, &[0, 2]), [[0; 0]; 0]);
        assert_eq!(stream.end(), Some(&[0, 2, 0][..]));
        assert_eq!(stream.end(), None, "nothing had begun");
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
                let ends = bytes
                    .iter()
                    .filter_map(|byte| deframer.push(*byte).map(|end| std::format!("{end:?}")));
                ends.collect::<Vec<_>>()
            };
            let (mut stream, mut given) = (Pieces::new(), Vec::new());
            let mut rest = &line[..];
            while !rest.is_empty() {
                let (now, later) = rest.split_at(random.usize(1..=rest.len()));
                given.extend(pieces(&mut stream, now).concat());
                rest = later;
                // Nothing that has come whole is held.
                assert_eq!(frames(&given), frames(&line[..line.len() - rest.len()]));
            }
        }
    }
}
