//! The eight data bytes of a frame: where values stand in them, and how.

use core::convert::Infallible;

use codec::{Decode, Encode, Layout, Number};

use crate::faults::Faults;
use crate::field::{DATA_LEN, Field};
use crate::model::{Model, ModelPart};
use crate::units::{
    Celsius, Centiamps, Centidegrees, CentidegreesPerSecond, Decivolts, Deciwatts, Degrees,
    DegreesPerSecond, DegreesPerSecondSquared, EncoderCounts, EncoderPulses, FeedForward,
    FineSpeedLimit, Milliseconds, SingleTurn, SpeedLimit, TorqueCap, VersionDate,
};

/// How the data bytes are laid out: the command byte first.
pub(crate) struct Payload;

impl Layout for Payload {
    type Data = [u8; DATA_LEN];
    type Code = u8;
    /// The bytes after the command byte.
    type Fixed = [u8; DATA_LEN - 1];
    type Error = Infallible;

    fn new(code: u8, [d1, d2, d3, d4, d5, d6, d7]: [u8; 7], _: &[usize]) -> [u8; DATA_LEN] {
        [code, d1, d2, d3, d4, d5, d6, d7]
    }

    /// Bytes the manual calls NULL are passed over.
    fn expect(_: &[u8; DATA_LEN], _: [u8; 7], _: &[usize]) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Numbers are little-endian.
macro_rules! little_endian {
    ($($Number:ident: $LEN:literal),* $(,)?) => {
        $(impl Decode<Payload> for $Number {
            fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<$Number, Infallible> {
                let bytes = Field::<AT, $LEN>.get(data);
                Ok(Number::from_raw(<$Number as Number>::Raw::from_le_bytes(bytes)))
            }
        }

        impl Encode<Payload> for $Number {
            fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
                Field::<AT, $LEN>.put(data, self.raw().to_le_bytes());
            }
        })*
    };
}

little_endian!(
    u8: 1,
    FeedForward: 1,
    TorqueCap: 1,
    EncoderCounts: 2,
    SingleTurn: 2,
    u32: 4,
    Celsius: 1,
    Centiamps: 2,
    Decivolts: 2,
    Deciwatts: 2,
    Degrees: 2,
    DegreesPerSecond: 2,
    FineSpeedLimit: 2,
    SpeedLimit: 2,
    Centidegrees: 4,
    CentidegreesPerSecond: 4,
    DegreesPerSecondSquared: 4,
    EncoderPulses: 4,
    Milliseconds: 4,
    VersionDate: 4,
);

/// Other types, by the bytes they stand for.
macro_rules! bytes {
    ($($Value:ty: $LEN:literal, $from:expr, $to:expr;)*) => {
        $(impl Decode<Payload> for $Value {
            fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<$Value, Infallible> {
                Ok($from(Field::<AT, $LEN>.get(data)))
            }
        }

        impl Encode<Payload> for $Value {
            fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
                Field::<AT, $LEN>.put(data, $to(*self));
            }
        })*
    };
}

bytes! {
    // A brake: 0 locked, 1 released; only 0 counts as locked (RMD V3.6 §2.12.3).
    bool: 1, |[byte]: [u8; 1]| byte != 0, |value| [u8::from(value)];
    [u8; 7]: 7, |bytes| bytes, |bytes| bytes;
    [u8; 8]: 8, |bytes| bytes, |bytes| bytes;
    Faults: 2, |bytes| Faults::from_bits_retain(u16::from_le_bytes(bytes)), |faults: Faults| faults.bits().to_le_bytes();
    Model: 7, Model, |model: Model| model.0;
    ModelPart: 5, ModelPart, |part: ModelPart| part.0;
}
