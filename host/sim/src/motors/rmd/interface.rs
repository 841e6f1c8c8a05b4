//! How an RMD motor is connected: frames in, frames out.

use std::time::Duration;

use super::super::framer::Framer;
use super::super::lenient;
use super::super::model::Context;
use crate::bus::{Wire, bit_time};
use embedded_can::Frame;
use host_protocol::CanFrame;
use rmd::{Node, Reply, Request, Target};

/// A pause of this many bits ends a frame begun on RS485.
const FRAME_GAP_BITS: u64 = 35;

/// How the motor is connected.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(in super::super) enum Interface {
    Can,
    Rs485 { framer: Framer, line: lenient::Line, last_byte: Duration, gap: Duration },
}

impl Interface {
    pub(in super::super) fn rs485(baud: u32) -> Self {
        let gap = bit_time(FRAME_GAP_BITS, baud);
        let (framer, line) = (Framer::default(), lenient::Line::default());
        Self::Rs485 { framer, line, last_byte: Duration::ZERO, gap }
    }

    /// It runs at another rate from now on, bit/s.
    pub(super) fn set_rate(&mut self, baud: u32) {
        if let Self::Rs485 { gap, .. } = self {
            *gap = bit_time(FRAME_GAP_BITS, baud);
        }
    }

    /// The request in a frame, and to whom it goes.
    pub(super) fn request(lenient: bool, frame: &CanFrame) -> Option<(Target, Request)> {
        let frame = if lenient { lenient::as_rmd(frame) } else { *frame };
        rmd::can::decode_any_request(&frame).ok().filter(|_| !frame.is_remote_frame())
    }

    /// Takes the next byte; the request that it completes, to whom it goes, and its data.
    pub(super) fn push(
        &mut self,
        now: Duration,
        lenient: bool,
        byte: u8,
    ) -> Option<(Target, Request, [u8; rmd::DATA_LEN])> {
        let Self::Rs485 { framer, line, last_byte, gap } = self else { return None };
        if now.saturating_sub(*last_byte) > *gap {
            framer.reset();
        }
        *last_byte = now;
        let (strictly, leniently) = (framer.push(byte), line.push(byte));
        let frame = if lenient { leniently } else { strictly }?;
        let (to, request) = rmd::rs485::decode_any_request(&frame).ok()?;
        let [_, _, _, data @ .., _, _] = frame;
        Some((to, request, data))
    }

    /// Sends a reply after `delay`.
    pub(super) fn send(&self, cx: &mut Context<'_>, node: Node, delay: Duration, reply: &Reply) {
        match self {
            Self::Can => {
                if let Ok(frame) = rmd::can::reply(node, reply) {
                    cx.send(delay, Wire::Can(frame), false);
                }
            }
            Self::Rs485 { .. } => {
                if let Ok(bytes) = rmd::rs485::reply(node, reply) {
                    cx.send(delay, Wire::Serial(bytes.to_vec()), true);
                }
            }
        }
    }

    /// The rate that a code of 0xB4 sets, bit/s (RMD V3.6 §2.31).
    pub(super) fn rate(&self, code: rmd::BaudCode, dialect: rmd::Dialect) -> Option<u32> {
        match self {
            Self::Can => code.can(dialect),
            Self::Rs485 { .. } => code.rs485(dialect),
        }
    }
}
