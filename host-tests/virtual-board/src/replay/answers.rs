//! Motors that answer as they have answered when it was recorded: the same reply, so long after its
//! request. A request that leaves a little earlier or later than it did, or in another order, finds
//! its own.

use gateway::Instant;
use host_protocol::{Bytes, CanFrame, RawFrame};
use mgw_cli::programs::{asks, may_answer};
use rigless::chip::Timeline;
use rigless::chip::can;
use rigless::chip::uart;
use rigless::snapshot::store;
use rigless::time::{EventId, VirtualNanos};
use virtual_stm32::serial_port::{FarEnd, Settings};

use crate::nodes::{from_bus, to_bus};
use crate::rs485_line::{BITS_PER_BYTE, Rs485Line};

/// A reply that comes so late answers nothing.
const PATIENCE_US: u64 = 100_000;
/// On a line that belongs to one request at a time.
const LINE_PATIENCE_US: u64 = 20_000;
/// Bytes of a D5 frame that tell what it asks: header, node, length and register (D5 manual, frame
/// format).
const D5_KIND: usize = 5;
/// A frame of a serial line ends with a pause of so many bits.
const PAUSE_BITS: u64 = 30;
/// The gateway is told of a byte so much later behind it than of the end of a frame of its own.
const NOTICED_PS: u64 = 15_000_000;
/// Behind the last piece it was waited for a byte that did not come (src/line.rs), bits.
const WAITED_BITS: u64 = 7;
pub const PICOS_PER_NANO: u64 = 1_000;
const PICOS_PER_MICRO: u64 = 1_000_000;
const NANOS_PER_MICRO: i64 = 1_000;

/// A request of the gateway, and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// When it had left, in the gateway's own time.
    left: Instant,
    request: RawFrame,
    reply: Option<Reply>,
}

/// A reply.
#[derive(Debug, Clone, PartialEq)]
struct Reply {
    frame: RawFrame,
    /// How long behind the request the gateway was told of it, µs; on a line of each piece, with the
    /// bytes up to its end.
    told: Vec<(u64, usize)>,
}

/// Whether two requests ask the same of the same motor.
fn is_same_kind(one: &RawFrame, other: &RawFrame) -> bool {
    let Some(asked) = asks(one) else { return one == other };
    asks(other) == Some(asked) && (asked.0 != "d5" || d5_kind(one) == d5_kind(other))
}

fn d5_kind(frame: &RawFrame) -> Option<&[u8]> {
    match frame {
        RawFrame::Can(frame) => frame.data().get(..D5_KIND),
        RawFrame::Serial(bytes) => bytes.get(..D5_KIND),
    }
}

/// The requests on a bus, in their order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Answers(Vec<Asked>);

impl Answers {
    /// A request has left.
    pub fn asked(&mut self, left: Instant, request: RawFrame) {
        self.0.push(Asked { left, request, reply: None });
    }

    /// A frame has come. Whether it answers a request.
    pub fn came(&mut self, told: Instant, frame: &RawFrame) -> bool {
        let recent = self.0.iter_mut().rev();
        let mut waiting = recent
            .take_while(|asked| told.as_micros() - asked.left.as_micros() <= PATIENCE_US)
            .filter(|asked| asked.reply.is_none() && may_answer(&asked.request, frame));
        let Some(asked) = waiting.next() else { return false };
        let behind = told.as_micros() - asked.left.as_micros();
        asked.reply = Some(Reply { frame: frame.clone(), told: vec![(behind, 0)] });
        true
    }

    /// Bytes have come on a serial line. Whether they belong to the reply to the last request.
    pub fn bytes_came(&mut self, told: Instant, bytes: &[u8]) -> bool {
        let Some(Asked { left, request, reply }) = self.0.last_mut() else { return false };
        let behind = told.as_micros() - left.as_micros();
        let whole = reply.as_ref().is_some_and(|reply| may_answer(request, &reply.frame));
        if whole || behind > LINE_PATIENCE_US {
            return false;
        }
        let nothing = || Reply { frame: RawFrame::Serial(Bytes::new()), told: Vec::new() };
        let Reply { frame, told } = reply.get_or_insert_with(nothing);
        let RawFrame::Serial(reply) = frame else { return false };
        let fits = reply.extend_from_slice(bytes).is_ok();
        told.push((behind, reply.len()));
        fits
    }

    /// The reply to a request that leaves now: that of the request of its kind that left at about
    /// that time.
    fn reply_to(&self, request: &RawFrame, now_us: i64) -> Option<&Reply> {
        let kind = self.0.iter().filter(|asked| is_same_kind(&asked.request, request));
        let away = |asked: &&Asked| now_us.abs_diff(asked.left.as_micros().cast_signed());
        kind.min_by_key(away)?.reply.as_ref()
    }
}

/// What the motors of a bus say, in the machine's time.
#[derive(Debug, Clone, Default)]
struct Script {
    answers: Answers,
    /// When the gateway's clock is at 0, ns of the machine's.
    zero_ns: i64,
}

impl Script {
    /// The reply to a request that has left now, and when it begins, `bit_ps` being what a bit takes:
    /// so late that the gateway can have been told of each piece when it was.
    fn reply_to(
        &self,
        request: &RawFrame,
        now: VirtualNanos,
        bit_ps: u64,
    ) -> Option<(VirtualNanos, &RawFrame)> {
        let now_us = (now.0.cast_signed() - self.zero_ns) / NANOS_PER_MICRO;
        let Reply { frame, told } = self.answers.reply_to(request, now_us)?;
        let begins = (1..).zip(told).map(|(piece, (behind, bytes))| {
            let lasts = match frame {
                RawFrame::Can(frame) => u64::from(to_bus(frame).bits_until_valid()) * bit_ps,
                RawFrame::Serial(_) => {
                    let waited = if piece == told.len() { WAITED_BITS } else { 0 };
                    (*bytes as u64 * BITS_PER_BYTE + waited) * bit_ps + NOTICED_PS
                }
            };
            (behind * PICOS_PER_MICRO).saturating_sub(lasts)
        });
        Some((VirtualNanos(now.0 + begins.min()? / PICOS_PER_NANO), frame))
    }
}

/// The motors of a CAN bus.
#[derive(Debug, Default)]
pub struct CanMotors {
    script: Script,
    /// What is to be sent, and from when on, the earliest first.
    waiting: Vec<(VirtualNanos, can::Frame)>,
    bit_ps: u64,
}

store!(CanMotors { values: [], parts: [], built: [script, waiting, bit_ps] });

impl CanMotors {
    /// Has them answer from now on. `zero_ns`: when the gateway's clock is at 0, of the machine's.
    pub fn answer(&mut self, answers: Answers, zero_ns: i64, bit_ps: u64) {
        self.script = Script { answers, zero_ns };
        self.bit_ps = bit_ps;
    }

    /// Sends a frame as soon as the bus is free after `since`.
    pub fn send(&mut self, since: VirtualNanos, frame: &CanFrame) {
        let at = self.waiting.partition_point(|(other, _)| *other <= since);
        self.waiting.insert(at, (since, to_bus(frame)));
    }
}

impl can::Peer for CanMotors {
    fn receive(&mut self, frame: &can::Frame, timeline: &mut Timeline<'_, '_>) {
        let Some(request) = from_bus(frame).map(RawFrame::Can) else { return };
        let found = self.script.reply_to(&request, timeline.now(), self.bit_ps);
        if let Some((since, RawFrame::Can(reply))) = found {
            let reply = *reply;
            self.send(since, &reply);
        }
    }

    fn offer(&self) -> Option<can::Offer> {
        let (since, frame) = *self.waiting.first()?;
        Some(can::Offer { since, frame, fault: None })
    }

    fn sent(&mut self, acknowledged: bool, _timeline: &mut Timeline<'_, '_>) {
        if acknowledged && !self.waiting.is_empty() {
            self.waiting.remove(0);
        }
    }
}

/// The motors of an RS485 line.
#[derive(Debug, Default)]
pub struct LineMotors {
    /// The line, without motors of its own.
    pub line: Rs485Line,
    script: Script,
    /// What the port has sent of a frame, and when the last byte had, ns.
    request: Vec<u8>,
    heard_ns: u64,
}

store!(LineMotors { values: [], parts: [line], built: [script, request, heard_ns] });

impl LineMotors {
    /// Has them answer from now on. `zero_ns`: when the gateway's clock is at 0, of the machine's.
    pub fn answer(&mut self, answers: Answers, zero_ns: i64) {
        self.script = Script { answers, zero_ns };
    }
}

impl uart::Peer for LineMotors {
    fn receive(&mut self, word: u16, timeline: &mut Timeline<'_, '_>) {
        self.line.receive(word, timeline);
        let now = timeline.now();
        let bit_ps = self.line.settings().bit_ps;
        if now.0.saturating_sub(self.heard_ns) * PICOS_PER_NANO > PAUSE_BITS * bit_ps {
            self.request.clear();
        }
        self.heard_ns = now.0;
        self.request.extend(word.to_le_bytes().first());
        let Ok(request) = Bytes::from_slice(&self.request) else { return };
        let request = RawFrame::Serial(request);
        if asks(&request).is_none() {
            return;
        }
        self.request.clear();
        if let Some((since, RawFrame::Serial(reply))) = self.script.reply_to(&request, now, bit_ps)
        {
            let reply = reply.to_vec();
            self.line.disturb_at(since, &reply, false, timeline);
        }
    }

    fn on_event(&mut self, event: EventId, timeline: &mut Timeline<'_, '_>) {
        self.line.on_event(event, timeline);
    }

    fn restarted(&mut self, timeline: &mut Timeline<'_, '_>) {
        self.line.restarted(timeline);
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        self.line.transmit(now)
    }
}

impl FarEnd for LineMotors {
    fn port_set_up(&mut self, settings: Settings) {
        self.line.port_set_up(settings);
    }

    fn damages(&mut self) -> bool {
        self.line.damages()
    }
}

#[cfg(test)]
#[path = "tests/answers.rs"]
mod tests;
