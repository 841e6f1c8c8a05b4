//! Finds frames in a byte stream.

use codec::Framing;

use super::{FRAME_LEN, HEADER, LENGTH, check};

/// Finds whole, checksummed frames in the bytes of an RS485 line.
///
/// It keeps one window of 13 bytes. When what it holds cannot be a frame, it goes on with the next
/// header byte inside the window, so no frame behind garbage is lost or comes late. The id is not
/// looked at: a well-formed frame to an id outside 1..=32 is yielded and then refused by
/// [`decode_request`](super::decode_request) and [`decode_reply`](super::decode_reply).
///
/// The older framing of the same vendor, `3E command id length sum`, has another length byte or
/// fails the checksum.
///
/// ```
/// let mut deframer = rmd::rs485::Deframer::new();
/// let line = [0x3E, 0x9C, 0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
/// let frame = line.iter().find_map(|byte| deframer.push(*byte));
/// assert_eq!(frame, Some([0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30]));
/// assert_eq!(deframer.rejected(), 2);
/// ```
pub type Deframer = codec::Deframer<Rs485Framing, FRAME_LEN>;

/// What a frame of this line begins with, and its checksum.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rs485Framing;

impl Framing<FRAME_LEN> for Rs485Framing {
    #[inline]
    fn begins_frame(bytes: &[u8]) -> bool {
        match bytes {
            [] | [HEADER] | [HEADER, _] => true,
            [HEADER, _, LENGTH, ..] => bytes.first_chunk().is_none_or(|frame| check(frame).is_ok()),
            _ => false,
        }
    }
}
