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

#[cfg(test)]
mod tests {
    use codec::testing::{check_deframer, deframed};

    use super::*;

    /// D5 manual, table row 9.
    const REQUEST: [u8; 8] = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];
    const REPLY: [u8; 8] = [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];

    #[test]
    fn frames_are_found_whole_and_in_time() {
        check_deframer(Deframer::new, REQUEST, REPLY);
    }

    #[test]
    fn garbage_before_a_frame() {
        let deframer = deframed(Deframer::new(), &[&[0x00, 0xFF, 0x05], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
        let deframer = deframed(Deframer::new(), &[&[0xD5, 0x5D, 0xD5], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
    }

    /// Header bytes as id, data and checksum: motor 0xD5 is told the speed 0x5DD5. Sum of D5 05 03
    /// 20 D5 5D.
    #[test]
    fn header_bytes_in_the_data() {
        let frame = [0xD5, 0xD5, 0x05, 0x03, 0x20, 0xD5, 0x5D, 0x2F];
        let deframer = deframed(Deframer::new(), &[&frame, &frame[..7], &frame], [frame, frame]);
        assert_eq!((deframer.rejected(), deframer.pending()), (7, 0));
    }

    /// D5 manual, frame format: the printed reply whose sum counts the header, and table row 3, a
    /// checksum spoilt.
    #[test]
    fn printed_frames_with_wrong_sums_are_rejected() {
        let with_header = [0x5D, 0x0A, 0x05, 0x02, 0x20, 0x60, 0x80, 0x6E];
        let spoilt = [0xD5, 0x0B, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7A];
        let deframer = deframed(Deframer::new(), &[&with_header, &spoilt, &REPLY], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (16, 0));
    }

    /// D5 manual, frame format: the length byte is 4 or 5, whatever the sum.
    #[test]
    fn other_length_bytes_are_rejected() {
        let length_6 = [0xD5, 0x0B, 0x06, 0x03, 0x20, 0x11, 0x11, 0x56];
        let deframer = deframed(Deframer::new(), &[&length_6, &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 8);
        let one_byte = [0xD5, 0x0B, 0x04, 0x02, 0x15, 0x00, 0x00, 0x26];
        deframed(Deframer::new(), &[&one_byte], [one_byte]);
    }
}
