//! The five bytes between id and checksum: length, command, address, low, high.

use codec::{Decode, Encode, FieldInfo, FieldKind, Layout, Shown, Visit};

use crate::error::DecodeError;
use crate::field::{ADDRESS, HIGH, LENGTH, LOW, ONE_DATA_BYTE, PAYLOAD_LEN, TWO_DATA_BYTES};
use crate::register::Register;
use crate::units::TurnDegrees;

/// How many data bytes a frame carries: the length byte 0x04 or 0x05 (D5 manual, frame format).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Payload(pub [u8; PAYLOAD_LEN]);

impl Payload {
    /// The command code.
    pub const fn command(&self) -> u8 {
        let Payload([_, command, ..]) = *self;
        command
    }

    /// Puts data in, with the length byte that tells how many.
    fn put_value(&mut self, value: Value) {
        let Payload([length, _, _, low, high]) = self;
        *length = value.width().length();
        [*low, *high] = match value {
            Value::Byte(byte) => [byte, 0],
            Value::Word(word) => word.to_le_bytes(),
        };
    }

    /// The width the length byte gives.
    pub(crate) fn width(&self) -> Result<Width, DecodeError> {
        match *self {
            Payload([ONE_DATA_BYTE, ..]) => Ok(Width::Byte),
            Payload([TWO_DATA_BYTES, ..]) => Ok(Width::Word),
            Payload([length, ..]) => Err(DecodeError::Length {
                got: usize::from(length),
                expected: usize::from(TWO_DATA_BYTES),
            }),
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

    /// Checks the length byte, and the three bytes behind the command against the printed ones.
    pub(crate) fn expect_fixed(
        &self,
        [at_address, at_low, at_high]: [u8; 3],
    ) -> Result<(), DecodeError> {
        let Payload([length, _, address, low, high]) = *self;
        expect(LENGTH, length, TWO_DATA_BYTES)?;
        expect(ADDRESS, address, at_address)?;
        expect(LOW, low, at_low)?;
        expect(HIGH, high, at_high)
    }
}

impl Layout for Payload {
    type Data = Payload;
    type Code = u8;
    /// The bytes behind the command.
    type Fixed = [u8; 3];
    type Error = DecodeError;

    fn new(code: u8, [address, low, high]: [u8; 3], _: &[usize]) -> Payload {
        Payload([TWO_DATA_BYTES, code, address, low, high])
    }

    fn expect(data: &Payload, fixed: [u8; 3], places: &[usize]) -> Result<(), DecodeError> {
        if places.is_empty() { data.expect_fixed(fixed) } else { Ok(()) }
    }
}

impl Decode<Payload> for Register {
    fn get<const AT: usize>(data: &Payload) -> Result<Register, DecodeError> {
        let Payload([_, _, address, ..]) = *data;
        Ok(Register(address))
    }
}

impl Encode<Payload> for Register {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        let Payload([_, _, address, ..]) = data;
        *address = self.0;
    }
}

/// The length byte of a request to read, whose data bytes are zero.
impl Decode<Payload> for Width {
    fn get<const AT: usize>(data: &Payload) -> Result<Width, DecodeError> {
        let (width, Payload([_, _, _, low, high])) = (data.width()?, *data);
        expect(LOW, low, 0)?;
        expect(HIGH, high, 0)?;
        Ok(width)
    }
}

impl Encode<Payload> for Width {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        let Payload([length, ..]) = data;
        *length = self.length();
    }
}

/// The data, and the length byte that tells how many.
impl Decode<Payload> for Value {
    fn get<const AT: usize>(data: &Payload) -> Result<Value, DecodeError> {
        data.value()
    }
}

impl Encode<Payload> for Value {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        data.put_value(*self);
    }
}

/// Two data bytes behind the address of the magnetic angle.
impl Decode<Payload> for TurnDegrees {
    fn get<const AT: usize>(data: &Payload) -> Result<TurnDegrees, DecodeError> {
        let Payload([length, _, address, low, high]) = *data;
        let Register(register) = Register::MAGNETIC_ANGLE;
        expect(LENGTH, length, TWO_DATA_BYTES)?;
        expect(ADDRESS, address, register)?;
        Ok(TurnDegrees(u16::from_le_bytes([low, high])))
    }
}

impl Encode<Payload> for TurnDegrees {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        Register::MAGNETIC_ANGLE.put::<AT>(data);
        data.put_value(Value::Word(self.0));
    }
}

/// The command code.
impl Encode<Payload> for u8 {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        let Payload([_, command, ..]) = data;
        *command = *self;
    }
}

/// All five bytes.
impl Decode<Payload> for Payload {
    fn get<const AT: usize>(data: &Payload) -> Result<Payload, DecodeError> {
        Ok(*data)
    }
}

impl Encode<Payload> for Payload {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        *data = *self;
    }
}

impl Shown for Payload {
    const INFO: FieldInfo = FieldInfo::other(FieldKind::Bytes, "");

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        field.visit_bytes(visit, &self.0);
    }
}

fn expect(offset: usize, got: u8, expected: u8) -> Result<(), DecodeError> {
    if got == expected { Ok(()) } else { Err(DecodeError::FixedByte { offset, got, expected }) }
}
