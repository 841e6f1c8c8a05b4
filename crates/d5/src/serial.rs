//! Frames on a serial line: the same eight bytes as on CAN, one after another.

use codec::Framing;

use crate::field::{FRAME_LEN, ONE_DATA_BYTE, REPLY_HEADER, REQUEST_HEADER, TWO_DATA_BYTES};
use crate::frame::has_right_checksum;

/// Finds whole, checksummed frames of either direction in the bytes of a serial line.
///
/// It keeps one window of 8 bytes. When what it holds cannot be a frame, it goes on with the next
/// header byte inside the window, so no frame behind garbage is lost or comes late. Neither id nor
/// command are looked at: a well-formed frame to id 0 is yielded and then refused by
/// [`decode_frame`](crate::decode_frame).
///
/// ```
/// use d5::{Message, Node, Reply, decode_frame, serial::Deframer};
///
/// let mut deframer = Deframer::new();
/// let line = [0x5D, 0xD5, 0x5D, 0x0B, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x75];
/// let frame = line.iter().find_map(|byte| deframer.push(*byte)).unwrap();
/// assert_eq!(decode_frame(&frame), Ok(Message::Reply(Node::FACTORY, Reply::Id)));
/// assert_eq!(deframer.rejected(), 2);
/// ```
pub type Deframer = codec::Deframer<SerialFraming, FRAME_LEN>;

/// What a frame of this line begins with, in either direction, and its checksum.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SerialFraming;

impl Framing<FRAME_LEN> for SerialFraming {
    #[inline]
    fn begins_frame(bytes: &[u8]) -> bool {
        match bytes {
            [] | [REQUEST_HEADER | REPLY_HEADER] | [REQUEST_HEADER | REPLY_HEADER, _] => true,
            [REQUEST_HEADER | REPLY_HEADER, _, ONE_DATA_BYTE | TWO_DATA_BYTES, ..] => {
                bytes.first_chunk().is_none_or(has_right_checksum)
            }
            _ => false,
        }
    }
}
