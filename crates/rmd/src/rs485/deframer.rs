//! Finds frames in a byte stream.

use super::{FRAME_LEN, HEADER, LENGTH, check};

/// Finds whole, checksummed frames in the bytes of an RS485 line.
///
/// It keeps one window of 13 bytes. When what it holds cannot be a frame, it goes on with the next header byte inside
/// the window, so no frame behind garbage is lost or comes late. The id is not looked at: a well-formed frame to an
/// id outside 1..=32 is yielded and then refused by [`decode_request`](super::decode_request) and
/// [`decode_reply`](super::decode_reply).
///
/// The older framing of the same vendor, `3E command id length sum`, has another length byte or fails the checksum.
///
/// ```
/// let mut deframer = rmd::rs485::Deframer::new();
/// let line = [0x3E, 0x9C, 0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
/// let frame = line.iter().find_map(|byte| deframer.push(*byte));
/// assert_eq!(frame, Some([0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30]));
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

    /// Bytes held of a frame begun, 0..=12.
    pub fn pending(&self) -> usize {
        self.len
    }

    /// Bytes dropped since creation because no frame began with them; stays at its end value.
    pub fn rejected(&self) -> u32 {
        self.rejected
    }

    /// Whether the window holds a frame or can still become one.
    fn fits(&self) -> bool {
        if self.len == FRAME_LEN && check(&self.window).is_err() {
            return false;
        }
        match self.window.get(..self.len) {
            Some([] | [HEADER] | [HEADER, _] | [HEADER, _, LENGTH, ..]) => true,
            Some(_) | None => false,
        }
    }

    /// Drops the first byte and all others before the next header byte.
    fn drop_to_next_header(&mut self) {
        let held = self.window.iter().take(self.len);
        let dropped = held.skip(1).position(|byte| *byte == HEADER).map_or(self.len, |before| before + 1);
        // Not `rotate_left`: its check of the distance stays in the image as a panic.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Proven frames: a 0x9C request and its reply.
    const REQUEST: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    const REPLY: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];

    /// Pushes the parts in order and expects exactly these frames.
    #[track_caller]
    fn run<const N: usize>(parts: &[&[u8]], frames: [[u8; 13]; N]) -> Deframer {
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
        for (count, byte) in REPLY.iter().take(12).enumerate() {
            assert_eq!(deframer.push(*byte), None);
            assert_eq!(deframer.pending(), count + 1);
        }
        assert_eq!(deframer.push(0xD8), Some(REPLY));
        assert_eq!(deframer.pending(), 0);
    }

    #[test]
    fn garbage_before_a_frame() {
        let deframer = run(&[&[0x00, 0xFF, 0x08], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
        let deframer = run(&[&[0x3E, 0x3E, 0x3E], &REPLY], [REPLY]);
        assert_eq!(deframer.rejected(), 3);
    }

    /// A frame cut short: the next one begins inside the window.
    #[test]
    fn a_cut_frame_does_not_cost_the_next() {
        for cut in 1..13 {
            let deframer = run(&[&REPLY[..cut], &REQUEST], [REQUEST]);
            assert_eq!(deframer.rejected(), u32::try_from(cut).expect("small"), "cut after {cut}");
            assert_eq!(deframer.pending(), 0);
        }
    }

    #[test]
    fn a_damaged_byte_costs_one_frame() {
        for at in 0..13 {
            let mut damaged = REPLY;
            damaged[at] ^= 0x10;
            let deframer = run(&[&REQUEST, &damaged, &REQUEST], [REQUEST, REQUEST]);
            assert_eq!(deframer.rejected(), 13, "byte {at}");
        }
    }

    /// 0x3E as data: 62 centiamps, 62 degrees per second, 62 degrees. Checksum computed apart from this crate.
    #[test]
    fn header_bytes_in_the_data() {
        let frame = [0x3E, 0x01, 0x08, 0x9C, 0x3E, 0x3E, 0x01, 0x08, 0x3E, 0x3E, 0x01, 0xA6, 0xE1];
        let deframer = run(&[&frame, &frame[..7], &frame], [frame, frame]);
        assert_eq!((deframer.rejected(), deframer.pending()), (7, 0));
    }

    /// The vendor's older framing: `3E command id length sum`, then data and its sum.
    #[test]
    fn the_older_framing_is_rejected() {
        let read_state = [0x3E, 0x9C, 0x01, 0x00, 0xDB];
        let deframer = run(&[&read_state, &REPLY, &read_state], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (10, 0));

        // Id 8 stands where the length byte is now; the checksum decides.
        let id_8 = [0x3E, 0x19, 0x08, 0x00, 0x5F];
        let deframer = run(&[&id_8, &REPLY], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (5, 0));
        let speed = [0x3E, 0xA2, 0x08, 0x04, 0xEC, 0x10, 0x27, 0x00, 0x00, 0x37];
        let deframer = run(&[&speed, &speed, &REPLY], [REPLY]);
        assert_eq!((deframer.rejected(), deframer.pending()), (20, 0));
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
