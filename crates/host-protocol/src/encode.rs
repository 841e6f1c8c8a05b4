//! How a frame is written: the body where it will lie, the rest around it, COBS in place.

use core::fmt;
use core::mem::swap;

use serde::Serialize;

use crate::frame::{
    CHECKSUM_SIZE, COBS_BLOCK, DELIMITER, HEADER_SIZE, Kind, MAX_BODY, checksum_of,
};

/// Why a frame could not be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// More than [`MAX_MESSAGE`](crate::MAX_MESSAGE) bytes, which no message of the table has, or
    /// more than `out` holds.
    TooLong,
    /// The body cannot be serialised by postcard, which no message of the table meets.
    Body,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the frame is longer than its buffer or than the protocol allows",
            Self::Body => "the body has no fixed form",
        })
    }
}

impl core::error::Error for EncodeError {}

/// Where the message begins in its frame: behind the delimiter and the first block's code byte.
const MESSAGE_AT: usize = 2;
const BODY_AT: usize = MESSAGE_AT + HEADER_SIZE;

/// Writes a whole delimited frame and returns its length. [`MAX_FRAME`](crate::MAX_FRAME) bytes of
/// `out` are always enough.
///
/// # Errors
/// The message is too long for the protocol or for `out`, or its body has no fixed form.
pub fn encode(
    kind: Kind,
    sequence: u16,
    number: u16,
    body: &(impl Serialize + ?Sized),
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let end = write_message(kind, sequence, number, body, out)?;
    frame_message(end, out)
}

/// As [`encode`], of a body that is bytes already.
///
/// # Errors
/// The message is too long for the protocol or for `out`.
pub fn encode_body(
    kind: Kind,
    sequence: u16,
    number: u16,
    body: &[u8],
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let room = out.get_mut(BODY_AT..).and_then(|room| room.get_mut(..body.len()));
    room.ok_or(EncodeError::TooLong)?.copy_from_slice(body);
    let end = write_header(kind, sequence, number, body.len(), out)?;
    frame_message(end, out)
}

/// Writes header and body to where they lie in their frame, and returns where they end: all of the
/// frame that [`frame_message`] does not add.
///
/// # Errors
/// As [`encode`].
pub fn write_message(
    kind: Kind,
    sequence: u16,
    number: u16,
    body: &(impl Serialize + ?Sized),
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let room = out.get_mut(BODY_AT..).ok_or(EncodeError::TooLong)?;
    match postcard::to_slice(body, room).map(|body| body.len()) {
        Ok(length) => write_header(kind, sequence, number, length, out),
        Err(postcard::Error::SerializeBufferFull) => Err(EncodeError::TooLong),
        Err(_) => Err(EncodeError::Body),
    }
}

/// Puts the header before a body. [`write_message`] exists once for every message of the table,
/// this once for all.
#[inline(never)]
fn write_header(
    kind: Kind,
    sequence: u16,
    number: u16,
    length: usize,
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let [sequence_low, sequence_high] = sequence.to_le_bytes();
    let [number_low, number_high] = number.to_le_bytes();
    let before_body = out.first_chunk_mut().filter(|_| length <= MAX_BODY);
    // The 0 becomes the code byte of the first block.
    *before_body.ok_or(EncodeError::TooLong)? =
        [DELIMITER, 0, kind as u8, sequence_low, sequence_high, number_low, number_high];
    Ok(BODY_AT + length)
}

/// Makes the delimited frame of what [`write_message`] has written as far as `end`, and returns its
/// length: checksum and COBS take longer than the message.
///
/// # Errors
/// [`EncodeError::TooLong`]: `out` is too small, or there is no message.
#[inline(never)]
pub fn frame_message(end: usize, out: &mut [u8]) -> Result<usize, EncodeError> {
    put_around(end, out).ok_or(EncodeError::TooLong)
}

/// The frame of what has a `write_message`.
macro_rules! encode_frame {
    () => {
        /// Writes the whole delimited frame and returns its length. `sequence` is that of the
        /// request.
        ///
        /// # Errors
        /// `out` is too small; [`MAX_FRAME`](crate::MAX_FRAME) bytes are always enough.
        pub fn encode_frame(&self, sequence: u16, out: &mut [u8]) -> Result<usize, EncodeError> {
            $crate::encode::frame_message(self.write_message(sequence, out)?, out)
        }
    };
}
pub(crate) use encode_frame;

fn put_around(end: usize, out: &mut [u8]) -> Option<usize> {
    let (checked, behind) = out.split_at_mut_checked(end)?;
    let checksum = checksum_of(checked.get(MESSAGE_AT..)?);
    *behind.first_chunk_mut()? = checksum.to_le_bytes();
    stuff(out, end + CHECKSUM_SIZE)
}

/// COBS, in place: the code byte of a block takes the place of the zero that ended the block
/// before. Only behind a full block the rest makes room for it. Ends with the delimiter and returns
/// where that ends.
fn stuff(out: &mut [u8], mut end: usize) -> Option<usize> {
    let mut code_at = MESSAGE_AT - 1;
    if end < MESSAGE_AT + COBS_BLOCK {
        return stuff_short(out.get_mut(code_at..=end)?).map(|()| end + 1);
    }
    loop {
        let (code, data) = out.get_mut(code_at..end)?.split_first_mut()?;
        let block = data.get(..COBS_BLOCK).unwrap_or(data);
        let zero = block.iter().position(|byte| *byte == 0);
        let length = zero.unwrap_or(block.len());
        // Lossless: a full block's is COBS_FULL.
        #[allow(clippy::cast_possible_truncation)]
        let code_of_length = length as u8 + 1;
        *code = code_of_length;
        code_at += 1 + length;
        if zero.is_some() {
            continue;
        }
        if length < COBS_BLOCK {
            *out.get_mut(end)? = DELIMITER;
            return Some(end + 1);
        }
        end += 1;
        let mut moved = 0;
        out.get_mut(code_at..end)?.iter_mut().for_each(|byte| swap(byte, &mut moved));
    }
}

/// The same of a message that fills no block, from its first code byte to its delimiter: each code
/// byte says how far the next one is. From the end, so that each byte is looked at once.
fn stuff_short(out: &mut [u8]) -> Option<()> {
    let (delimiter, rest) = out.split_last_mut()?;
    *delimiter = DELIMITER;
    let (first, data) = rest.split_first_mut()?;
    let mut to_next = 1;
    for byte in data.iter_mut().rev() {
        if *byte == 0 {
            *byte = to_next;
            to_next = 0;
        }
        to_next += 1;
    }
    *first = to_next;
    Some(())
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::{Deframer, MAX_FRAME};

    #[test]
    fn ping_is_the_bytes_derived_by_hand() {
        // 01 0100 0200 and its CRC-32C 876383CF, from an independent computation; the two zeros
        // become block ends.
        let ping = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];
        let mut out = [0xEE; MAX_FRAME];
        assert_eq!(encode(Kind::Request, 1, 2, &(), &mut out), Ok(ping.len()));
        assert_eq!(out[..ping.len()], ping);
    }

    #[test]
    fn a_frame_is_refused_rather_than_cut() {
        let mut out = [0; MAX_FRAME];
        for size in 0..12 {
            assert_eq!(
                encode(Kind::Request, 1, 2, &(), &mut out[..size]),
                Err(EncodeError::TooLong)
            );
        }
        assert_eq!(
            encode(Kind::Request, 1, 2, &[[1u8; 31]; 17], &mut [0; 1024]),
            Err(EncodeError::TooLong)
        );
    }

    #[test]
    fn what_is_written_is_read_wherever_its_zeros_are() {
        for length in (0..20).chain(COBS_BLOCK - 20..COBS_BLOCK + 20).chain([MAX_BODY]) {
            for step in [1, 2, 7, 253, 254, 255, MAX_BODY + 1] {
                let body: std::vec::Vec<u8> =
                    (1..=length).map(|at| if at % step == 0 { 0 } else { 0xA5 }).collect();
                let mut frame = [0; MAX_FRAME];
                let end = encode_body(Kind::Event, 0x0101, 0x0101, &body, &mut frame).unwrap();
                let inside = &frame[1..end - 1];
                assert!(!inside.contains(&DELIMITER), "{length} bytes, each {step} is zero");
                let mut deframer = Deframer::new();
                let mut bytes = &frame[..end];
                let read = deframer.take(&mut bytes).unwrap().unwrap();
                assert_eq!(read.body, body, "{length} bytes, each {step} is zero");
            }
        }
    }

    #[test]
    fn the_longest_message_takes_exactly_the_longest_frame() {
        // 31 × 16 + 7 = 503 bytes of body; none of the bytes is 0 except those of the header.
        let body = ([[0x55u8; 31]; 16], [0x55u8; 7]);
        let length = encode(Kind::Event, 0x0101, 0x0101, &body, &mut [0; MAX_FRAME]);
        assert_eq!(length, Ok(MAX_FRAME));
    }
}
