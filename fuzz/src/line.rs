//! The bytes of a serial line: whole frames, cut frames and garbage, as the fuzzer says.

use crate::take::Take;

/// This bit of a control byte makes a frame; without it, the low bits count bytes as they are.
const FRAME: u8 = 0x80;
const LITERAL_LEN: u8 = 0x3F;
const CUT: u8 = 0x0F;

/// What a frame is made of.
const SEED_LEN: usize = 9;

pub struct Line {
    pub bytes: Vec<u8>,
    /// Frames that went in whole.
    pub whole: Vec<Vec<u8>>,
}

/// A line of pieces, each after a control byte; `frame` makes the frames.
pub fn line(take: &mut Take<'_>, frame: impl Fn(&[u8; SEED_LEN]) -> Vec<u8>) -> Line {
    let mut line = Line { bytes: Vec::new(), whole: Vec::new() };
    while !take.is_empty() {
        let control = take.byte();
        if control & FRAME == 0 {
            line.bytes.extend(take.bytes(usize::from(control & LITERAL_LEN)));
            continue;
        }
        let frame = frame(&take.array());
        let kept = frame.len().saturating_sub(usize::from(control & CUT));
        line.bytes.extend(&frame[..kept]);
        if kept == frame.len() {
            line.whole.push(frame);
        }
    }
    line
}
