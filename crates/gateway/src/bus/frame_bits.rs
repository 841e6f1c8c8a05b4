//! How long a frame on a CAN bus can be, F of the bounds in bits (GUARANTEES G5).

use super::Bus;
use crate::axis::Axis;
use crate::protocol;
use crate::time::Duration;

/// Bits of a standard frame before its data: start of frame, 11 of the id, RTR, IDE, r0, 4 of the
/// length.
const STANDARD_HEADER_BITS: u64 = 1 + 11 + 3 + 4;
/// Bits of an extended frame before its data: start of frame, 11 of the id, SRR, IDE, 18 of the id,
/// RTR, r1, r0, 4 of the length.
const EXTENDED_HEADER_BITS: u64 = 1 + 11 + 2 + 18 + 3 + 4;
const DATA_BITS: u64 = 64;
const CRC_BITS: u64 = 15;
/// The first stuff bit follows five equal bits; each further one at the earliest four bits later,
/// as it begins the next five.
const STUFF_EVERY: u64 = 4;
/// What is not stuffed: CRC delimiter, acknowledgement and its delimiter, 7 of end of frame, 3 of
/// intermission.
const TRAILER_BITS: u64 = 1 + 2 + 7 + 3;
/// The longest data frame on a bus without extended ids, bits.
pub(super) const STANDARD_FRAME_BITS: u64 = longest(STANDARD_HEADER_BITS);
/// The longest data frame on a bus with extended ids, bits.
const EXTENDED_FRAME_BITS: u64 = longest(EXTENDED_HEADER_BITS);

const _: () = assert!(STANDARD_FRAME_BITS == 135 && EXTENDED_FRAME_BITS == 160);

/// Bits of the longest stuffed data frame with intermission.
const fn longest(header_bits: u64) -> u64 {
    let stuffed = header_bits + DATA_BITS + CRC_BITS;
    stuffed + (stuffed - 1) / STUFF_EVERY + TRAILER_BITS
}

/// Bits of the longest frame that these axes send or are answered with.
pub(super) fn longest_frame_bits<'a>(mut axes: impl Iterator<Item = &'a Axis>) -> u64 {
    let has_extended = axes.any(|axis| protocol::has_extended_ids(&axis.config));
    if has_extended { EXTENDED_FRAME_BITS } else { STANDARD_FRAME_BITS }
}

impl Bus {
    /// Time of so many of the longest frames here, each rounded up.
    pub(super) fn frame_time(&self, frames: u64) -> Duration {
        self.bit_time(self.longest_frame_bits).times(frames)
    }
}
