//! Requests and their replies among the frames of a bus, as the codecs match them.

use std::collections::BTreeMap;

use host_protocol::RawFrame;

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

/// A request of any protocol.
#[derive(Debug, Clone, PartialEq)]
enum Request {
    Rmd(rmd::Request),
    Thruster(thruster::Request),
    D5(d5::Request),
}

/// A reply of any protocol.
#[derive(Debug, Clone, PartialEq)]
pub enum Reply {
    /// Of an RMD motor.
    Rmd(rmd::Reply),
    /// Of a thruster.
    Thruster(thruster::Reply),
    /// Of a D5 motor.
    D5(d5::Reply),
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
            let motor = Motor { bus, protocol: reply.protocol(), node };
            if let Some(pair) = self.answered(motor, frame, reply, time_us) {
                return pair;
            }
        }
        let (node, request) = request(frame)?;
        let motor = Motor { bus, protocol: request.protocol(), node };
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

/// What a frame asks of whom, whatever values come with it: protocol, id and command. `None` where no
/// codec knows it as a request.
pub fn asks(frame: &RawFrame) -> Option<(&'static str, u8, &'static str)> {
    request(frame).map(|(node, request)| (request.protocol(), node, request.name()))
}

/// Whether one frame may be the reply to another, as the codecs match them.
pub fn may_answer(asked: &RawFrame, came: &RawFrame) -> bool {
    let Some((node, request)) = request(asked) else { return false };
    replies(came).iter().any(|(from, reply)| *from == node && request.is_answered_by(node, reply))
}

impl Request {
    fn protocol(&self) -> &'static str {
        match self {
            Self::Rmd(_) => "rmd",
            Self::Thruster(_) => "thruster",
            Self::D5(_) => "d5",
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Rmd(request) => request.name(),
            Self::Thruster(request) => request.name(),
            Self::D5(request) => request.name(),
        }
    }

    fn is_answered_by(&self, node: u8, reply: &Reply) -> bool {
        match (self, reply) {
            (Self::Rmd(request), Reply::Rmd(reply)) => {
                matches!(rmd::answer(request, reply), rmd::Answer::Reply(_))
            }
            (Self::Thruster(request), Reply::Thruster(reply)) => {
                matches!(thruster::answer(request, reply), thruster::Answer::Reply(_))
            }
            (Self::D5(request), Reply::D5(reply)) => {
                let Ok(node) = d5::Node::new(node) else { return false };
                matches!(d5::answer(request, node, node, reply), d5::Answer::Reply(_))
            }
            _ => false,
        }
    }
}

impl Reply {
    fn protocol(&self) -> &'static str {
        match self {
            Self::Rmd(_) => "rmd",
            Self::Thruster(_) => "thruster",
            Self::D5(_) => "d5",
        }
    }
}

/// What a frame may be as a reply, and of which motor.
fn replies(frame: &RawFrame) -> Vec<(u8, Reply)> {
    let (rmd, thruster, d5) = match frame {
        RawFrame::Can(frame) => (
            rmd::can::decode_reply(frame).ok(),
            thruster::can::decode_reply(frame).ok(),
            d5::can::decode_reply(frame).ok(),
        ),
        RawFrame::Serial(bytes) => (
            rmd_serial(bytes).and_then(|frame| rmd::rs485::decode_reply(frame).ok()),
            None,
            d5_serial(bytes).and_then(|frame| d5::decode_reply_frame(frame).ok()),
        ),
    };
    let rmd = rmd.map(|(node, reply)| (node.get(), Reply::Rmd(reply)));
    let thruster = thruster.map(|(node, reply)| (node.get(), Reply::Thruster(reply)));
    let d5 = d5.map(|(node, reply)| (node.get(), Reply::D5(reply)));
    rmd.into_iter().chain(thruster).chain(d5).collect()
}

/// What a frame asks of one motor.
fn request(frame: &RawFrame) -> Option<(u8, Request)> {
    let (rmd, thruster, d5) = match frame {
        RawFrame::Can(frame) => (
            rmd::can::decode_request(frame).ok(),
            thruster::can::decode_request(frame).ok(),
            d5::can::decode_request(frame).ok(),
        ),
        RawFrame::Serial(bytes) => (
            rmd_serial(bytes).and_then(|frame| rmd::rs485::decode_request(frame).ok()),
            None,
            d5_serial(bytes).and_then(|frame| d5::decode_request_frame(frame).ok()),
        ),
    };
    let of_d5 = |(address, request): (d5::Address, d5::Request)| match address {
        d5::Address::Node(node) => Some((node.get(), Request::D5(request))),
        _ => None,
    };
    rmd.map(|(node, request)| (node.get(), Request::Rmd(request)))
        .or_else(|| thruster.map(|(node, request)| (node.get(), Request::Thruster(request))))
        .or_else(|| d5.and_then(of_d5))
}

fn rmd_serial(bytes: &[u8]) -> Option<&[u8; rmd::rs485::FRAME_LEN]> {
    bytes.try_into().ok()
}

fn d5_serial(bytes: &[u8]) -> Option<&[u8; d5::FRAME_LEN]> {
    bytes.try_into().ok()
}
