//! Rates of the two buses.

use core::convert::Infallible;

use codec::{Decode, Encode, FieldInfo, Number, check_range};

use crate::dialect::Dialect;
use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::payload::Payload;

/// Code of 0xB4. One code sets the rate of RS485 and of CAN (RMD V3.6 §2.31); unlisted codes are
/// kept as received.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BaudCode(pub u8);

/// RS485 rates, bit/s, by code.
const RS485: [u32; 5] = [115_200, 500_000, 1_000_000, 1_500_000, 2_000_000];
/// CAN rates, bit/s, by code; higher codes set nothing (RMD V3.6 §2.31.4 example 3).
const CAN: [u32; 2] = [500_000, 1_000_000];
/// The highest code on RS485 from V3.8 on; V3.7 and V3.8 are one dialect, so it is not known there.
const RS485_V3_9: [u32; 5] = [115_200, 500_000, 1_000_000, 1_500_000, 2_500_000];
/// CAN rates of V4.4, the other way round. Of its RS485 rates the manual contradicts itself but for
/// the first.
const CAN_V4_4: [u32; 3] = [1_000_000, 500_000, 250_000];

/// The rates of both buses in a dialect, by code: RS485, CAN.
const fn rates(dialect: Dialect) -> (&'static [u32], &'static [u32]) {
    match dialect {
        Dialect::Unknown => (&[], &[]),
        Dialect::V3_6 => (&RS485, &CAN),
        Dialect::V3_7 => (RS485.split_at(4).0, &CAN),
        Dialect::V3_9 | Dialect::V4_2 | Dialect::V4_3 => (&RS485_V3_9, &CAN),
        Dialect::V4_4 => (RS485.split_at(1).0, &CAN_V4_4),
    }
}

impl BaudCode {
    /// Lowest code.
    pub const MIN: u8 = 0;
    /// Highest code on RS485.
    pub const MAX: u8 = 4;
    /// Highest code on CAN.
    pub const MAX_ON_CAN: u8 = 1;

    /// The code that sets RS485 to this rate in bit/s, on a motor of this dialect.
    pub fn for_rs485(dialect: Dialect, bit_s: u32) -> Option<BaudCode> {
        BaudCode::of(rates(dialect).0, bit_s)
    }

    /// The code that sets CAN to this rate in bit/s, on a motor of this dialect.
    pub fn for_can(dialect: Dialect, bit_s: u32) -> Option<BaudCode> {
        BaudCode::of(rates(dialect).1, bit_s)
    }

    /// The rate of RS485 under this code, bit/s, on a motor of this dialect.
    pub fn rs485(self, dialect: Dialect) -> Option<u32> {
        rates(dialect).0.get(usize::from(self.0)).copied()
    }

    /// The rate of CAN under this code, bit/s, on a motor of this dialect.
    pub fn can(self, dialect: Dialect) -> Option<u32> {
        rates(dialect).1.get(usize::from(self.0)).copied()
    }

    pub(crate) fn check_on_can(self) -> Result<(), EncodeError> {
        self.check_up_to(BaudCode::MAX_ON_CAN)
    }

    fn check_up_to(self, max: u8) -> Result<(), EncodeError> {
        check_range("baud_code", i64::from(self.0), i64::from(BaudCode::MIN), i64::from(max))
    }

    fn of(rates: &[u32], bit_s: u32) -> Option<BaudCode> {
        let code = rates.iter().position(|rate| *rate == bit_s)?;
        u8::try_from(code).ok().map(BaudCode)
    }
}

impl Number for BaudCode {
    type Raw = u8;
    const INFO: FieldInfo = FieldInfo::integer("", "", BaudCode::MIN as i64, BaudCode::MAX as i64);

    fn from_raw(code: u8) -> BaudCode {
        BaudCode(code)
    }

    fn raw(self) -> u8 {
        self.0
    }
}

impl Decode<Payload> for BaudCode {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<BaudCode, Infallible> {
        u8::get::<AT>(data).map(BaudCode)
    }
}

impl Encode<Payload> for BaudCode {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        self.0.put::<AT>(data);
    }

    fn check(&self) -> Result<(), EncodeError> {
        self.check_up_to(BaudCode::MAX)
    }
}
