//! The input of the codec targets: a received CAN frame, and the data of a request that waits for
//! its answer.

use embedded_can::{ExtendedId, Frame, Id, StandardId};
use host_protocol::CanFrame;

use crate::take::Take;

/// Bits of the third input byte; its low half is the length.
const LENGTH: u8 = 0x0F;
const EXTENDED: u8 = 0x10;
const REMOTE: u8 = 0x20;
const SHORT: u8 = 0x40;

const DATA_LEN: usize = 8;

pub struct Input {
    pub frame: CanFrame,
    /// The frame's data, filled up with zeros.
    pub data: [u8; DATA_LEN],
    pub pending: [u8; DATA_LEN],
    /// Of `pending`, only the first four bytes count.
    pub pending_is_short: bool,
}

impl Input {
    pub fn of(bytes: &[u8]) -> Option<Input> {
        let mut take = Take(bytes);
        let (id, flags, data, pending) = (take.word(), take.byte(), take.array(), take.array());
        let len = usize::from(flags & LENGTH).min(DATA_LEN);
        let id = match flags & EXTENDED {
            0 => Id::Standard(StandardId::new(id)?),
            _ => Id::Extended(ExtendedId::new(id.into())?),
        };
        let frame = match flags & REMOTE {
            0 => CanFrame::new(id, data.get(..len)?),
            _ => CanFrame::new_remote(id, len),
        };
        Some(Input { frame: frame?, data, pending, pending_is_short: flags & SHORT != 0 })
    }

    /// The bytes that make this input.
    pub fn bytes(id: u16, data: &[u8], pending: &[u8]) -> Vec<u8> {
        let length = u8::try_from(data.len()).expect("at most 8 bytes");
        let short = if pending.len() == DATA_LEN / 2 { SHORT } else { 0 };
        let mut bytes = id.to_le_bytes().to_vec();
        bytes.push(length | short);
        for part in [data, pending] {
            bytes.extend(part.iter().chain(&[0; DATA_LEN]).take(DATA_LEN));
        }
        bytes
    }
}
