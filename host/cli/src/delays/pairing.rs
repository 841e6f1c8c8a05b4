//! Requests and their replies among the frames of a bus, as the codecs match them.

use std::collections::BTreeMap;

use host_protocol::RawFrame;

use crate::frames::{Reply, Request, replies, request_to_one};

/// A request that has not been answered after this is forgotten, µs.
const PATIENCE_US: u64 = 100_000;

/// A motor of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Motor {
    /// The bus.
    pub bus: u64,
    /// `rmd`, `thruster` or `d5`.
    pub protocol: &'static str,
    /// Its id there.
    pub node: u8,
}

/// A request that waits for its reply.
#[derive(Debug)]
struct Waiting {
    request: Request,
    frame: RawFrame,
    time_us: u64,
}

/// A reply to a request.
#[derive(Debug, PartialEq)]
pub struct Pair {
    /// Which motor replied.
    pub motor: Motor,
    /// What it was asked.
    pub command: &'static str,
    /// What it replied.
    pub reply: Reply,
    /// From the end of the request to the end of the reply, µs.
    pub span_us: u64,
}

/// The requests that wait, by motor.
#[derive(Default)]
pub struct Pairing {
    waiting: BTreeMap<Motor, Vec<Waiting>>,
}

impl Pairing {
    /// Takes a frame that arrived at `time_us`. A reply that may answer more than one request
    /// tells no time.
    pub fn take(&mut self, bus: u64, frame: &RawFrame, time_us: u64) -> Option<Pair> {
        for (node, reply) in replies(frame) {
            let motor = Motor { bus, protocol: reply.protocol().name(), node };
            if let Some(pair) = self.answered(motor, frame, reply, time_us) {
                return pair;
            }
        }
        let (node, request) = request_to_one(frame)?;
        let motor = Motor { bus, protocol: request.protocol().name(), node };
        let waiting = self.waiting.entry(motor).or_default();
        waiting.retain(|before| time_us.saturating_sub(before.time_us) <= PATIENCE_US);
        waiting.push(Waiting { request, frame: frame.clone(), time_us });
        None
    }

    /// Whether it answers what waits; and then the pair, if there is only one such request.
    fn answered(
        &mut self,
        motor: Motor,
        frame: &RawFrame,
        reply: Reply,
        time_us: u64,
    ) -> Option<Option<Pair>> {
        let waiting = self.waiting.get_mut(&motor)?;
        waiting.retain(|before| time_us.saturating_sub(before.time_us) <= PATIENCE_US);
        let answers = |asked: &Waiting| {
            // On a serial line the same bytes may be the request once more.
            let is_repetition = matches!(frame, RawFrame::Serial(_)) && asked.frame == *frame;
            !is_repetition && asked.request.is_answered_by(motor.node, &reply)
        };
        let (mut fitting, others): (Vec<_>, Vec<_>) =
            std::mem::take(waiting).into_iter().partition(answers);
        *waiting = others;
        let first = fitting.pop()?;
        if !fitting.is_empty() {
            return Some(None);
        }
        let span_us = time_us.checked_sub(first.time_us);
        Some(span_us.map(|span_us| Pair { motor, command: first.request.name(), reply, span_us }))
    }
}
