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

#[cfg(test)]
mod tests {
    use codec::testing::{check_deframer, deframed};

    use super::*;

    /// Proven frames: a 0x9C request and its reply.
    const REQUEST: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    const REPLY: [u8; 13] =
        [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];

    #[test]
    fn frames_are_found_whole_and_in_time() {
        check_deframer(Deframer::new, REQUEST, REPLY);
    }

    #[test]
    fn garbage_before_a_frame() {
        let deframer = deframed(Deframer::new(), &[&[0x00, 0xFF, 0x08], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
        let deframer = deframed(Deframer::new(), &[&[0x3E, 0x3E, 0x3E], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
    }

    /// 0x3E as data: 62 centiamps, 62 degrees per second, 62 degrees. Checksum computed apart from
    /// this crate.
    #[test]
    fn header_bytes_in_the_data() {
        let frame = [0x3E, 0x01, 0x08, 0x9C, 0x3E, 0x3E, 0x01, 0x08, 0x3E, 0x3E, 0x01, 0xA6, 0xE1];
        let deframer = deframed(Deframer::new(), &[&frame, &frame[..7], &frame], [frame, frame]);
        assert_eq!((deframer.rejected(), deframer.pending()), (7, 0));
    }

    /// The vendor's older framing: `3E command id length sum`, then data and its sum.
    #[test]
    fn the_older_framing_is_rejected() {
        let read_state = [0x3E, 0x9C, 0x01, 0x00, 0xDB];
        let deframer = deframed(Deframer::new(), &[&read_state, &REPLY, &read_state], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (10, 0));

        // Id 8 stands where the length byte is now; the checksum decides.
        let id_8 = [0x3E, 0x19, 0x08, 0x00, 0x5F];
        let deframer = deframed(Deframer::new(), &[&id_8, &REPLY], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (5, 0));
        let speed = [0x3E, 0xA2, 0x08, 0x04, 0xEC, 0x10, 0x27, 0x00, 0x00, 0x37];
        let deframer = deframed(Deframer::new(), &[&speed, &speed, &REPLY], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (20, 0));
    }
}
