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
            DecodeError::Length { got, expected } => write!(f, "{got} data bytes instead of {expected}"),
            DecodeError::UpperHalf { got } => write!(f, "upper half {got:#06x} of a 16-bit value"),
            DecodeError::FixedByte { offset, got, expected } => {
                write!(f, "byte {offset} is {got:#04x} instead of {expected:#04x}")
            }
        }
    }
}

impl core::error::Error for DecodeError {}
