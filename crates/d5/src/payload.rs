//! The five bytes between id and checksum: length, command, address, low, high.

use crate::error::DecodeError;
use crate::field::{ADDRESS, HIGH, LENGTH, LOW, ONE_DATA_BYTE, PAYLOAD_LEN, TWO_DATA_BYTES};

/// How many data bytes a frame carries: the length byte 0x04 or 0x05 (D5 manual, frame format).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Width {
    /// One: the addressed register.
    Byte,
    /// Two: the addressed register and the next.
    Word,
}

impl Width {
    fn length(self) -> u8 {
        match self {
            Width::Byte => ONE_DATA_BYTE,
            Width::Word => TWO_DATA_BYTES,
        }
    }
}

/// The data a frame carries, raw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Value {
    /// One byte.
    Byte(u8),
    /// Two bytes, sent low byte first.
    Word(u16),
}

impl Value {
    /// How many data bytes this is.
    pub fn width(self) -> Width {
        match self {
            Value::Byte(_) => Width::Byte,
            Value::Word(_) => Width::Word,
        }
    }
}

/// Length, command, address, low and high byte of a frame, raw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Payload(pub [u8; PAYLOAD_LEN]);

impl Payload {
    /// The command code.
    pub fn command(&self) -> u8 {
        let Payload([_, command, ..]) = *self;
        command
    }

    /// A command with fixed bytes behind it.
    pub(crate) fn fixed(command: u8, [address, low, high]: [u8; 3]) -> Payload {
        Payload([TWO_DATA_BYTES, command, address, low, high])
    }

    /// A command that asks for a register.
    pub(crate) fn asking(command: u8, address: u8, width: Width) -> Payload {
        Payload([width.length(), command, address, 0, 0])
    }

    /// A command with a register and its value.
    pub(crate) fn carrying(command: u8, address: u8, value: Value) -> Payload {
        let [low, high] = match value {
            Value::Byte(byte) => [byte, 0],
            Value::Word(word) => word.to_le_bytes(),
        };
        Payload([value.width().length(), command, address, low, high])
    }

    /// The width the length byte gives.
    pub(crate) fn width(&self) -> Result<Width, DecodeError> {
        match *self {
            Payload([ONE_DATA_BYTE, ..]) => Ok(Width::Byte),
            Payload([TWO_DATA_BYTES, ..]) => Ok(Width::Word),
            Payload([length, ..]) => {
                Err(DecodeError::Length { got: usize::from(length), expected: usize::from(TWO_DATA_BYTES) })
            }
        }
    }

    /// The data; with one data byte, the other must be zero.
    pub(crate) fn value(&self) -> Result<Value, DecodeError> {
        let Payload([_, _, _, low, high]) = *self;
        match self.width()? {
            Width::Byte => expect(HIGH, high, 0).map(|()| Value::Byte(low)),
            Width::Word => Ok(Value::Word(u16::from_le_bytes([low, high]))),
        }
    }

    /// Checks that the data bytes are zero, as in a request to read.
    pub(crate) fn expect_no_data(&self) -> Result<(), DecodeError> {
        let Payload([_, _, _, low, high]) = *self;
        expect(LOW, low, 0)?;
        expect(HIGH, high, 0)
    }

    /// Checks the length byte, and the three bytes behind the command against the printed ones.
    pub(crate) fn expect_fixed(&self, [at_address, at_low, at_high]: [u8; 3]) -> Result<(), DecodeError> {
        let Payload([length, _, address, low, high]) = *self;
        expect(LENGTH, length, TWO_DATA_BYTES)?;
        expect(ADDRESS, address, at_address)?;
        expect(LOW, low, at_low)?;
        expect(HIGH, high, at_high)
    }

    /// The two data bytes behind a fixed address.
    pub(crate) fn word_at(&self, register: u8) -> Result<u16, DecodeError> {
        let Payload([length, _, address, low, high]) = *self;
        expect(LENGTH, length, TWO_DATA_BYTES)?;
        expect(ADDRESS, address, register)?;
        Ok(u16::from_le_bytes([low, high]))
    }
}

fn expect(offset: usize, got: u8, expected: u8) -> Result<(), DecodeError> {
    if got == expected { Ok(()) } else { Err(DecodeError::FixedByte { offset, got, expected }) }
}
