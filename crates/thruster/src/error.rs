//! What can go wrong, with the data needed to say so.

use core::fmt;

pub use codec::EncodeError;

/// Why received bytes are not a message of this protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DecodeError {
    /// The standard CAN id belongs to no device in this direction.
    WrongId {
        /// The id received.
        id: u16,
    },
    /// An extended CAN id: the protocol has standard frames only (Thruster manual §1.1).
    ExtendedId {
        /// The id received.
        id: u32,
    },
    /// A remote frame: the protocol has data frames only (Thruster manual §1.1).
    RemoteFrame,
    /// The data field has another length than the command needs.
    Length {
        /// Bytes received.
        got: usize,
        /// Bytes of the full form.
        expected: usize,
    },
    /// Bytes 4–5 are neither zero nor, where the value is signed, a sign extension.
    UpperHalf {
        /// The upper half received.
        got: u16,
    },
    /// A byte that the manual fixes has another value.
    FixedByte {
        /// Its offset in the data field.
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
            DecodeError::WrongId { id } => {
                write!(f, "CAN id {id:#05x} belongs to no device in this direction")
            }
            DecodeError::ExtendedId { id } => write!(f, "extended CAN id {id:#010x}"),
            DecodeError::RemoteFrame => write!(f, "remote frame"),
            DecodeError::Length { got, expected } => {
                write!(f, "{got} data bytes instead of {expected}")
            }
            DecodeError::UpperHalf { got } => write!(f, "upper half {got:#06x} of a 16-bit value"),
            DecodeError::FixedByte { offset, got, expected } => {
                write!(f, "byte {offset} is {got:#04x} instead of {expected:#04x}")
            }
        }
    }
}

impl core::error::Error for DecodeError {}
