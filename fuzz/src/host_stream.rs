//! Host frames in the bytes of a link.

use host_protocol::{DELIMITER, Deframer, Frame, FrameError, MAX_MESSAGE};

use crate::host_messages::frame;
use crate::line::line;
use crate::take::Take;

pub fn check(bytes: &[u8]) {
    let line = line(&mut Take(bytes), |[kind, seq_0, seq_1, num_0, num_1, body @ ..]| {
        let (sequence, number) =
            (u16::from_le_bytes([*seq_0, *seq_1]), u16::from_le_bytes([*num_0, *num_1]));
        frame(kind % 4 + 1, sequence, number, body)
    });
    let mut deframer = Deframer::new();
    let mut found = Vec::new();
    for byte in &line.bytes {
        if let Some(result) = deframer.push(*byte) {
            assert_eq!(*byte, DELIMITER);
            found.push(result.map(Owned::of));
        }
    }
    let pieces = line.bytes.split(|byte| *byte == DELIMITER);
    // What comes after the last delimiter is not complete.
    let complete = line.bytes.iter().filter(|byte| **byte == DELIMITER).count();
    let expected: Vec<_> =
        pieces.take(complete).filter(|piece| !piece.is_empty()).map(read).collect();
    assert_eq!(found, expected);

    // Each whole frame is there, in order, whatever stood before it.
    let mut delivered = found.iter();
    for whole in &line.whole {
        let whole = read(&whole[1..whole.len() - 1]);
        assert!(whole.is_ok() && delivered.any(|result| *result == whole));
    }
}

#[derive(Debug, PartialEq)]
struct Owned {
    kind: u8,
    sequence: u16,
    number: u16,
    body: Vec<u8>,
}

impl Owned {
    fn of(frame: Frame<'_>) -> Owned {
        let Frame { kind, sequence, number, body, .. } = frame;
        Owned { kind: kind as u8, sequence, number, body: body.to_vec() }
    }
}

/// What stands between two delimiters.
fn read(piece: &[u8]) -> Result<Owned, FrameError> {
    let (message, complete) = without_cobs(piece);
    if message.len() > MAX_MESSAGE {
        return Err(FrameError::TooLong);
    }
    if !complete {
        return Err(FrameError::Cobs);
    }
    Frame::from_message(&message).map(Owned::of)
}

/// The message, and whether its last block is complete.
fn without_cobs(mut piece: &[u8]) -> (Vec<u8>, bool) {
    let mut message = Vec::new();
    while let Some((code, rest)) = piece.split_first() {
        let len = usize::from(*code) - 1;
        message.extend(rest.iter().take(len));
        if len > rest.len() {
            return (message, false);
        }
        piece = &rest[len..];
        if *code != 0xFF && !piece.is_empty() {
            message.push(0);
        }
    }
    (message, true)
}
