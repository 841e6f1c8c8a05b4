//! The data field of a frame: a command word, a parameter word and, in the long form, four data bytes.

use crate::error::{DecodeError, EncodeError};
use crate::field::{self, DATA, FULL_LEN, PARAMETER, REFUSAL, SHORT_LEN, command};
use crate::returned::{ReturnFlags, ReturnFrames};
use crate::units::Milliseconds;

/// A data field (Thruster manual §1.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Payload {
    /// Four bytes: a command that carries no data.
    Short([u8; SHORT_LEN]),
    /// Eight bytes: a command with four data bytes.
    Full([u8; FULL_LEN]),
}

impl Payload {
    /// The bytes, four or eight.
    pub fn as_slice(&self) -> &[u8] {
        match self {
            Payload::Short(bytes) => bytes,
            Payload::Full(bytes) => bytes,
        }
    }

    /// Bytes 0–1, the command word.
    pub fn command(&self) -> u16 {
        let (Payload::Short([high, low, ..]) | Payload::Full([high, low, ..])) = *self;
        u16::from_be_bytes([high, low])
    }

    /// Bytes 2–3: the speed of a position command, else a sub-command or zero.
    pub(crate) fn parameter(&self) -> u16 {
        let (Payload::Short([_, _, high, low]) | Payload::Full([_, _, high, low, ..])) = *self;
        u16::from_be_bytes([high, low])
    }

    pub(crate) fn short_with(command: u16, parameter: u16) -> Payload {
        let ([c0, c1], [p0, p1]) = (command.to_be_bytes(), parameter.to_be_bytes());
        Payload::Short([c0, c1, p0, p1])
    }

    pub(crate) fn full(command: u16, parameter: u16, data: [u8; 4]) -> Payload {
        let ([c0, c1], [p0, p1], [d0, d1, d2, d3]) = (command.to_be_bytes(), parameter.to_be_bytes(), data);
        Payload::Full([c0, c1, p0, p1, d0, d1, d2, d3])
    }

    /// A signed value in bytes 6–7. The upper half is sent as zero, negative values included (§1.3, TC −5).
    pub(crate) fn signed(command: u16, value: i16) -> Payload {
        let [high, low] = value.to_be_bytes();
        Payload::full(command, 0, [0, 0, high, low])
    }

    /// An unsigned value in bytes 6–7.
    pub(crate) fn unsigned(command: u16, value: u16) -> Payload {
        let [high, low] = value.to_be_bytes();
        Payload::full(command, 0, [0, 0, high, low])
    }

    /// A 32-bit position in bytes 4–7, with a speed or zero in bytes 2–3.
    pub(crate) fn position(command: u16, parameter: u16, position: i32) -> Payload {
        Payload::full(command, parameter, position.to_be_bytes())
    }

    /// VM: flags in byte 6, frames in byte 7.
    pub(crate) fn returning(flags: ReturnFlags, frames: ReturnFrames) -> Payload {
        Payload::full(command::VM, 0, [0, 0, flags.bits(), frames.bits()])
    }

    /// SR: frames in byte 5, the interval in bytes 6–7.
    pub(crate) fn streaming(frames: ReturnFrames, interval: Milliseconds) -> Payload {
        let [high, low] = interval.0.to_be_bytes();
        Payload::full(command::SR, 0, [0, frames.bits(), high, low])
    }

    /// Whether the data are those of a refusal. Only in replies to set commands do they mean one.
    pub(crate) fn has_refusal_data(&self) -> bool {
        matches!(*self, Payload::Full([_, _, _, _, d0, d1, d2, d3]) if [d0, d1, d2, d3] == REFUSAL)
    }

    /// Refuses data with which a device refuses; the error names the field they come from.
    pub(crate) fn expect_no_refusal(self, field: &'static str, value: i64) -> Result<Payload, EncodeError> {
        if self.has_refusal_data() { Err(field::refusal_bytes(field, value)) } else { Ok(self) }
    }

    /// Checks that no bit is set beyond the command word. Accepts the short and the zero-padded form.
    pub(crate) fn expect_bare(&self) -> Result<(), DecodeError> {
        self.expect_zero_from(PARAMETER, self.as_slice())
    }

    /// Checks that bytes 2–3 are zero.
    pub(crate) fn expect_no_parameter(&self) -> Result<(), DecodeError> {
        let (Payload::Short([c0, c1, p0, p1]) | Payload::Full([c0, c1, p0, p1, ..])) = *self;
        self.expect_zero_from(PARAMETER, &[c0, c1, p0, p1])
    }

    /// Checks that no bit is set beyond bytes 2–3. Accepts the short and the zero-padded form.
    pub(crate) fn expect_no_data(&self) -> Result<(), DecodeError> {
        self.expect_zero_from(DATA, self.as_slice())
    }

    fn expect_zero_from(&self, start: usize, bytes: &[u8]) -> Result<(), DecodeError> {
        match bytes.iter().enumerate().skip(start).find(|&(_, &byte)| byte != 0) {
            Some((offset, &got)) => Err(DecodeError::FixedByte { offset, got, expected: 0 }),
            None => Ok(()),
        }
    }

    /// The signed value of bytes 6–7. Some drives sign-extend it to 32 bits, so FFFF passes as upper half.
    pub(crate) fn signed_value(&self) -> Result<i16, DecodeError> {
        let ([u0, u1, high, low], ()) = (self.data()?, self.expect_no_parameter()?);
        match u16::from_be_bytes([u0, u1]) {
            0x0000 | 0xFFFF => Ok(i16::from_be_bytes([high, low])),
            got => Err(DecodeError::UpperHalf { got }),
        }
    }

    /// The unsigned value of bytes 6–7; nothing but zero passes as upper half.
    pub(crate) fn unsigned_value(&self) -> Result<u16, DecodeError> {
        let ([u0, u1, high, low], ()) = (self.data()?, self.expect_no_parameter()?);
        match u16::from_be_bytes([u0, u1]) {
            0 => Ok(u16::from_be_bytes([high, low])),
            got => Err(DecodeError::UpperHalf { got }),
        }
    }

    /// The 32-bit position of bytes 4–7; bytes 2–3 are not looked at.
    pub(crate) fn position_value(&self) -> Result<i32, DecodeError> {
        Ok(i32::from_be_bytes(self.data()?))
    }

    /// The flags and frames of VM.
    pub(crate) fn return_value(&self) -> Result<(ReturnFlags, ReturnFrames), DecodeError> {
        let [flags, frames] = self.unsigned_value()?.to_be_bytes();
        Ok((ReturnFlags::from_bits_retain(flags), ReturnFrames::from_bits_retain(frames)))
    }

    /// The frames and the interval of SR.
    pub(crate) fn stream_value(&self) -> Result<(ReturnFrames, Milliseconds), DecodeError> {
        self.expect_no_parameter()?;
        let [reserved, frames, high, low] = self.data()?;
        if reserved != 0 {
            return Err(DecodeError::FixedByte { offset: DATA, got: reserved, expected: 0 });
        }
        Ok((ReturnFrames::from_bits_retain(frames), Milliseconds(u16::from_be_bytes([high, low]))))
    }

    /// Bytes 4–7.
    pub(crate) fn data(&self) -> Result<[u8; FULL_LEN - DATA], DecodeError> {
        match *self {
            Payload::Full([_, _, _, _, d0, d1, d2, d3]) => Ok([d0, d1, d2, d3]),
            Payload::Short(_) => Err(DecodeError::Length { got: SHORT_LEN, expected: FULL_LEN }),
        }
    }
}

impl TryFrom<&[u8]> for Payload {
    type Error = DecodeError;

    fn try_from(bytes: &[u8]) -> Result<Payload, DecodeError> {
        if let Ok(bytes) = <[u8; SHORT_LEN]>::try_from(bytes) {
            return Ok(Payload::Short(bytes));
        }
        match <[u8; FULL_LEN]>::try_from(bytes) {
            Ok(bytes) => Ok(Payload::Full(bytes)),
            Err(_) => Err(DecodeError::Length { got: bytes.len(), expected: FULL_LEN }),
        }
    }
}
