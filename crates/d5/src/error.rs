//! What can go wrong, with the data needed to say so.

use core::fmt;

pub use codec::EncodeError;

/// Why received bytes are not a message of this protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DecodeError {
    /// A remote frame: the protocol has data frames only.
    RemoteFrame,
    /// Wrong number of bytes.
    Length {
        /// Bytes received, or the length byte.
        got: usize,
        /// Bytes of a frame, or the length byte of a frame with two data bytes; it may also be one
        /// less.
        expected: usize,
    },
    /// The last byte is not the sum of the bytes after the header (D5 manual, frame format).
    Checksum {
        /// Checksum received.
        got: u8,
        /// Checksum of the bytes received.
        expected: u8,
    },
    /// The frame does not start with the header byte of its direction (D5 manual, frame format).
    Header {
        /// First byte received.
        got: u8,
        /// The header byte.
        expected: u8,
    },
    /// The id byte names no single motor, or is a broadcast where there can be none.
    Node {
        /// The id byte received.
        node: u8,
    },
    /// A byte that the manual fixes has another value.
    FixedByte {
        /// Its offset in the frame.
        offset: usize,
        /// The value received.
        got: u8,
        /// The value the manual gives.
        expected: u8,
    },
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DecodeError::RemoteFrame => write!(f, "remote frame"),
            DecodeError::Length { got, expected } => {
                write!(f, "{got} data bytes instead of {expected}")
            }
            DecodeError::Checksum { got, expected } => {
                write!(f, "checksum {got:#04x} instead of {expected:#04x}")
            }
            DecodeError::Header { got, expected } => {
                write!(f, "first byte {got:#04x} instead of {expected:#04x}")
            }
            DecodeError::Node { node } => write!(f, "id {node:#04x} names no single motor"),
            DecodeError::FixedByte { offset, got, expected } => {
                write!(f, "byte {offset} is {got:#04x} instead of {expected:#04x}")
            }
        }
    }
}

impl core::error::Error for DecodeError {}
