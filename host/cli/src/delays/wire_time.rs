//! How long a frame is on its bus: what lies between the end of a request and the end of its reply
//! beside the motor's own delay.

use host_protocol::RawFrame;

/// Bits of a byte on a serial line, with start and stop bit.
const BYTE_BITS: u64 = 10;
const MICROSECONDS: u64 = 1_000_000;

/// µs, rounded to the next.
pub fn wire_time_us(frame: &RawFrame, bitrate: u32) -> u64 {
    let bits = match frame {
        RawFrame::Can(frame) => mgw_sim::can_frame_bits(frame),
        RawFrame::Serial(bytes) => BYTE_BITS * bytes.len() as u64,
    };
    let bitrate = u64::from(bitrate.max(1));
    (bits * MICROSECONDS + bitrate / 2) / bitrate
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::recorded_frame as parse;

    #[test]
    fn a_frame_takes_its_bits() {
        // 108 bits and 10 stuff bits.
        let frame = parse("can", "241#9A190001E0010000").unwrap();
        assert_eq!(wire_time_us(&frame, 1_000_000), 118);
        assert_eq!(wire_time_us(&frame, 500_000), 236);
        let frame = parse("serial", "3E01089A190001E0010000A11B").unwrap();
        assert_eq!(wire_time_us(&frame, 115_200), 1_128, "130 bits of 8.68 µs");
    }
}
