//! What can go wrong, with the data needed to say so.

use core::fmt;

/// Why a value cannot be put on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// The value lies outside the range the manual gives.
    OutOfRange {
        /// Which field.
        field: &'static str,
        /// The refused value, in the field's raw unit.
        value: i64,
        /// Lowest value allowed.
        min: i64,
        /// Highest value allowed.
        max: i64,
    },
    /// The value lies within the range but must not be sent.
    Forbidden {
        /// Which field.
        field: &'static str,
        /// The refused value, in the field's raw unit.
        value: i64,
        /// What the manual asks for.
        reason: &'static str,
    },
    /// The CAN frame type took neither the id nor the data.
    Frame,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EncodeError::OutOfRange { field, value, min, max } => {
                write!(f, "{field} {value} is outside {min}..={max}")
            }
            EncodeError::Forbidden { field, value, reason } => {
                write!(f, "{field} {value} is refused: {reason}")
            }
            EncodeError::Frame => write!(f, "the CAN frame type refused the frame"),
        }
    }
}

impl core::error::Error for EncodeError {}

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
        /// Bytes of a frame, or the length byte of a frame with two data bytes; it may also be one less.
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
            DecodeError::Length { got, expected } => write!(f, "{got} data bytes instead of {expected}"),
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
