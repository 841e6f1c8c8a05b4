//! One bus: what its controller holds, and the time that the gateway is not to blame for.

mod tally;

pub(crate) use tally::{ACKNOWLEDGE_FRAMES, ACKNOWLEDGE_US, Tally};

use crate::can_id::is_extended;
use crate::checks::Started;
use crate::motor::Protocol;
use crate::wire::BusSetting;
use std::collections::VecDeque;

/// What a bus is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusKind {
    /// CAN with standard frames.
    Can,
    /// A half-duplex serial line.
    Rs485 {
        /// The gateway hears itself.
        echo: bool,
    },
}

/// A frame that the gateway has handed over and that has neither left nor come back.
#[derive(Debug, Clone)]
pub(crate) struct Held {
    pub slot: u8,
    pub handed_us: u64,
    pub axis: Option<u8>,
    pub data: Vec<u8>,
    pub is_motion: bool,
    pub is_stop: bool,
    /// A later step of a stop: it goes where stops go.
    pub is_step: bool,
    /// The port of a serial line keeps it until a reply has come, which may until then.
    pub waits_until: Option<u64>,
    pub asked_back: bool,
    /// When it was.
    pub asked_back_us: Option<u64>,
    /// A raw frame of a host.
    pub is_raw: bool,
    /// And that of an access for everything.
    pub is_unsafe: bool,
    /// Its id on CAN.
    pub id: Option<u32>,
    /// It moves or changes its motor.
    pub is_harmful: bool,
    /// The setpoint, be it zero.
    pub is_setpoint: bool,
    /// A speed that is to wait for a start.
    pub prepares: bool,
    /// It starts several motors.
    pub start: Option<Started>,
    /// Its axis was moved to another motor since.
    pub is_left_behind: bool,
    /// From then on it counts as not acknowledged.
    pub acknowledged_by: u64,
    /// When it was counted as such.
    pub missed_us: Option<u64>,
}

/// One bus.
#[derive(Debug, Clone)]
pub(crate) struct Bus {
    pub kind: BusKind,
    /// 0 while it is not configured.
    pub bitrate: u32,
    pub exclusive: bool,
    /// Bits 0 to 2: RMD, thruster, D5 (PROTOCOL.md, `ProtocolSet`).
    pub protocols: u8,
    pub window_us: u64,
    /// An axis has ids of 29 bits.
    pub has_extended: bool,
    /// Others have sent frames with such ids, or raw ones were sent.
    pub saw_extended: bool,
    pub held: Vec<Held>,
    /// Since when the controller cannot send at all.
    pub off_since: Option<u64>,
    /// Until when its cable is cut: nothing is acknowledged, and nothing comes in.
    cut_until: u64,
    /// Time so far that the controller was off, the cable cut, or a frame not given back that was
    /// asked for.
    dead_us: u64,
    /// Up to when the cut is in it.
    cut_counted_us: u64,
    pub raw_open: bool,
    /// When it was closed last.
    pub raw_closed_us: Option<u64>,
    /// Raw frames that were accepted and not yet handed over.
    pub raw: VecDeque<(Option<u32>, Vec<u8>)>,
    /// For everything: no axis is configured there.
    pub raw_unsafe: bool,
    /// It was opened at this instant.
    pub raw_opened_us: Option<u64>,
    /// The latest bytes of ours on a serial line.
    pub line: Vec<u8>,
    /// Time so far that frames waited for others, or the bus was off.
    outside_us: u64,
    /// When the frame that is first in the controller could begin.
    first_since_us: u64,
    /// Our own bytes that have not come back yet.
    pub echo: VecDeque<u8>,
    /// What has been heard of a serial frame.
    pub heard: Vec<u8>,
    pub tally: Tally,
    /// It has gone off at this instant.
    pub off_noticed_us: Option<u64>,
    /// When the latest frame left.
    pub left_us: Option<u64>,
    /// Until when the frame had to be acknowledged that was given back last.
    pub carried_us: Option<u64>,
}

/// Longest stuffed standard frame with intermission, bits (G5).
const FRAME_BITS: u64 = 135;
/// What an id of 29 bits adds: 18 of it, SRR, r1, and five stuff bits.
const EXTENSION_BITS: u64 = 25;
/// A standard frame without data; each byte adds eight bits and two stuff bits.
const SHORTEST_FRAME_BITS: u64 = 55;
/// A byte on RS485 with start and stop bit, bits (G5).
const BYTE_BITS: u64 = 10;
/// The bit of D5 in a set of protocols.
pub(crate) const D5: u8 = 0b100;
/// Idle time before a serial frame, bits (G5).
const GAP_BITS: u64 = 20;
/// What of a reply window delays a stop, at most (G5).
const WINDOW_DELAY_US: u64 = 1_000;
/// Requests outstanding on a bus with thrusters, at most (m of G5).
const MAX_OUTSTANDING: u64 = 4;
/// g of G5: the gateway's software.
pub(crate) const SOFTWARE_US: u64 = 100;

impl Bus {
    pub fn new(kind: BusKind) -> Self {
        Self {
            kind,
            bitrate: 0,
            exclusive: false,
            protocols: 0,
            window_us: 0,
            held: Vec::new(),
            off_since: None,
            cut_until: 0,
            dead_us: 0,
            cut_counted_us: 0,
            raw_open: false,
            raw_closed_us: None,
            raw: VecDeque::new(),
            raw_unsafe: false,
            raw_opened_us: None,
            line: Vec::new(),
            outside_us: 0,
            first_since_us: 0,
            echo: VecDeque::new(),
            heard: Vec::new(),
            tally: Tally::default(),
            off_noticed_us: None,
            left_us: None,
            carried_us: None,
            has_extended: false,
            saw_extended: false,
        }
    }

    pub fn is_can(&self) -> bool {
        self.kind == BusKind::Can
    }

    fn bits_us(&self, bits: u64) -> u64 {
        (bits * 1_000_000).div_ceil(u64::from(self.bitrate.max(1)))
    }

    /// So many of the longest frames of CAN.
    fn can_frames_us(&self, frames: u64) -> u64 {
        self.own_frame_us() * frames
    }

    /// F or C of G5, by the ids of the axes here.
    pub fn own_frame_us(&self) -> u64 {
        self.longest_us(self.has_extended)
    }

    /// F or C of G5. Allowance: once a frame of 29 bits has been seen that is no axis's, each may
    /// be one.
    pub fn frame_us(&self) -> u64 {
        self.longest_us(self.has_extended || self.saw_extended)
    }

    fn longest_us(&self, extended: bool) -> u64 {
        let extension = if extended { EXTENSION_BITS } else { 0 };
        let serial = BYTE_BITS * self.spoken().serial_len() as u64;
        self.bits_us(if self.is_can() { FRAME_BITS + extension } else { serial })
    }

    /// What a serial line speaks.
    pub fn spoken(&self) -> Protocol {
        if self.protocols & D5 != 0 { Protocol::D5 } else { Protocol::Rmd }
    }

    /// Within how long of the gateway's own time the k-th stop has left: the bound of G5, which
    /// says when it starts, and the frame itself. Foreign frames (I of G5) are time of others.
    /// m, the replies that go before a thruster's stop, is in it; allowance: the replies
    /// themselves are time of others too, what goes in their place is another axis's second stop.
    pub fn stop_bound_us(&self, k: u64, protocol: Option<Protocol>, axes: u64) -> u64 {
        let frame = self.frame_us();
        if self.is_can() {
            let further = match protocol {
                // Its id is one that replies and other stops go before.
                Some(Protocol::Thruster) => MAX_OUTSTANDING * frame,
                // Requests and replies have one id: two that are sent together destroy each other.
                // Allowance: its stop waits for a reply that is due, as on RS485,
                // and that for what each of the `axes` on the bus has on its way: a stop, the
                // reply to it, and one that was due before. A stop that has met a reply is taken
                // back after three frames and waits once more.
                Some(Protocol::D5) => {
                    let wait = self.window_us.min(WINDOW_DELAY_US) + 3 * frame * axes;
                    frame + 2 * wait + 3 * frame
                }
                Some(Protocol::Rmd) | None => 0,
            };
            return SOFTWARE_US + frame * (2 * k - 1) + further + frame;
        }
        let exchange = 2 * frame + self.window_us.min(WINDOW_DELAY_US);
        SOFTWARE_US
            + exchange
            + self.bits_us(GAP_BITS)
            + (k - 1) * (exchange + self.bits_us(GAP_BITS))
            + frame
    }

    /// Time up to `at` that the gateway's bounds do not count for whoever has been outranked on CAN
    /// for so long.
    pub fn not_ours_us(&self, at: u64, outranked_us: u64) -> u64 {
        if !self.is_can() {
            return self.outside_us(at);
        }
        let off = self.off_since.map_or(0, |since| at.saturating_sub(since));
        let cut = self.cut_us(at);
        let kept = self.held.iter().filter_map(|held| held.asked_back_us);
        let stuck: u64 = kept.map(|asked| self.stuck_us(asked, at)).sum();
        self.dead_us + off + cut + stuck + outranked_us
    }

    /// How long the controller has kept a frame that it was to give back: that takes it no longer
    /// than what is on the wire.
    fn stuck_us(&self, asked_us: u64, at: u64) -> u64 {
        at.saturating_sub(asked_us + self.frame_us())
    }

    fn cut_us(&self, at: u64) -> u64 {
        at.min(self.cut_until).saturating_sub(self.cut_counted_us)
    }

    /// As it is configured.
    pub fn setting(&self) -> BusSetting {
        let Self { bitrate, protocols, exclusive, .. } = *self;
        let reply_window_us = u32::try_from(self.window_us).unwrap_or(u32::MAX);
        BusSetting { bitrate, protocols, exclusive, reply_window_us }
    }

    /// The gateway has lost its power: nothing is left but a cable that is cut.
    pub fn lose_power(&mut self) {
        *self = Self { cut_until: self.cut_until, ..Self::new(self.kind) };
    }

    /// The cable is cut until a time. What was on the wire was sent for nothing.
    pub fn cut(&mut self, now: u64, until: u64) {
        self.dead_us += self.cut_us(now) + self.frame_us();
        self.cut_counted_us = now;
        self.cut_until = until;
    }

    /// How long a foreign frame with this id and so many bytes of data is on the wire at most.
    pub fn foreign_us(&self, id: u32, data: usize) -> u64 {
        let extension = if is_extended(id) { EXTENSION_BITS } else { 0 };
        self.bits_us(SHORTEST_FRAME_BITS + extension + 10 * u64::try_from(data).unwrap_or(0))
    }

    /// Time of others up to `at`: what the gateway's bounds do not count on a serial line, and
    /// silence of a motor on any.
    pub fn outside_us(&self, at: u64) -> u64 {
        let waits = match (self.off_since, self.may_begin()) {
            (Some(since), _) => at.saturating_sub(since),
            (None, true) => at.saturating_sub(self.first_since_us + self.frame_us()),
            (None, false) => 0,
        };
        self.outside_us + waits
    }

    pub fn hand(&mut self, now: u64, held: Held) {
        if !self.may_begin() {
            self.first_since_us = now;
        }
        self.held.push(held);
    }

    /// Whether the controller holds a frame that waits for nothing but the bus.
    fn may_begin(&self) -> bool {
        self.held.iter().any(|held| held.waits_until.is_none())
    }

    /// A serial line carries these bytes of ours now.
    pub fn carries(&mut self, bytes: &[u8]) {
        if (self.kind == BusKind::Rs485 { echo: true }) {
            self.echo = bytes.iter().copied().collect();
        }
        self.heard.clear();
    }

    /// The reply has come that a frame waits for.
    pub fn begins(&mut self, now: u64) {
        let pause = self.bits_us(GAP_BITS);
        for held in &mut self.held {
            if let Some(until) = held.waits_until.take() {
                held.acknowledged_by -= until.saturating_sub(now + pause);
                self.first_since_us = now;
            }
        }
    }

    /// Takes the frame in `slot` out: it has left, or it has come back.
    pub fn take(&mut self, now: u64, slot: u8) -> Option<Held> {
        let index = self.held.iter().position(|held| held.slot == slot)?;
        self.outside_us = self.outside_us(now);
        self.first_since_us = now;
        if let Some(since) = &mut self.off_since {
            self.dead_us += now.saturating_sub(*since);
            *since = now;
        }
        let taken = self.held.remove(index);
        self.dead_us += taken.asked_back_us.map_or(0, |asked| self.stuck_us(asked, now));
        Some(taken)
    }

    /// Takes a frame out that was not sent: the time of the attempt was for nothing.
    pub fn lose(&mut self, now: u64, slot: u8) -> Option<Held> {
        let attempt = now.saturating_sub(self.first_since_us).min(self.frame_us());
        let lost = self.take(now, slot)?;
        self.outside_us += attempt;
        Some(lost)
    }

    /// The controller can no longer send, or can again.
    pub fn set_off(&mut self, now: u64, off: bool) {
        self.outside_us = self.outside_us(now);
        self.first_since_us = now;
        self.dead_us += self.off_since.map_or(0, |since| now.saturating_sub(since));
        self.off_since = off.then_some(now);
    }

    /// Nothing raw may leave any more.
    pub fn close_raw(&mut self, now: u64) {
        self.raw_open = false;
        self.raw_closed_us = Some(now);
        self.raw.clear();
    }

    /// What a reset leaves of it: the configuration.
    pub fn restarted(&mut self, now: u64) {
        self.set_off(now, false);
        self.held.clear();
        self.close_raw(now);
        self.echo.clear();
        self.heard.clear();
        self.tally = Tally::default();
        self.carried_us = None;
    }

    /// Bytes of others on a serial line: the gateway waits until they are over.
    pub fn disturbed(&mut self, bytes: usize) {
        let bits = 10 * u64::try_from(bytes).unwrap_or(u64::MAX) + GAP_BITS;
        self.outside_us += self.bits_us(bits);
    }
}
