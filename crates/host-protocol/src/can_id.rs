//! [`CanId`], the arbitration id of a CAN frame as one number and as a word.

use core::fmt;
use core::str::FromStr;

use embedded_can::{ExtendedId, Id, StandardId};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::MaxSize;

/// Bit of an id on the wire that marks a 29-bit id, as in SocketCAN.
const EXTENDED_FLAG: u32 = 1 << 31;
/// What stands before an extended id in words.
const EXTENDED_PREFIX: &str = "extended:";
/// What stands before a hexadecimal number.
const HEX_PREFIX: &str = "0x";

/// The arbitration id of a CAN frame: standard, of 11 bits, or extended, of 29. Ids of the two
/// frame types differ, whatever their numbers: `0x010` and `extended:0x00000010`.
///
/// On the wire, and as the value of a parameter: a u32 with bit 31 = extended. The lesser of two
/// wins the arbitration: bits 28 to 18 of an extended id are compared with a standard one, which
/// wins where they are equal.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CanId(pub Id);

impl CanId {
    /// What ids there are, for people.
    pub const ALLOWED: &'static str = "0 to 0x7FF, or extended:0 to extended:0x1FFFFFFF";

    /// The id of a number of the wire; `None` if its bits 0 to 30 are above `0x7FF`, of an extended
    /// id above `0x1FFF_FFFF`.
    #[must_use]
    pub fn from_wire(number: u32) -> Option<Self> {
        if number & EXTENDED_FLAG == 0 {
            Self::standard(number)
        } else {
            Self::extended(number & !EXTENDED_FLAG)
        }
    }

    /// A standard id; `None` above `0x7FF`.
    #[must_use]
    pub fn standard(raw: u32) -> Option<Self> {
        StandardId::new(u16::try_from(raw).ok()?).map(|id| Self(Id::Standard(id)))
    }

    /// An extended id; `None` above `0x1FFF_FFFF`.
    #[must_use]
    pub fn extended(raw: u32) -> Option<Self> {
        ExtendedId::new(raw).map(|id| Self(Id::Extended(id)))
    }

    /// The number on the wire.
    #[must_use]
    pub fn to_wire(self) -> u32 {
        match self.0 {
            Id::Standard(id) => u32::from(id.as_raw()),
            Id::Extended(id) => id.as_raw() | EXTENDED_FLAG,
        }
    }

    /// Whether it has 29 bits.
    #[must_use]
    pub const fn is_extended(self) -> bool {
        matches!(self.0, Id::Extended(_))
    }
}

impl From<Id> for CanId {
    fn from(id: Id) -> Self {
        Self(id)
    }
}

/// `0x141`, or `extended:0x12345678`.
impl fmt::Display for CanId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Id::Standard(id) => write!(f, "{HEX_PREFIX}{:03X}", id.as_raw()),
            Id::Extended(id) => write!(f, "{EXTENDED_PREFIX}{HEX_PREFIX}{:08X}", id.as_raw()),
        }
    }
}

/// As it is displayed; the number may be decimal.
impl FromStr for CanId {
    type Err = NoCanId;

    fn from_str(text: &str) -> Result<Self, NoCanId> {
        let number = |text: &str| {
            let (digits, radix) =
                text.strip_prefix(HEX_PREFIX).map_or((text, 10), |digits| (digits, 16));
            u32::from_str_radix(digits, radix).ok()
        };
        match text.strip_prefix(EXTENDED_PREFIX) {
            Some(text) => number(text).and_then(Self::extended),
            None => number(text).and_then(Self::standard),
        }
        .ok_or(NoCanId)
    }
}

/// A text that is no CAN id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoCanId;

impl fmt::Display for NoCanId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no CAN id; there are {}", CanId::ALLOWED)
    }
}

impl core::error::Error for NoCanId {}

impl fmt::Debug for CanId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CanId({self})")
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for CanId {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "CanId({=u32:#x})", self.to_wire());
    }
}

impl MaxSize for CanId {
    const MAX_SIZE: usize = u32::MAX_SIZE;
    const LAYOUT: u32 = crate::layout_of("CanId", &[u32::LAYOUT]);
}

impl Serialize for CanId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u32(self.to_wire())
    }
}

impl<'de> Deserialize<'de> for CanId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::from_wire(u32::deserialize(deserializer)?)
            .ok_or_else(|| D::Error::custom("CAN id out of range"))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    /// Number on the wire, word.
    const IDS: [(u32, &str); 5] = [
        (0x010, "0x010"),
        (0x7FF, "0x7FF"),
        (0x8000_0000, "extended:0x00000000"),
        (0x8000_0010, "extended:0x00000010"),
        (0x9FFF_FFFF, "extended:0x1FFFFFFF"),
    ];

    #[test]
    fn an_id_is_a_number_and_a_word() {
        for (number, word) in IDS {
            let id = CanId::from_wire(number).unwrap();
            assert_eq!((id.to_wire(), id.to_string().as_str()), (number, word));
            assert_eq!(word.parse(), Ok(id));
        }
        assert_eq!("16".parse(), Ok(CanId::standard(0x10).unwrap()));
        assert_eq!("extended:16".parse(), Ok(CanId::extended(0x10).unwrap()));
        assert_ne!(CanId::standard(0x10), CanId::extended(0x10));
    }

    #[test]
    fn what_no_frame_can_carry_is_no_id() {
        for number in [0x800, 0x1FFF_FFFF, 0x7FFF_FFFF, 0xA000_0000, 0xC000_0010, u32::MAX] {
            assert_eq!(CanId::from_wire(number), None, "{number:#X}");
        }
        for text in [
            "",
            "0x800",
            "2048",
            "-1",
            "extended:",
            "extended:0x20000000",
            "extended 16",
            "0x80000010",
        ] {
            assert_eq!(text.parse::<CanId>(), Err(NoCanId), "{text}");
        }
    }

    /// The bits as they go over the bus: 11 of the id, then the bit that only a standard frame has
    /// dominant, then 18 more. 0x141 is 001_0100_0001; its extended ids are 0x05040000 to
    /// 0x0507FFFF.
    #[test]
    fn the_lesser_id_wins_the_arbitration() {
        let (standard, extended) =
            (|id| CanId::standard(id).unwrap(), |id| CanId::extended(id).unwrap());
        let order = [
            extended(0x0000_0000),
            extended(0x0000_0010),
            standard(0x001),
            extended(0x0503_FFFF),
            standard(0x141),
            extended(0x0504_0000),
            extended(0x0507_FFFF),
            standard(0x142),
            standard(0x7FF),
            extended(0x1FFF_FFFF),
        ];
        assert!(order.is_sorted_by(|one, other| one < other), "{order:?}");
    }
}
