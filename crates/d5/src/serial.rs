//! Frames on a serial line: the same eight bytes as on CAN, one after another.

use crate::field::{FRAME_LEN, LENGTH, ONE_DATA_BYTE, REPLY_HEADER, REQUEST_HEADER, TWO_DATA_BYTES};
use crate::frame::is_well_formed;

/// Finds whole, checksummed frames of either direction in the bytes of a serial line.
///
/// It keeps one window of 8 bytes. When what it holds cannot be a frame, it goes on with the next header byte inside the
/// window, so no frame behind garbage is lost or comes late. Neither id nor command are looked at: a well-formed frame to
/// id 0 is yielded and then refused by [`decode_frame`](crate::decode_frame).
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
#[derive(Debug, Clone)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Deframer {
    window: [u8; FRAME_LEN],
    len: usize,
    rejected: u32,
}

impl Deframer {
    /// An empty deframer.
    pub const fn new() -> Deframer {
        Deframer { window: [0; FRAME_LEN], len: 0, rejected: 0 }
    }

    /// Takes the next byte of the line; yields the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<[u8; FRAME_LEN]> {
        if let Some(place) = self.window.get_mut(self.len) {
            *place = byte;
            self.len += 1;
        }
        // Each round drops at least one byte and an empty window fits, so this ends.
        while !self.fits() {
            self.drop_to_next_header();
        }
        if self.len < FRAME_LEN {
            return None;
        }
        self.len = 0;
        Some(self.window)
    }

    /// Takes bytes of the line; yields each frame they complete. A byte is taken only when the iterator reaches it:
    /// run it to its end.
    pub fn push_slice<'a>(&'a mut self, bytes: &'a [u8]) -> impl Iterator<Item = [u8; FRAME_LEN]> + 'a {
        bytes.iter().filter_map(|byte| self.push(*byte))
    }

    /// Drops a frame begun, as after a pause on the line; its bytes count as rejected.
    pub fn reset(&mut self) {
        self.count_rejected(self.len);
        self.len = 0;
    }

    /// Bytes held of a frame begun, 0..=7.
    pub fn pending(&self) -> usize {
        self.len
    }

    /// Bytes dropped since creation because no frame began with them; stays at its end value.
    pub fn rejected(&self) -> u32 {
        self.rejected
    }

    /// Whether the window holds a frame or can still become one.
    fn fits(&self) -> bool {
        if self.len == FRAME_LEN {
            return is_well_formed(&self.window);
        }
        let begun = self.window.get(..self.len).unwrap_or_default();
        let header = begun.first().is_none_or(|byte| is_header(*byte));
        header && begun.get(LENGTH).is_none_or(|byte| matches!(*byte, ONE_DATA_BYTE | TWO_DATA_BYTES))
    }

    /// Drops the first byte and all others before the next header byte.
    fn drop_to_next_header(&mut self) {
        let held = self.window.iter().take(self.len);
        let dropped = held.skip(1).position(|byte| is_header(*byte)).map_or(self.len, |before| before + 1);
        // Not `rotate_left`: its check of the distance stays in an image built for size, as a panic.
        let mut kept = [0; FRAME_LEN];
        for (place, byte) in kept.iter_mut().zip(self.window.iter().skip(dropped)) {
            *place = *byte;
        }
        self.window = kept;
        self.len -= dropped;
        self.count_rejected(dropped);
    }

    fn count_rejected(&mut self, bytes: usize) {
        self.rejected = self.rejected.saturating_add(u32::try_from(bytes).unwrap_or(u32::MAX));
    }
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}

fn is_header(byte: u8) -> bool {
    matches!(byte, REQUEST_HEADER | REPLY_HEADER)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D5 manual, table row 9.
    const REQUEST: [u8; 8] = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];
    const REPLY: [u8; 8] = [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];

    /// Pushes the parts in order and expects exactly these frames.
    #[track_caller]
    fn run<const N: usize>(parts: &[&[u8]], frames: [[u8; 8]; N]) -> Deframer {
        let mut deframer = Deframer::new();
        let mut expected = frames.iter();
        for part in parts {
            for frame in deframer.push_slice(part) {
                assert_eq!(Some(&frame), expected.next());
            }
        }
        assert_eq!(expected.next(), None, "a frame was lost");
        deframer
    }

    #[test]
    fn back_to_back() {
        let deframer = run(&[&REQUEST, &REPLY, &REQUEST], [REQUEST, REPLY, REQUEST]);
        assert_eq!((deframer.rejected(), deframer.pending()), (0, 0));
    }

    #[test]
    fn a_frame_is_yielded_with_its_last_byte() {
        let mut deframer = Deframer::new();
        for (count, byte) in REPLY.iter().take(7).enumerate() {
            assert_eq!(deframer.push(*byte), None);
            assert_eq!(deframer.pending(), count + 1);
        }
        assert_eq!(deframer.push(0x55), Some(REPLY));
        assert_eq!(deframer.pending(), 0);
    }

    #[test]
    fn garbage_before_a_frame() {
        let deframer = run(&[&[0x00, 0xFF, 0x05], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
        let deframer = run(&[&[0xD5, 0x5D, 0xD5], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
    }

    /// A frame cut short: the next one begins inside the window.
    #[test]
    fn a_cut_frame_does_not_cost_the_next() {
        for cut in 1..8 {
            let deframer = run(&[&REPLY[..cut], &REQUEST], [REQUEST]);
            assert_eq!(deframer.rejected(), u32::try_from(cut).expect("small"), "cut after {cut}");
            assert_eq!(deframer.pending(), 0);
        }
    }

    #[test]
    fn a_damaged_byte_costs_one_frame() {
        for at in 0..8 {
            let mut damaged = REPLY;
            damaged[at] ^= 0x10;
            let deframer = run(&[&REQUEST, &damaged, &REQUEST], [REQUEST, REQUEST]);
            assert_eq!(deframer.rejected(), 8, "byte {at}");
        }
    }

    /// Header bytes as id, data and checksum: motor 0xD5 is told the speed 0x5DD5. Sum of D5 05 03 20 D5 5D.
    #[test]
    fn header_bytes_in_the_data() {
        let frame = [0xD5, 0xD5, 0x05, 0x03, 0x20, 0xD5, 0x5D, 0x2F];
        let deframer = run(&[&frame, &frame[..7], &frame], [frame, frame]);
        assert_eq!((deframer.rejected(), deframer.pending()), (7, 0));
    }

    /// D5 manual, frame format: the printed reply whose sum counts the header, and table row 3, a checksum spoilt.
    #[test]
    fn printed_frames_with_wrong_sums_are_rejected() {
        let with_header = [0x5D, 0x0A, 0x05, 0x02, 0x20, 0x60, 0x80, 0x6E];
        let spoilt = [0xD5, 0x0B, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7A];
        let deframer = run(&[&with_header, &spoilt, &REPLY], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (16, 0));
    }

    /// D5 manual, frame format: the length byte is 4 or 5, whatever the sum.
    #[test]
    fn other_length_bytes_are_rejected() {
        let length_6 = [0xD5, 0x0B, 0x06, 0x03, 0x20, 0x11, 0x11, 0x56];
        let deframer = run(&[&length_6, &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 8);
        let one_byte = [0xD5, 0x0B, 0x04, 0x02, 0x15, 0x00, 0x00, 0x26];
        run(&[&one_byte], [one_byte]);
    }

    #[test]
    fn reset_drops_a_frame_begun() {
        let mut deframer = Deframer::new();
        assert_eq!(deframer.push_slice(&REPLY[..5]).count(), 0);
        deframer.reset();
        assert_eq!((deframer.rejected(), deframer.pending()), (5, 0));
        assert!(deframer.push_slice(&REPLY).eq([REPLY]));
        deframer.reset();
        assert_eq!(deframer.rejected(), 5);
    }
}
