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
