//! Frames on a serial line: each protocol has its own, and a line speaks one.

use super::{Command, Received};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The longest frame of a protocol on a serial line, bytes.
const MAX_FRAME: usize = ::rmd::rs485::FRAME_LEN;

/// A frame on a serial line.
pub(crate) type SerialFrame = Vec<u8, MAX_FRAME>;

/// How a protocol looks on a serial line.
#[derive(Debug)]
pub(crate) struct Serial {
    /// Bytes of each of its frames.
    pub frame_len: usize,
    /// Where in a frame the data begin that the same frame has on CAN.
    pub data_at: usize,
    /// What finds its frames in the bytes of a line.
    pub deframer: Deframer,
    /// A command to a node as a frame, and a frame as a reply.
    pub encode: fn(&Command, u8) -> Option<SerialFrame>,
    pub decode: fn(&[u8]) -> Option<Received>,
    /// Whether bytes are one whole request that only reads.
    pub reads: fn(&[u8]) -> bool,
}

/// Finds the frames of one protocol in the bytes of a line.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) enum Deframer {
    Rmd(::rmd::rs485::Deframer),
    D5(::d5::serial::Deframer),
}

impl Deframer {
    /// How its protocol looks on a serial line.
    pub fn serial(&self) -> Option<&'static Serial> {
        match self {
            Self::Rmd(_) => const { super::rmd::INFO.serial.as_ref() },
            Self::D5(_) => const { super::d5::INFO.serial.as_ref() },
        }
    }

    /// Takes the next byte of the line; yields the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<SerialFrame> {
        match self {
            Self::Rmd(deframer) => Vec::from_slice(&deframer.push(byte)?).ok(),
            Self::D5(deframer) => Vec::from_slice(&deframer.push(byte)?).ok(),
        }
    }

    /// Drops a frame begun.
    pub fn reset(&mut self) {
        match self {
            Self::Rmd(deframer) => deframer.reset(),
            Self::D5(deframer) => deframer.reset(),
        }
    }

    /// Bytes that belonged to no frame.
    pub fn rejected(&self) -> u32 {
        match self {
            Self::Rmd(deframer) => deframer.rejected(),
            Self::D5(deframer) => deframer.rejected(),
        }
    }
}
