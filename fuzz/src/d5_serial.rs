//! D5 frames in the bytes of a serial line.

use d5::FRAME_LEN;
use d5::serial::Deframer;

use crate::d5::{checksum, set_right};
use crate::line::line;
use crate::take::Take;

pub fn check(bytes: &[u8]) {
    let mut take = Take(bytes);
    let cut = usize::from(take.byte());
    let line = line(&mut take, |[header, data @ ..]| {
        let header = if *header < 0x80 { d5::REQUEST_HEADER } else { d5::REPLY_HEADER };
        set_right(header, *data).to_vec()
    })
    .bytes;
    let expected = frames_of(&line);

    let mut deframer = Deframer::new();
    let (first, second) = line.split_at(cut.min(line.len()));
    let mut frames: Vec<_> = deframer.push_slice(first).collect();
    frames.extend(deframer.push_slice(second));
    assert_eq!(frames, expected);
    let rejected = usize::try_from(deframer.rejected()).expect("fits");
    assert!(deframer.pending() < FRAME_LEN);
    assert_eq!(frames.len() * FRAME_LEN + rejected + deframer.pending(), line.len());

    // Once no header byte is left in its window, the deframer is as good as new.
    _ = deframer.push_slice(&[0; FRAME_LEN]).count();
    let frame = [0x5D, 0x0B, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x75];
    assert_eq!(deframer.push_slice(&frame).collect::<Vec<_>>(), [frame]);
}

/// The frames of a whole line, found by trying every position.
fn frames_of(mut line: &[u8]) -> Vec<[u8; FRAME_LEN]> {
    let mut frames = Vec::new();
    while let Some(frame) = line.first_chunk::<FRAME_LEN>() {
        let right = matches!(frame, [0xD5 | 0x5D, _, 4 | 5, ..]) && checksum(frame) == frame[7];
        if right {
            frames.push(*frame);
        }
        line = &line[if right { FRAME_LEN } else { 1 }..];
    }
    frames
}
