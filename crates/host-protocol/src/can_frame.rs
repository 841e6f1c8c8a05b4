//! [`CanFrame`], the one CAN frame type of the whole project: the core, the simulator and the wire
//! of the host link.

use core::fmt;

use embedded_can::{ExtendedId, Frame, Id, StandardId};
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{CanId, MaxSize};

/// Data bytes of a classic CAN frame, at most.
pub const MAX_CAN_DATA: usize = 8;

/// Bit of the id on the wire that marks a remote frame, as in SocketCAN.
const REMOTE_FLAG: u32 = 1 << 30;

/// A classic CAN frame, valid by construction: an id in its range and at most 8 data bytes.
///
/// On the wire: the id as u32 with bit 31 = extended and bit 30 = remote, then the data with its
/// length; a remote frame carries as many zero bytes as it asks for.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct CanFrame {
    id: Id,
    remote: bool,
    length: u8,
    /// The bytes after `length` are zero, so that equality of the fields is equality of the
    /// frames.
    data: [u8; MAX_CAN_DATA],
}

impl CanFrame {
    /// A data frame; `None` if `data` is longer than 8 bytes.
    #[must_use]
    pub const fn data_frame(id: Id, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; MAX_CAN_DATA];
        let Some((used, _)) = bytes.split_at_mut_checked(data.len()) else { return None };
        used.copy_from_slice(data);
        #[expect(clippy::cast_possible_truncation, reason = "at most 8, or the split had failed")]
        let length = data.len() as u8;
        Some(Self { id, remote: false, length, data: bytes })
    }

    /// A remote frame that asks for `length` bytes; `None` above 8.
    #[must_use]
    pub const fn remote_frame(id: Id, length: u8) -> Option<Self> {
        if length as usize > MAX_CAN_DATA {
            return None;
        }
        Some(Self { id, remote: true, length, data: [0; MAX_CAN_DATA] })
    }

    /// A data frame with an 11-bit id; `None` if the id is above `0x7FF` or `data` longer than 8
    /// bytes.
    #[must_use]
    pub const fn standard(id: u16, data: &[u8]) -> Option<Self> {
        match StandardId::new(id) {
            Some(id) => Self::data_frame(Id::Standard(id), data),
            None => None,
        }
    }

    /// A data frame with a 29-bit id; `None` if the id is above `0x1FFF_FFFF` or `data` longer than
    /// 8 bytes.
    #[must_use]
    pub const fn extended(id: u32, data: &[u8]) -> Option<Self> {
        match ExtendedId::new(id) {
            Some(id) => Self::data_frame(Id::Extended(id), data),
            None => None,
        }
    }

    /// The id.
    #[must_use]
    pub const fn id(&self) -> Id {
        self.id
    }

    /// The data bytes; none in a remote frame.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        if self.remote { &[] } else { self.bytes() }
    }

    /// As many bytes as the frame says, those of a remote frame zero.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.data.get(..usize::from(self.length)).unwrap_or_default()
    }

    /// [`bytes`](Self::bytes), filled up with zeros.
    #[must_use]
    pub const fn padded(&self) -> [u8; MAX_CAN_DATA] {
        self.data
    }

    /// The id with its two flags as on the wire.
    #[must_use]
    pub fn flagged_id(&self) -> u32 {
        let id = CanId(self.id).to_wire();
        if self.remote { id | REMOTE_FLAG } else { id }
    }

    /// The frame with this [`flagged_id`](Self::flagged_id) and these [`bytes`](Self::bytes);
    /// `None` where there is none.
    #[must_use]
    pub fn from_flagged_id(flagged: u32, data: &[u8]) -> Option<Self> {
        let CanId(id) = CanId::from_wire(flagged & !REMOTE_FLAG)?;
        if flagged & REMOTE_FLAG == 0 {
            Self::data_frame(id, data)
        } else {
            Self::remote_frame(id, u8::try_from(data.len()).ok()?)
        }
    }
}

impl Frame for CanFrame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Self::data_frame(id.into(), data)
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        Self::remote_frame(id.into(), u8::try_from(dlc).ok()?)
    }

    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }

    fn is_remote_frame(&self) -> bool {
        self.remote
    }

    fn id(&self) -> Id {
        self.id
    }

    fn dlc(&self) -> usize {
        usize::from(self.length)
    }

    fn data(&self) -> &[u8] {
        CanFrame::data(self)
    }
}

/// As candump writes it: `141#9A00000000000000`, `141#R8` for a remote frame.
impl fmt::Display for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.id {
            Id::Standard(id) => write!(f, "{:03X}#", id.as_raw())?,
            Id::Extended(id) => write!(f, "{:08X}#", id.as_raw())?,
        }
        if self.remote {
            return write!(f, "R{}", self.length);
        }
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CanFrame({self})")
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for CanFrame {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "CanFrame({=u32:#x}, {=[u8]:02x})", self.flagged_id(), self.bytes());
    }
}

impl MaxSize for CanFrame {
    const MAX_SIZE: usize = u32::MAX_SIZE + <crate::Bytes<MAX_CAN_DATA>>::MAX_SIZE;
    const LAYOUT: u32 =
        crate::layout_of("CanFrame id data", &[u32::LAYOUT, <crate::Bytes<MAX_CAN_DATA>>::LAYOUT]);
}

/// Serialises as a byte string.
struct Data<'a>(&'a [u8]);

impl Serialize for Data<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(self.0)
    }
}

impl Serialize for CanFrame {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(2)?;
        tuple.serialize_element(&self.flagged_id())?;
        tuple.serialize_element(&Data(self.bytes()))?;
        tuple.end()
    }
}

impl<'de> Deserialize<'de> for CanFrame {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FrameVisitor;

        impl<'de> Visitor<'de> for FrameVisitor {
            type Value = CanFrame;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a CAN id in its range and at most 8 data bytes")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut fields: A) -> Result<CanFrame, A::Error> {
                let id = fields
                    .next_element::<u32>()?
                    .ok_or_else(|| A::Error::invalid_length(0, &self))?;
                let data = fields
                    .next_element::<crate::Bytes<MAX_CAN_DATA>>()?
                    .ok_or_else(|| A::Error::invalid_length(1, &self))?;
                CanFrame::from_flagged_id(id, &data)
                    .ok_or_else(|| A::Error::custom("CAN id out of range"))
            }
        }

        deserializer.deserialize_tuple(2, FrameVisitor)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::format;

    use super::*;

    fn to_bytes(frame: &CanFrame) -> std::vec::Vec<u8> {
        let mut out = [0; CanFrame::MAX_SIZE];
        postcard::to_slice(frame, &mut out).unwrap().to_vec()
    }

    #[test]
    fn a_standard_frame_takes_its_short_id_and_its_data() {
        const FRAME: CanFrame = CanFrame::standard(0x141, &[0x9A, 0, 0]).unwrap();
        // 0x141 = 0b10_1000001: varint C1 02; then the length and the data.
        assert_eq!(to_bytes(&FRAME), [0xC1, 0x02, 0x03, 0x9A, 0x00, 0x00]);
        assert_eq!(
            postcard::from_bytes::<CanFrame>(&[0xC1, 0x02, 0x03, 0x9A, 0x00, 0x00]),
            Ok(FRAME)
        );
        assert_eq!(format!("{FRAME}"), "141#9A0000");
    }

    #[test]
    fn the_largest_frame_reaches_the_bound() {
        let frame = CanFrame::extended(0x1FFF_FFFF, &[0xFF; 8]).unwrap();
        let mut bytes = [0xFF; CanFrame::MAX_SIZE];
        // 0x9FFF_FFFF as a varint, then 8 bytes.
        bytes[..6].copy_from_slice(&[0xFF, 0xFF, 0xFF, 0xFF, 0x09, 0x08]);
        assert_eq!(to_bytes(&frame), bytes);
    }

    #[test]
    fn a_remote_frame_keeps_its_length_and_has_no_data() {
        let frame = CanFrame::new_remote(StandardId::new(0x141).unwrap(), 2).unwrap();
        assert_eq!((frame.dlc(), Frame::data(&frame)), (2, [].as_slice()));
        // 0x4000_0141 as a varint.
        assert_eq!(to_bytes(&frame), [0xC1, 0x82, 0x80, 0x80, 0x04, 0x02, 0x00, 0x00]);
        assert_eq!(postcard::from_bytes(&to_bytes(&frame)), Ok(frame));
        assert_eq!(format!("{frame}"), "141#R2");
    }

    #[test]
    fn no_invalid_frame_comes_into_being() {
        assert_eq!(CanFrame::standard(0x800, &[]), None);
        assert_eq!(CanFrame::standard(0, &[0; 9]), None);
        assert_eq!(CanFrame::extended(0x2000_0000, &[]), None);
        assert_eq!(CanFrame::remote_frame(Id::Standard(StandardId::ZERO), 9), None);
        // 0x800 without the extended flag; 9 data bytes; 0xA000_0000: extended, but 30 bits long.
        let invalid: [&[u8]; 3] = [
            &[0x80, 0x10, 0x00],
            &[0x01, 0x09, 1, 2, 3, 4, 5, 6, 7, 8, 9],
            &[0x80, 0x80, 0x80, 0x80, 0x0A, 0x00],
        ];
        for bytes in invalid {
            assert!(postcard::from_bytes::<CanFrame>(bytes).is_err(), "{bytes:02X?}");
        }
    }
}
