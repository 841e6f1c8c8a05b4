//! What cannot be encoded and what cannot be decoded.

use core::fmt;

pub use codec::EncodeError;

/// A frame that is none of this protocol's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DecodeError {
    /// The standard CAN id belongs to no motor in this direction.
    WrongId {
        /// The id received.
        id: u16,
    },
    /// An extended CAN id: the protocol has standard frames only (RMD V3.6 §1.1.2).
    ExtendedId {
        /// The id received.
        id: u32,
    },
    /// A remote frame: the protocol has data frames only (RMD V3.6 §1.1.2).
    RemoteFrame,
    /// Wrong number of data bytes.
    Length {
        /// Bytes received, or the RS485 length byte.
        got: usize,
        /// Bytes the protocol has.
        expected: usize,
    },
    /// The RS485 checksum does not match (RMD V3.6 §1.2.2).
    Checksum {
        /// Checksum received.
        got: u16,
        /// Checksum of the bytes received.
        expected: u16,
    },
    /// The RS485 frame does not start with its header byte (RMD V3.6 §1.2.2).
    Header {
        /// First byte received.
        got: u8,
        /// The header byte.
        expected: u8,
    },
    /// The RS485 id byte names no single motor (RMD V3.6 §1.2.2).
    Node {
        /// The id byte received.
        node: u8,
    },
    /// The data of an id reply name no motor (RMD V3.6 §4.3, §7.3).
    BusId {
        /// The id in the data: the last byte of a written id, the last two of a read one.
        word: u16,
    },
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DecodeError::WrongId { id } => {
                write!(f, "CAN id {id:#05x} belongs to no motor in this direction")
            }
            DecodeError::ExtendedId { id } => write!(f, "extended CAN id {id:#010x}"),
            DecodeError::RemoteFrame => write!(f, "remote frame"),
            DecodeError::Length { got, expected } => {
                write!(f, "{got} data bytes instead of {expected}")
            }
            DecodeError::Checksum { got, expected } => {
                write!(f, "checksum {got:#06x} instead of {expected:#06x}")
            }
            DecodeError::Header { got, expected } => {
                write!(f, "first byte {got:#04x} instead of {expected:#04x}")
            }
            DecodeError::Node { node } => write!(f, "id {node:#04x} names no single motor"),
            DecodeError::BusId { word } => write!(f, "{word:#06x} is no motor's id"),
        }
    }
}

impl core::error::Error for DecodeError {}
