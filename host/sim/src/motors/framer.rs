//! Finds frames in the bytes of an RS485 line, and knows the bytes of the one that has begun.

use rmd::rs485::{Deframer, FRAME_LEN};

/// The codec's deframer with what it holds: that, replayed, makes another one like it.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "snapshot", serde(from = "Vec<u8>", into = "Vec<u8>"))]
pub(super) struct Framer {
    deframer: Deframer,
    /// The bytes of the frame begun.
    begun: Vec<u8>,
}

impl Framer {
    /// Takes the next byte; yields the frame that it completes.
    pub(super) fn push(&mut self, byte: u8) -> Option<[u8; FRAME_LEN]> {
        let frame = self.deframer.push(byte);
        self.begun.push(byte);
        let surplus = self.begun.len().saturating_sub(self.deframer.pending());
        self.begun.drain(..surplus);
        frame
    }

    /// Drops the frame begun.
    pub(super) fn reset(&mut self) {
        self.deframer.reset();
        self.begun.clear();
    }
}

impl From<Vec<u8>> for Framer {
    fn from(begun: Vec<u8>) -> Self {
        let mut framer = Self::default();
        for byte in begun {
            framer.push(byte);
        }
        framer
    }
}

impl From<Framer> for Vec<u8> {
    fn from(framer: Framer) -> Self {
        framer.begun
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A proven frame: a 0x9C request.
    const REQUEST: [u8; FRAME_LEN] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];

    #[test]
    fn a_framer_made_of_what_another_holds_goes_on_like_it() {
        for cut in 0..FRAME_LEN {
            let mut framer = Framer::default();
            let garbage = [0x11, 0x3E, 0x22];
            for byte in garbage.iter().chain(&REQUEST[..cut]) {
                assert_eq!(framer.push(*byte), None);
            }
            let mut other = Framer::from(Vec::from(framer));
            let frames: Vec<_> =
                REQUEST[cut..].iter().filter_map(|byte| other.push(*byte)).collect();
            assert_eq!(frames, [REQUEST], "cut after {cut}");
        }
    }

    #[test]
    fn a_reset_drops_what_had_begun() {
        let mut framer = Framer::default();
        framer.push(0x3E);
        framer.reset();
        assert_eq!(Vec::from(framer), []);
    }
}
