//! How a frame is written: one pass, from the value to the delimited bytes.

use core::fmt;

use crc::{Digest, Table};
use postcard::ser_flavors::Flavor;
use serde::Serialize;

use crate::frame::{CHECKSUM, COBS_FULL, DELIMITER, HEADER_SIZE, Kind, MAX_MESSAGE};

/// Why a frame could not be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// More than [`MAX_MESSAGE`] bytes, which no message of the table has, or more than `out`
    /// holds.
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
    let mut writer = Writer::start(kind, sequence, number, out)?;
    let written = postcard::serialize_with_flavor(body, Body(&mut writer));
    writer.finish(written)
}

/// Puts bytes on their way to the wire: each into the checksum and through COBS into `out`, with no
/// second copy.
struct Writer<'a> {
    out: &'a mut [u8],
    length: usize,
    /// Where the code byte of the current COBS block will be.
    code_at: usize,
    /// That code byte as it is now: one more than the block's data bytes.
    code: u8,
    /// Bytes before COBS.
    message_length: usize,
    digest: Digest<'static, u32, Table<1>>,
}

/// [`encode`] exists once for every message of the table, so all that does not depend on the
/// message is kept out of it: inlined, it would take 3 KiB of a firmware.
impl<'a> Writer<'a> {
    /// The opening delimiter and the header.
    #[inline(never)]
    fn start(
        kind: Kind,
        sequence: u16,
        number: u16,
        out: &'a mut [u8],
    ) -> Result<Self, EncodeError> {
        let [delimiter, _code, ..] = out else { return Err(EncodeError::TooLong) };
        *delimiter = DELIMITER;
        let mut writer = Self {
            out,
            length: 2,
            code_at: 1,
            code: 1,
            message_length: 0,
            digest: CHECKSUM.digest(),
        };
        let [sequence_low, sequence_high] = sequence.to_le_bytes();
        let [number_low, number_high] = number.to_le_bytes();
        let header: [u8; HEADER_SIZE] =
            [kind as u8, sequence_low, sequence_high, number_low, number_high];
        match header.into_iter().try_for_each(|byte| writer.push(byte)) {
            Ok(()) => Ok(writer),
            Err(_) => Err(EncodeError::TooLong),
        }
    }

    /// One byte of header or body.
    #[inline(never)]
    fn push(&mut self, byte: u8) -> postcard::Result<()> {
        self.digest.update(&[byte]);
        self.stuff(byte)
    }

    /// The checksum and the closing delimiter, behind a body that was `written` or not.
    #[inline(never)]
    fn finish(mut self, written: postcard::Result<()>) -> Result<usize, EncodeError> {
        let finished = written.and_then(|()| {
            let checksum = self.digest.clone().finalize();
            checksum.to_le_bytes().into_iter().try_for_each(|byte| self.stuff(byte))?;
            self.close_block();
            self.write(DELIMITER)
        });
        match finished {
            Ok(()) => Ok(self.length),
            Err(postcard::Error::SerializeBufferFull) => Err(EncodeError::TooLong),
            Err(_) => Err(EncodeError::Body),
        }
    }

    fn write(&mut self, byte: u8) -> postcard::Result<()> {
        let place = self.out.get_mut(self.length).ok_or(postcard::Error::SerializeBufferFull)?;
        *place = byte;
        self.length += 1;
        Ok(())
    }

    fn close_block(&mut self) {
        if let Some(place) = self.out.get_mut(self.code_at) {
            *place = self.code;
        }
    }

    fn open_block(&mut self) -> postcard::Result<()> {
        self.code_at = self.length;
        self.code = 1;
        self.write(0)
    }

    /// COBS: a zero ends the block instead of being written, and a full block ends by itself.
    fn stuff(&mut self, byte: u8) -> postcard::Result<()> {
        if self.message_length >= MAX_MESSAGE {
            return Err(postcard::Error::SerializeBufferFull);
        }
        self.message_length += 1;
        if byte != DELIMITER {
            self.write(byte)?;
            self.code += 1;
        }
        if byte == DELIMITER || self.code == COBS_FULL {
            self.close_block();
            self.open_block()?;
        }
        Ok(())
    }
}

/// The body's way into a [`Writer`].
struct Body<'w, 'a>(&'w mut Writer<'a>);

impl Flavor for Body<'_, '_> {
    type Output = ();

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.0.push(byte)
    }

    fn finalize(self) -> postcard::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MAX_FRAME;

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
    fn the_longest_message_takes_exactly_the_longest_frame() {
        // 31 × 16 + 7 = 503 bytes of body; none of the bytes is 0 except those of the header.
        let body = ([[0x55u8; 31]; 16], [0x55u8; 7]);
        let length = encode(Kind::Event, 0x0101, 0x0101, &body, &mut [0; MAX_FRAME]);
        assert_eq!(length, Ok(MAX_FRAME));
    }
}
