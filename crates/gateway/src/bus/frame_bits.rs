//! How long a frame on a CAN bus can be, F of the bounds in bits (GUARANTEES G5).

use super::Bus;
use crate::axis::Axis;
use crate::protocol;
use crate::time::Duration;
use embedded_can::Id;
use heapless::Vec;

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
pub(super) const EXTENDED_FRAME_BITS: u64 = longest(EXTENDED_HEADER_BITS);

const _: () = assert!(STANDARD_FRAME_BITS == 135 && EXTENDED_FRAME_BITS == 160);

/// Bits of the longest stuffed data frame with intermission.
const fn longest(header_bits: u64) -> u64 {
    let stuffed = header_bits + DATA_BITS + CRC_BITS;
    stuffed + (stuffed - 1) / STUFF_EVERY + TRAILER_BITS
}

/// Bits of a data frame without one stuffed, with intermission; of a standard one where the id is
/// not known.
pub(super) fn least_frame_bits(id: Option<Id>, data_bytes: usize) -> u64 {
    let header = match id {
        Some(Id::Extended(_)) => EXTENDED_HEADER_BITS,
        Some(Id::Standard(_)) | None => STANDARD_HEADER_BITS,
    };
    header + 8 * data_bytes as u64 + CRC_BITS + TRAILER_BITS
}

/// Bits of a data frame, before stuffing and without what is not stuffed, at most.
#[allow(clippy::cast_possible_truncation, reason = "118")]
const UNSTUFFED_BITS: usize = (EXTENDED_HEADER_BITS + DATA_BITS + CRC_BITS) as usize;
/// A stuff bit follows so many equal bits.
const STUFF_RUN: usize = 5;
/// Generator polynomial of CRC-15/CAN (ISO 11898-1).
const CRC_POLYNOMIAL: u16 = 0x4599;

/// The bits of a frame that stuffing looks at; `None` where one may be either.
struct FrameBits(Vec<Option<bool>, UNSTUFFED_BITS>);

impl FrameBits {
    /// The lowest `count` bits of a value, the highest first.
    fn push(&mut self, value: u32, count: u32) {
        for at in (0..count).rev() {
            let _ = self.0.push(Some(value >> at & 1 == 1));
        }
    }

    /// The rest, data bytes that are not known and the CRC.
    fn push_unknown(&mut self, data_bytes: usize) {
        (0..8 * data_bytes as u64 + CRC_BITS).for_each(|_| {
            let _ = self.0.push(None);
        });
    }

    /// The CRC of what is there, which is all known.
    fn crc(&self) -> u16 {
        self.0.iter().flatten().fold(0, |crc, bit| {
            let shifted = crc << 1 & 0x7FFF;
            if (crc >> (CRC_BITS - 1) & 1 == 1) == *bit {
                shifted
            } else {
                shifted ^ CRC_POLYNOMIAL
            }
        })
    }

    /// With as many stuff bits as the unknown bits can bring about.
    fn longest(&self) -> u64 {
        // The most stuff bits so far, by the value of the last bit and how many are equal to it.
        let mut most: [[Option<u64>; STUFF_RUN]; 2] = [[None; STUFF_RUN]; 2];
        for (place, bit) in self.0.iter().enumerate() {
            let mut next = [[None; STUFF_RUN]; 2];
            let mut reach = |value: bool, run: usize, stuffed: u64| {
                // The stuff bit is the first of a new run.
                let (value, run, stuffed) =
                    if run == STUFF_RUN { (!value, 1, stuffed + 1) } else { (value, run, stuffed) };
                let runs = next.get_mut(usize::from(value));
                if let Some(best) =
                    runs.and_then(|runs: &mut [Option<u64>; STUFF_RUN]| runs.get_mut(run))
                {
                    *best = (*best).max(Some(stuffed));
                }
            };
            for value in [false, true].into_iter().filter(|value| bit.is_none_or(|b| b == *value)) {
                if place == 0 {
                    reach(value, 1, 0);
                }
                for (last, runs) in [false, true].into_iter().zip(&most) {
                    for (run, stuffed) in runs.iter().enumerate() {
                        let Some(stuffed) = *stuffed else { continue };
                        reach(value, if last == value { run + 1 } else { 1 }, stuffed);
                    }
                }
            }
            most = next;
        }
        let stuffed = most.iter().flatten().flatten().max().copied().unwrap_or(0);
        self.0.len() as u64 + stuffed + TRAILER_BITS
    }
}

/// Bits of the longest stuffed frame with this id and so many data bytes, of which the first are
/// these, with intermission. Of a frame that is known as a whole it is the length.
pub(super) fn frame_bits(id: Id, len: usize, known: &[u8]) -> u64 {
    let mut bits = FrameBits(Vec::new());
    bits.push(0, 1);
    match id {
        Id::Standard(id) => {
            bits.push(id.as_raw().into(), 11);
            // RTR, IDE, r0.
            bits.push(0, 3);
        }
        Id::Extended(id) => {
            bits.push(id.as_raw() >> 18, 11);
            // SRR, IDE.
            bits.push(0b11, 2);
            bits.push(id.as_raw(), 18);
            // RTR, r1, r0.
            bits.push(0, 3);
        }
    }
    bits.push(u32::try_from(len).unwrap_or(0), 4);
    let known = known.get(..len).unwrap_or(known);
    known.iter().for_each(|byte| bits.push((*byte).into(), 8));
    if known.len() == len {
        let crc = bits.crc();
        bits.push(crc.into(), 15);
    } else {
        bits.push_unknown(len - known.len());
    }
    bits.longest()
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

#[cfg(test)]
#[path = "../../tests/unit/frame_bits.rs"]
mod tests;
