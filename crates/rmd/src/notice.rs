//! The data of the 0xF1 notice, which no manual describes.

use core::convert::Infallible;

use codec::{Decode, Encode, FieldInfo, FieldKind, Shown, Visit, check_range};

use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::payload::Payload;

/// Most bytes that can follow the command byte.
const MAX_PAYLOAD: usize = DATA_LEN - 1;

/// What followed the command byte of a 0xF1 frame: 0 to 7 bytes of unknown meaning, kept as
/// received.
///
/// Observed on CAN without any data after the command byte; the default is that form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RawNotice {
    len: usize,
    payload: [u8; MAX_PAYLOAD],
}

impl RawNotice {
    /// A notice with these bytes after the command byte; refuses more than 7.
    pub fn new(payload: &[u8]) -> Result<RawNotice, EncodeError> {
        let len = payload.len();
        let value = i64::try_from(len).unwrap_or(i64::MAX);
        check_range("notice length", value, 0, MAX_PAYLOAD as i64)?;
        let mut notice = RawNotice { len, payload: [0; MAX_PAYLOAD] };
        for (place, byte) in notice.payload.iter_mut().zip(payload) {
            *place = *byte;
        }
        Ok(notice)
    }

    /// The bytes after the command byte.
    pub fn payload(&self) -> &[u8] {
        self.payload.get(..self.len).unwrap_or(&self.payload)
    }

    /// Data bytes of the notice on CAN, the command byte included.
    pub(crate) fn frame_len(&self) -> usize {
        1 + self.payload().len()
    }
}

impl Shown for RawNotice {
    const INFO: FieldInfo = FieldInfo::other(FieldKind::Bytes, "");

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        field.visit_bytes(visit, self.payload());
    }
}

/// Missing bytes are put as zero.
impl Decode<Payload> for RawNotice {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<RawNotice, Infallible> {
        Ok(RawNotice { len: MAX_PAYLOAD, payload: Decode::get::<AT>(data)? })
    }
}

impl Encode<Payload> for RawNotice {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        self.payload.put::<AT>(data);
    }
}
