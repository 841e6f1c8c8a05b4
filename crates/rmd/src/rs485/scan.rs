//! Finds frames in bytes that lie in memory.

use codec::Framing;

use super::{FRAME_LEN, Rs485Framing};

/// Cuts bytes into frames and garbage without copying them.
///
/// It finds what a [`Deframer`](super::Deframer) finds in the same bytes. Where the bytes end
/// inside what may still become a frame, it stops: [`rest`](Scan::rest), at most 12 bytes, belongs
/// in front of the bytes that follow.
///
/// ```
/// use rmd::rs485::{Piece, Scan};
///
/// let line = [0x00, 0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30, 0x3E, 0x01];
/// let mut scan = Scan::new(&line);
/// assert_eq!(scan.next(), Some(Piece::Garbage(&[0x00])));
/// assert!(matches!(scan.next(), Some(Piece::Frame([0x3E, 0x01, 0x08, 0x9C, ..]))));
/// assert_eq!(scan.next(), None);
/// assert_eq!(scan.rest(), [0x3E, 0x01]);
/// ```
#[derive(Debug, Clone)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Scan<'a> {
    rest: &'a [u8],
}

/// A part of scanned bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Piece<'a> {
    /// A whole frame with a valid checksum.
    Frame(&'a [u8; FRAME_LEN]),
    /// Bytes between frames with which no frame begins.
    Garbage(&'a [u8]),
}

impl<'a> Scan<'a> {
    /// Over these bytes.
    pub const fn new(bytes: &'a [u8]) -> Scan<'a> {
        Scan { rest: bytes }
    }

    /// Bytes not yet handed out. Once the iterator has ended: the possible beginning of a frame.
    pub const fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Scan<'a> {
    type Item = Piece<'a>;

    fn next(&mut self) -> Option<Piece<'a>> {
        let bytes = self.rest;
        let start =
            (0..=bytes.len()).find(|at| bytes.get(*at..).is_none_or(Rs485Framing::begins_frame))?;
        let (garbage, rest) = bytes.split_at_checked(start)?;
        if !garbage.is_empty() {
            self.rest = rest;
            return Some(Piece::Garbage(garbage));
        }
        let (frame, rest) = rest.split_first_chunk::<FRAME_LEN>()?;
        self.rest = rest;
        Some(Piece::Frame(frame))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Proven frames: a 0x9C request and its reply.
    const REQUEST: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    const REPLY: [u8; 13] =
        [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];

    #[test]
    fn frames_and_garbage_lie_where_they_were() {
        let mut line = [0xEE; 33];
        line[1..14].copy_from_slice(&REQUEST);
        line[14..27].copy_from_slice(&REPLY);
        line[29] = 0x3E;
        line[32] = 0x3E;
        let mut scan = Scan::new(&line);
        assert_eq!(scan.next(), Some(Piece::Garbage(&[0xEE])));
        assert_eq!(scan.next(), Some(Piece::Frame(&REQUEST)));
        assert_eq!(scan.next(), Some(Piece::Frame(&REPLY)));
        assert_eq!(scan.next(), Some(Piece::Garbage(&[0xEE, 0xEE, 0x3E, 0xEE, 0xEE])));
        assert_eq!(scan.next(), None);
        assert_eq!(scan.rest(), [0x3E]);
    }

    #[test]
    fn a_cut_frame_waits_for_its_rest() {
        for cut in 0..13 {
            let mut scan = Scan::new(&REPLY[..cut]);
            assert_eq!(scan.next(), None);
            assert_eq!(scan.rest(), &REPLY[..cut]);
        }
    }

    /// The vendor's older framing: `3E command id length sum`.
    #[test]
    fn the_older_framing_is_garbage() {
        let older = [0x3E, 0x9C, 0x01, 0x00, 0xDB];
        let mut scan = Scan::new(&older);
        assert_eq!(scan.next(), Some(Piece::Garbage(&older)));
        assert_eq!(scan.next(), None);
    }
}
