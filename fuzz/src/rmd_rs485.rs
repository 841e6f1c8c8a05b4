//! RMD frames in the bytes of an RS485 line.

use rmd::rs485::{Deframer, FRAME_LEN, Piece, Scan};

use crate::line::line;
use crate::rmd::{crc16_modbus, serial_frame};
use crate::take::Take;

pub fn check(bytes: &[u8]) {
    let mut take = Take(bytes);
    let cut = usize::from(take.byte());
    let line = line(&mut take, |[id, data @ ..]| serial_frame(*id, *data).to_vec()).bytes;
    let expected = frames_of(&line);

    let mut deframer = Deframer::new();
    let (first, second) = line.split_at(cut.min(line.len()));
    let mut frames: Vec<_> = deframer.push_slice(first).collect();
    frames.extend(deframer.push_slice(second));
    assert_eq!(frames, expected);
    let rejected = usize::try_from(deframer.rejected()).expect("fits");
    assert!(deframer.pending() < FRAME_LEN);
    assert_eq!(frames.len() * FRAME_LEN + rejected + deframer.pending(), line.len());

    check_scan(&line, &expected, rejected, deframer.pending());

    // Once no header byte is left in its window, the deframer is as good as new.
    _ = deframer.push_slice(&[0; FRAME_LEN]).count();
    let frame = serial_frame(1, [0x9C, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(deframer.push_slice(&frame).collect::<Vec<_>>(), [frame]);
}

fn check_scan(line: &[u8], expected: &[[u8; FRAME_LEN]], rejected: usize, pending: usize) {
    let mut scan = Scan::new(line);
    let (mut frames, mut garbage) = (Vec::new(), 0);
    for piece in scan.by_ref() {
        match piece {
            Piece::Frame(frame) => frames.push(*frame),
            Piece::Garbage(bytes) => garbage += bytes.len(),
        }
    }
    assert_eq!(frames, expected);
    assert_eq!((garbage, scan.rest().len()), (rejected, pending));
}

/// The frames of a whole line, found by trying every position.
fn frames_of(mut line: &[u8]) -> Vec<[u8; FRAME_LEN]> {
    let mut frames = Vec::new();
    while let Some(frame) = line.first_chunk::<FRAME_LEN>() {
        let right = frame[0] == 0x3E && frame[2] == 8 && crc16_modbus(frame) == 0;
        if right {
            frames.push(*frame);
        }
        line = &line[if right { FRAME_LEN } else { 1 }..];
    }
    frames
}
