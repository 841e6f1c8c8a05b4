//! A frame on the wire: `0x00 COBS(header ‖ body ‖ CRC) 0x00`, its parts and how a message is read.

use core::fmt;

use crc::{CRC_32_ISCSI, Crc};

/// Before and after each frame; nowhere else on the wire.
pub const DELIMITER: u8 = 0x00;

/// Header: kind u8, sequence u16, number u16.
pub const HEADER_SIZE: usize = 5;

/// CRC-32 Castagnoli, little-endian.
pub const CHECKSUM_SIZE: usize = 4;

/// Longest message: header, body and checksum, before COBS.
pub const MAX_MESSAGE: usize = 512;

/// Longest body.
pub const MAX_BODY: usize = MAX_MESSAGE - HEADER_SIZE - CHECKSUM_SIZE;

/// Data bytes of a full COBS block.
pub(crate) const COBS_BLOCK: usize = 254;

/// Code byte of a full COBS block, after which no zero is implied.
pub(crate) const COBS_FULL: u8 = 0xFF;

/// Longest frame on the wire: a code byte for each COBS block and both delimiters.
pub const MAX_FRAME: usize = 1 + MAX_MESSAGE + MAX_MESSAGE / COBS_BLOCK + 1 + 1;

/// The checksum, known as CRC-32C or CRC-32/ISCSI. Its table takes 1 KiB of the firmware: bit by
/// bit a reply of 100 bytes kept a stop waiting for 15 µs. Whatever else needs this checksum uses
/// this table.
pub static CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// [`CHECKSUM`] of bytes, four in a turn: of a frame's instructions it takes most.
#[inline(never)]
pub fn checksum_of(bytes: &[u8]) -> u32 {
    let [table] = CHECKSUM.table();
    let (turns, rest) = bytes.as_chunks::<4>();
    let mut sum = CRC_32_ISCSI.init;
    for &[first, second, third, fourth] in turns {
        sum = next(table, sum, first);
        sum = next(table, sum, second);
        sum = next(table, sum, third);
        sum = next(table, sum, fourth);
    }
    rest.iter().fold(sum, |sum, byte| next(table, sum, *byte)) ^ CRC_32_ISCSI.xorout
}

#[inline(always)]
fn next(table: &[u32; 256], sum: u32, byte: u8) -> u32 {
    let [low, ..] = sum.to_le_bytes();
    // Always inside: the table has one for each byte.
    table.get(usize::from(low ^ byte)).map_or(0, |of_byte| of_byte ^ sum >> 8)
}

/// What a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Kind {
    /// From the host: do this.
    Request = 1,
    /// From the gateway: the result of the request with this sequence and number.
    Reply = 2,
    /// From the gateway: why the request with this sequence was not executed.
    Error = 3,
    /// From the gateway: something happened.
    Event = 4,
    /// From the host, for one of its programs that only watches: as a request, but it is no sign of
    /// life, takes no authority, and opens no session.
    WatcherRequest = 5,
}

impl Kind {
    /// From the first byte of the header.
    ///
    /// # Errors
    /// No kind has this number.
    pub const fn from_number(number: u8) -> Result<Self, FrameError> {
        match number {
            1 => Ok(Self::Request),
            2 => Ok(Self::Reply),
            3 => Ok(Self::Error),
            4 => Ok(Self::Event),
            5 => Ok(Self::WatcherRequest),
            _ => Err(FrameError::UnknownKind(number)),
        }
    }
}

/// A frame whose checksum is right. The body lies in the deframer's buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame<'a> {
    /// What it is.
    pub kind: Kind,
    /// Request: chosen by the host. Reply and error: that of the request. Event: counts the events
    /// of the link.
    pub sequence: u16,
    /// Which request, reply, error or event.
    pub number: u16,
    /// The postcard body.
    pub body: &'a [u8],
    /// The checksum over header and body.
    pub checksum: u32,
}

impl<'a> Frame<'a> {
    /// Reads a message: what was between two delimiters, without its COBS.
    ///
    /// # Errors
    /// It is too short, its checksum is wrong, or its kind is unknown.
    pub fn from_message(message: &'a [u8]) -> Result<Self, FrameError> {
        let too_short = FrameError::TooShort { length: message.len() };
        let Some((checked, checksum)) = message.split_last_chunk::<CHECKSUM_SIZE>() else {
            return Err(too_short);
        };
        let Some((header, body)) = checked.split_first_chunk::<HEADER_SIZE>() else {
            return Err(too_short);
        };
        let received = u32::from_le_bytes(*checksum);
        let computed = checksum_of(checked);
        if received != computed {
            return Err(FrameError::Checksum { computed, received });
        }
        let [kind, sequence_low, sequence_high, number_low, number_high] = *header;
        Ok(Self {
            kind: Kind::from_number(kind)?,
            sequence: u16::from_le_bytes([sequence_low, sequence_high]),
            number: u16::from_le_bytes([number_low, number_high]),
            body,
            checksum: received,
        })
    }
}

/// Why bytes between two delimiters are no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// More than [`MAX_MESSAGE`] bytes.
    TooLong,
    /// The last COBS block is not complete.
    Cobs,
    /// Fewer bytes than header and checksum take.
    TooShort {
        /// Bytes after COBS.
        length: usize,
    },
    /// The checksum is wrong.
    Checksum {
        /// Over what was received.
        computed: u32,
        /// What was received.
        received: u32,
    },
    /// The header begins with a number that is no [`Kind`].
    UnknownKind(
        /// The number.
        u8,
    ),
}

impl FrameError {
    /// Every reason's number and name.
    pub const ALL: &'static [(u8, &'static str)] =
        &[(1, "TooLong"), (2, "Cobs"), (3, "TooShort"), (4, "Checksum"), (5, "UnknownKind")];

    /// The number, as in the event `FrameRejected`; from 1, without gaps.
    #[must_use]
    pub const fn number(&self) -> u8 {
        match self {
            Self::TooLong => 1,
            Self::Cobs => 2,
            Self::TooShort { .. } => 3,
            Self::Checksum { .. } => 4,
            Self::UnknownKind(_) => 5,
        }
    }
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong => write!(f, "frame of more than {MAX_MESSAGE} bytes"),
            Self::Cobs => f.write_str("frame with an incomplete COBS block"),
            Self::TooShort { length } => {
                write!(
                    f,
                    "frame of {length} bytes, at least {} are needed",
                    HEADER_SIZE + CHECKSUM_SIZE
                )
            }
            Self::Checksum { computed, received } => {
                write!(f, "frame with checksum {received:08X}, its bytes give {computed:08X}")
            }
            Self::UnknownKind(kind) => write!(f, "frame of unknown kind {kind}"),
        }
    }
}

impl core::error::Error for FrameError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_of_bytes_is_that_of_the_crate_however_many_they_are() {
        let bytes: [u8; 70] = core::array::from_fn(|at| u8::try_from(at * 73 % 251).unwrap());
        for length in 0..=bytes.len() {
            let bytes = &bytes[..length];
            assert_eq!(checksum_of(bytes), CHECKSUM.checksum(bytes), "{length} bytes");
        }
        // The check value of CRC-32C: its catalogue's.
        assert_eq!(checksum_of(b"123456789"), 0xE306_9283);
    }
}
