//! Frames and garbage in the bytes of a serial line, RMD and D5 alike.

use std::fmt;

use crate::args::ProtocolChoice;

/// First byte and length byte of an RMD frame (RMD V3.6 §1.2.2).
const RMD_HEADER: u8 = 0x3E;
const RMD_LENGTH: u8 = 0x08;
/// Length bytes of a D5 frame: one data byte, or two (D5 manual, frame format).
const D5_LENGTHS: [u8; 2] = [0x04, 0x05];

const RMD_FRAME_LEN: usize = rmd::rs485::FRAME_LEN;
const D5_FRAME_LEN: usize = d5::FRAME_LEN;

/// Cuts bytes that come in pieces into frames and garbage. It holds no more than one piece and a
/// frame begun.
pub struct Scanner {
    rmd: bool,
    d5: bool,
    bytes: Vec<u8>,
    taken: usize,
    /// Up to here the bytes are no frame.
    broken_until: usize,
    ended: bool,
}

/// A part of the bytes.
#[derive(Debug, PartialEq, Eq)]
pub enum Piece<'a> {
    /// A frame with the right checksum.
    Rmd(&'a [u8; RMD_FRAME_LEN]),
    /// A frame with the right checksum, of either direction.
    D5(&'a [u8; D5_FRAME_LEN]),
    /// Bytes that are no frame.
    Broken { bytes: &'a [u8], why: Broken },
}

/// Why bytes are no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Broken {
    /// No frame begins with them.
    Garbage,
    /// A frame begins with them and does not go on.
    Truncated,
    /// A whole frame but for its checksum.
    Checksum,
}

impl Broken {
    /// Stable name.
    pub fn name(self) -> &'static str {
        match self {
            Broken::Garbage => "garbage",
            Broken::Truncated => "truncated",
            Broken::Checksum => "checksum",
        }
    }
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Broken::Garbage => "no frame begins with these bytes",
            Broken::Truncated => "the frame ends before its checksum",
            Broken::Checksum => "the checksum does not fit the bytes before it",
        })
    }
}

impl<'a> Piece<'a> {
    pub fn bytes(&self) -> &'a [u8] {
        match self {
            Piece::Rmd(frame) => *frame,
            Piece::D5(frame) => *frame,
            Piece::Broken { bytes, .. } => bytes,
        }
    }
}

/// What stands at the beginning of some bytes.
enum Start<'a> {
    Frame(Piece<'a>),
    /// What may still become a frame.
    Begun,
    Nothing,
}

impl Scanner {
    /// For the frames of the chosen protocol, or of both.
    pub fn new(choice: ProtocolChoice) -> Self {
        let rmd = matches!(choice, ProtocolChoice::Auto | ProtocolChoice::Rmd);
        let d5 = matches!(choice, ProtocolChoice::Auto | ProtocolChoice::D5);
        Self { rmd, d5, bytes: Vec::new(), taken: 0, broken_until: 0, ended: false }
    }

    /// Takes the bytes that follow.
    pub fn push(&mut self, bytes: impl Iterator<Item = u8>) {
        self.bytes.extend(bytes);
        self.ended = false;
    }

    /// Nothing follows: what has begun is no frame.
    pub fn end(&mut self) {
        self.ended = true;
    }

    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The next frame or the bytes before it; `None` when more bytes are needed.
    pub fn next(&mut self) -> Option<Piece<'_>> {
        let from = self.taken;
        if from >= self.broken_until {
            let rest = self.bytes.get(from..).unwrap_or_default();
            let stands = |at: &usize| {
                !matches!(self.start(rest.get(*at..).unwrap_or_default()), Start::Nothing)
            };
            self.broken_until = from + (0..rest.len()).find(stands).unwrap_or(rest.len());
        }
        if from < self.broken_until {
            let (why, length) = self.broken(self.bytes.get(from..self.broken_until)?);
            self.taken += length;
            return self.bytes.get(from..self.taken).map(|bytes| Piece::Broken { bytes, why });
        }
        let length = match self.start(self.bytes.get(from..)?) {
            Start::Frame(piece) => piece.bytes().len(),
            Start::Begun | Start::Nothing => return None,
        };
        self.taken += length;
        match self.start(self.bytes.get(from..)?) {
            Start::Frame(piece) => Some(piece),
            Start::Begun | Start::Nothing => None,
        }
    }

    /// Drops what has been handed out.
    pub fn forget(&mut self) {
        self.bytes.drain(..self.taken);
        self.broken_until = 0;
        self.taken = 0;
    }

    fn start<'b>(&self, bytes: &'b [u8]) -> Start<'b> {
        let begun = || if self.ended { Start::Nothing } else { Start::Begun };
        match bytes {
            [] => Start::Nothing,
            [RMD_HEADER] | [RMD_HEADER, _] if self.rmd => begun(),
            [RMD_HEADER, _, RMD_LENGTH, ..] if self.rmd => match bytes.first_chunk() {
                None => begun(),
                Some(frame) if is_rmd(frame) => Start::Frame(Piece::Rmd(frame)),
                Some(_) => Start::Nothing,
            },
            [d5::REQUEST_HEADER | d5::REPLY_HEADER]
            | [d5::REQUEST_HEADER | d5::REPLY_HEADER, _]
                if self.d5 =>
            {
                begun()
            }
            _ if self.d5 && has_d5_head(bytes) => match bytes.first_chunk() {
                None => begun(),
                Some(frame) if is_d5(frame) => Start::Frame(Piece::D5(frame)),
                Some(_) => Start::Nothing,
            },
            _ => Start::Nothing,
        }
    }

    /// What is wrong with bytes that are no frame, up to the first of which something else is
    /// wrong.
    fn broken(&self, bytes: &[u8]) -> (Broken, usize) {
        // What has only begun at the very end of the input might have become a frame.
        let is_end = self.ended && self.broken_until == self.bytes.len();
        let wrong = |at: usize| self.wrong_frame(bytes.get(at..).unwrap_or_default(), is_end);
        match wrong(0) {
            Some((why, length)) => (why, length),
            None => (
                Broken::Garbage,
                (1..bytes.len()).find(|at| wrong(*at).is_some()).unwrap_or(bytes.len()),
            ),
        }
    }

    /// A frame that would be one with another checksum or if it went on, and its length.
    fn wrong_frame(&self, bytes: &[u8], is_end: bool) -> Option<(Broken, usize)> {
        let length = match bytes {
            [RMD_HEADER] | [RMD_HEADER, _] if self.rmd && is_end => RMD_FRAME_LEN,
            [d5::REQUEST_HEADER | d5::REPLY_HEADER]
            | [d5::REQUEST_HEADER | d5::REPLY_HEADER, _]
                if self.d5 && is_end =>
            {
                D5_FRAME_LEN
            }
            [RMD_HEADER, _, RMD_LENGTH, ..] if self.rmd => RMD_FRAME_LEN,
            _ if self.d5 && has_d5_head(bytes) => D5_FRAME_LEN,
            _ => return None,
        };
        Some(if bytes.len() < length {
            (Broken::Truncated, bytes.len())
        } else {
            (Broken::Checksum, length)
        })
    }
}

fn is_rmd(frame: &[u8; RMD_FRAME_LEN]) -> bool {
    matches!(rmd::rs485::Scan::new(frame).next(), Some(rmd::rs485::Piece::Frame(_)))
}

/// Whether a header, an id and a length byte of D5 stand here.
fn has_d5_head(bytes: &[u8]) -> bool {
    matches!(bytes, [d5::REQUEST_HEADER | d5::REPLY_HEADER, _, length, ..]
        if D5_LENGTHS.contains(length))
}

fn is_d5(frame: &[u8; D5_FRAME_LEN]) -> bool {
    d5::serial::Deframer::new().push_slice(frame).next().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Proven RMD frames: a 0x9C request and its reply.
    const REQUEST: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    const REPLY: [u8; 13] =
        [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];
    /// D5 manual, row 2.
    const D5: [u8; 8] = [0xD5, 0x0B, 0x05, 0x01, 0x00, 0x00, 0x00, 0x11];

    /// What a scanner finds in bytes that come in steps of this size: the bytes and, of a broken
    /// piece, why.
    fn scan(choice: ProtocolChoice, bytes: &[u8], step: usize) -> Vec<(Vec<u8>, &'static str)> {
        let mut scanner = Scanner::new(choice);
        let mut found = Vec::new();
        let mut drain = |scanner: &mut Scanner| {
            while let Some(piece) = scanner.next() {
                let name = match &piece {
                    Piece::Rmd(_) => "rmd",
                    Piece::D5(_) => "d5",
                    Piece::Broken { why, .. } => why.name(),
                };
                found.push((piece.bytes().to_vec(), name));
            }
            scanner.forget();
        };
        for part in bytes.chunks(step) {
            scanner.push(part.iter().copied());
            drain(&mut scanner);
            assert!(scanner.bytes.len() < RMD_FRAME_LEN);
        }
        scanner.end();
        drain(&mut scanner);
        assert!(scanner.is_empty());
        found
    }

    #[test]
    fn frames_of_both_protocols_between_garbage() {
        let line = [&[0xEE, 0x3E][..], &REQUEST, &D5, &REPLY, &[0x5D]].concat();
        for step in 1..line.len() {
            let found = scan(ProtocolChoice::Auto, &line, step);
            let frames: Vec<_> =
                found.iter().filter(|(_, name)| ["rmd", "d5"].contains(name)).cloned().collect();
            assert_eq!(
                frames,
                [(REQUEST.to_vec(), "rmd"), (D5.to_vec(), "d5"), (REPLY.to_vec(), "rmd")],
                "{step}"
            );
            let all: Vec<u8> = found.into_iter().flat_map(|(bytes, _)| bytes).collect();
            assert_eq!(all, line, "no byte is lost");
        }
    }

    #[test]
    fn a_chosen_protocol_sees_nothing_of_the_other() {
        let line = [&REQUEST[..], &D5].concat();
        assert_eq!(
            scan(ProtocolChoice::Rmd, &line, 64),
            [(REQUEST.to_vec(), "rmd"), (D5.to_vec(), "garbage")]
        );
        assert_eq!(
            scan(ProtocolChoice::D5, &line, 64),
            [(REQUEST.to_vec(), "garbage"), (D5.to_vec(), "d5")]
        );
    }

    #[test]
    fn what_is_wrong_has_a_name() {
        let mut spoilt = REPLY;
        spoilt[12] ^= 1;
        let line = [
            &[0xEE][..],
            &spoilt,
            &REQUEST[..7],
            &REQUEST,
            &[0x3E, 0x9C, 0x01, 0x00, 0xDB],
            &D5[..4],
        ];
        assert_eq!(
            scan(ProtocolChoice::Auto, &line.concat(), 64),
            [
                (vec![0xEE], "garbage"),
                (spoilt.to_vec(), "checksum"),
                (REQUEST[..7].to_vec(), "truncated"),
                (REQUEST.to_vec(), "rmd"),
                (vec![0x3E, 0x9C, 0x01, 0x00, 0xDB], "garbage"),
                (D5[..4].to_vec(), "truncated"),
            ]
        );
    }

    #[test]
    fn a_frame_inside_a_cut_one_is_found_at_the_end() {
        let line = [&[0x3E, 0x01, 0x08][..], &D5].concat();
        assert_eq!(
            scan(ProtocolChoice::Auto, &line, 64),
            [(vec![0x3E, 0x01, 0x08], "truncated"), (D5.to_vec(), "d5")]
        );
    }
}
