//! The data field of a frame: a command word, a parameter word and, in the long form, four data
//! bytes.

use codec::{Decode, Encode, FieldInfo, FieldKind, Layout, Number, Shown, Visit};

use crate::error::DecodeError;
use crate::faults::Faults;
use crate::field::{DATA, FULL_LEN, LOWER_HALF, PARAMETER, POSITION_LIMITS, REFUSAL, SHORT_LEN};
use crate::units::{
    Celsius, Deciamps, Decidegrees, Decivolts, LimitDecidegrees, Milliseconds, Percent, Rpm,
    RpmLimit,
};

/// A data field (Thruster manual §1.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    pub const fn command(&self) -> u16 {
        let (Payload::Short([high, low, ..]) | Payload::Full([high, low, ..])) = *self;
        u16::from_be_bytes([high, low])
    }

    /// Bytes 2–3: the speed of a position command, else a sub-command or zero.
    pub(crate) fn parameter(&self) -> u16 {
        let (Payload::Short([_, _, high, low]) | Payload::Full([_, _, high, low, ..])) = *self;
        u16::from_be_bytes([high, low])
    }

    /// Whether the data are those of a refusal. Only in replies to set commands do they mean one.
    pub(crate) fn has_refusal_data(&self) -> bool {
        matches!(*self, Payload::Full([_, _, _, _, d0, d1, d2, d3]) if [d0, d1, d2, d3] == REFUSAL)
    }

    /// Checks that no bit is set beyond the command word. What carries no data is accepted in both
    /// lengths (public drivers pad with zeros).
    // Here and below, one copy instead of one for each command.
    #[inline(never)]
    fn expect_bare(&self) -> Result<(), DecodeError> {
        match self {
            Payload::Short([_, _, 0, 0]) | Payload::Full([_, _, 0, 0, 0, 0, 0, 0]) => Ok(()),
            _ => self.expect_zero_from(PARAMETER, self.as_slice()),
        }
    }

    /// Checks that no bit is set beyond bytes 2–3, in both lengths.
    #[inline(never)]
    pub(crate) fn expect_no_data(&self) -> Result<(), DecodeError> {
        self.expect_zero_from(DATA, self.as_slice())
    }

    /// Checks that there are data, and no parameter before them.
    #[inline(never)]
    fn expect_value(&self) -> Result<(), DecodeError> {
        match self {
            Payload::Full([_, _, 0, 0, ..]) => Ok(()),
            _ => self.data().and_then(|_| self.expect_no_parameter()),
        }
    }

    /// Checks that bytes 2–3 are zero.
    pub(crate) fn expect_no_parameter(&self) -> Result<(), DecodeError> {
        let (Payload::Short([c0, c1, p0, p1]) | Payload::Full([c0, c1, p0, p1, ..])) = *self;
        self.expect_zero_from(PARAMETER, &[c0, c1, p0, p1])
    }

    fn expect_zero_from(&self, start: usize, bytes: &[u8]) -> Result<(), DecodeError> {
        match bytes.iter().enumerate().skip(start).find(|&(_, &byte)| byte != 0) {
            Some((offset, &got)) => Err(DecodeError::FixedByte { offset, got, expected: 0 }),
            None => Ok(()),
        }
    }

    /// Bytes 6–7, if bytes 4–5 before them are as they may be.
    fn lower_half(&self, upper: impl Fn(u16) -> bool) -> Result<[u8; 2], DecodeError> {
        let [u0, u1, high, low] = self.data()?;
        match u16::from_be_bytes([u0, u1]) {
            got if upper(got) => Ok([high, low]),
            got => Err(DecodeError::UpperHalf { got }),
        }
    }

    /// The bytes from one place on.
    fn bytes<const AT: usize, const N: usize>(&self) -> Result<[u8; N], DecodeError> {
        let bytes = self.as_slice().get(AT..).and_then(<[u8]>::first_chunk);
        bytes.copied().ok_or(DecodeError::Length { got: self.as_slice().len(), expected: FULL_LEN })
    }

    /// Puts bytes from one place on, if there are so many.
    pub(crate) fn put_bytes<const AT: usize, const N: usize>(&mut self, bytes: [u8; N]) {
        let data: &mut [u8] = match self {
            Payload::Short(data) => data,
            Payload::Full(data) => data,
        };
        if let Some(place) = data.get_mut(AT..).and_then(<[u8]>::first_chunk_mut) {
            *place = bytes;
        }
    }

    /// Bytes 4–7.
    pub(crate) fn data(&self) -> Result<[u8; FULL_LEN - DATA], DecodeError> {
        match *self {
            Payload::Full([_, _, _, _, d0, d1, d2, d3]) => Ok([d0, d1, d2, d3]),
            Payload::Short(_) => Err(DecodeError::Length { got: SHORT_LEN, expected: FULL_LEN }),
        }
    }
}

/// A command with four bytes.
pub(crate) const SHORT: Payload = Payload::Short([0; SHORT_LEN]);
/// A command about the position limits, with four bytes and with eight.
pub(crate) const SHORT_LIMITS: Payload = Payload::Short([0, 0, LIMITS_HIGH, LIMITS_LOW]);
/// See [`SHORT_LIMITS`].
pub(crate) const LIMITS: Payload = Payload::Full([0, 0, LIMITS_HIGH, LIMITS_LOW, 0, 0, 0, 0]);
const LIMITS_HIGH: u8 = POSITION_LIMITS.to_be_bytes()[0];
const LIMITS_LOW: u8 = POSITION_LIMITS.to_be_bytes()[1];
/// A reply that refuses.
pub(crate) const REFUSED: Payload = Payload::Full([0, 0, 0, 0, 0x00, 0x00, 0xEE, 0xEE]);

/// Eight zeros.
impl Default for Payload {
    fn default() -> Payload {
        Payload::Full([0; FULL_LEN])
    }
}

impl Layout for Payload {
    type Data = Payload;
    type Code = u16;
    /// The bytes before the command word and the values are put in.
    type Fixed = Payload;
    type Error = DecodeError;

    fn new(code: u16, mut fixed: Payload, _: &[usize]) -> Payload {
        fixed.put_bytes::<0, _>(code.to_be_bytes());
        fixed
    }

    fn expect(data: &Payload, _: Payload, places: &[usize]) -> Result<(), DecodeError> {
        match places {
            [] => data.expect_bare(),
            [PARAMETER] => data.expect_no_data(),
            [PARAMETER, ..] => Ok(()),
            _ => data.expect_value(),
        }
    }
}

/// Words are big-endian. From byte 4 on a word is the lower half of four bytes: the upper half is
/// sent as zero, negative values included (§1.3, TC −5). Some drives sign-extend negative values,
/// so FFFF passes as upper half of them.
macro_rules! words {
    ($($Number:ident, $is_upper_half:expr;)*) => {
        $(impl Decode<Payload> for $Number {
            fn get<const AT: usize>(data: &Payload) -> Result<$Number, DecodeError> {
                let bytes = if AT == DATA { data.lower_half($is_upper_half)? } else { data.bytes::<AT, 2>()? };
                Ok(Number::from_raw(<$Number as Number>::Raw::from_be_bytes(bytes)))
            }
        }

        impl Encode<Payload> for $Number {
            fn put<const AT: usize>(&self, data: &mut Payload) {
                let bytes = self.raw().to_be_bytes();
                if AT == DATA { data.put_bytes::<LOWER_HALF, _>(bytes) } else { data.put_bytes::<AT, _>(bytes) }
            }
        })*
    };
}

const fn zero(upper: u16) -> bool {
    upper == 0
}

const fn zero_or_sign(upper: u16) -> bool {
    upper == 0x0000 || upper == 0xFFFF
}

words! {
    Percent, zero_or_sign;
    Rpm, zero_or_sign;
    Deciamps, zero_or_sign;
    Celsius, zero_or_sign;
    u16, zero;
    RpmLimit, zero;
    Decivolts, zero;
    Milliseconds, zero;
}

/// Other types, by the bytes they stand for.
macro_rules! bytes {
    ($($Value:ty, $from:expr, $to:expr;)*) => {
        $(impl Decode<Payload> for $Value {
            fn get<const AT: usize>(data: &Payload) -> Result<$Value, DecodeError> {
                data.bytes::<AT, _>().map($from)
            }
        }

        impl Encode<Payload> for $Value {
            fn put<const AT: usize>(&self, data: &mut Payload) {
                data.put_bytes::<AT, _>($to(*self));
            }
        })*
    };
}

bytes! {
    [u8; 4], |bytes| bytes, |bytes| bytes;
    Decidegrees, |bytes| Decidegrees(i32::from_be_bytes(bytes)), |angle: Decidegrees| angle.0.to_be_bytes();
    LimitDecidegrees, |bytes| LimitDecidegrees(i16::from_be_bytes(bytes)), |limit: LimitDecidegrees| limit.0.to_be_bytes();
}

impl Decode<Payload> for Faults {
    fn get<const AT: usize>(data: &Payload) -> Result<Faults, DecodeError> {
        u16::get::<AT>(data).map(Faults::from_bits_retain)
    }
}

impl Encode<Payload> for Faults {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        self.bits().put::<AT>(data);
    }
}

/// The whole data field.
impl Encode<Payload> for Payload {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        *data = *self;
    }
}

impl Shown for Payload {
    const INFO: FieldInfo = FieldInfo::other(FieldKind::Bytes, "");

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        field.visit_bytes(visit, self.as_slice());
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
