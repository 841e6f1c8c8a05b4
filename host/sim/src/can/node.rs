//! One station's controller on a CAN bus.

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::{BusMode, CanFrame};

use super::bits::{BUS_OFF_RECOVERY, FrameBits, priority};
use super::errors::ErrorCounters;
use crate::bus::{Station, bit_time};

/// Two stations understand each other when their bitrates differ by less than one part in this many
/// (0.5 %).
const BITRATE_TOLERANCE: u32 = 200;

/// Frames that a motor's controller holds; on a dead bus the oldest is lost.
const MOTOR_QUEUE: usize = 8;

/// A frame that waits in a controller.
#[derive(Debug, Clone)]
pub(super) struct Pending {
    pub(super) slot: u8,
    pub(super) frame: CanFrame,
    pub(super) bits: FrameBits,
    pub(super) corrupt: bool,
    /// Asked back: it is not sent again.
    pub(super) cancelled: bool,
}

#[derive(Debug, Clone)]
pub(super) struct Node {
    pub(super) station: Station,
    pub(super) bitrate: u32,
    pub(super) plugged: bool,
    pub(super) mode: BusMode,
    pub(super) queue: VecDeque<Pending>,
    pub(super) counters: ErrorCounters,
    /// Earliest start of its next frame.
    pub(super) not_before: Duration,
    /// The frame on its way.
    pub(super) sending: Option<Pending>,
    /// Bus-off, and waiting to take part again.
    recovering: bool,
    /// When it does, if the line stays quiet.
    pub(super) back_at: Option<Duration>,
}

impl Node {
    pub(super) fn new(station: Station) -> Self {
        Self {
            station,
            bitrate: 0,
            plugged: true,
            mode: BusMode::Normal,
            queue: VecDeque::new(),
            counters: ErrorCounters::default(),
            not_before: Duration::ZERO,
            sending: None,
            recovering: false,
            back_at: None,
        }
    }

    pub(super) fn understands(&self, bitrate: u32) -> bool {
        self.bitrate.abs_diff(bitrate).saturating_mul(BITRATE_TOLERANCE) < bitrate
    }

    /// Whether it acknowledges frames, and destroys those that it cannot read.
    pub(super) fn takes_part(&self) -> bool {
        self.plugged && self.mode != BusMode::ListenOnly && !self.counters.is_bus_off()
    }

    pub(super) fn enqueue(&mut self, pending: Pending) {
        if self.station != Station::Gateway && self.queue.len() == MOTOR_QUEUE {
            self.queue.pop_front();
        }
        self.queue.push_back(pending);
    }

    /// What it sends next: the gateway's controller its frame of highest priority, a motor its
    /// oldest.
    pub(super) fn next_frame(&self) -> Option<&Pending> {
        self.queue.get(self.next_index()?)
    }

    /// Puts the next frame on its way.
    pub(super) fn begin(&mut self) {
        self.sending = self.next_index().and_then(|at| self.queue.remove(at));
    }

    /// The frame on its way has failed and waits for another attempt, unless it was asked back:
    /// then its slot is returned.
    pub(super) fn retry(&mut self) -> Option<u8> {
        let pending = self.sending.take()?;
        if pending.cancelled || self.mode == BusMode::OneShot {
            return Some(pending.slot);
        }
        self.queue.push_front(pending);
        None
    }

    /// Gives a frame back: at once, or when its attempt on the wire fails. Whether it is back now.
    pub(super) fn cancel(&mut self, slot: u8) -> bool {
        if let Some(at) = self.queue.iter().position(|pending| pending.slot == slot) {
            self.queue.remove(at);
            return true;
        }
        if let Some(sending) = self.sending.as_mut().filter(|pending| pending.slot == slot) {
            sending.cancelled = true;
        }
        false
    }

    /// Drops every frame it holds.
    pub(super) fn drop_frames(&mut self) {
        self.queue.clear();
        self.sending = None;
    }

    /// Bus-off: begins to wait for the line to be recessive long enough, for ever while it is
    /// shorted.
    pub(super) fn recover(&mut self, now: Duration, short: bool) {
        self.recovering = true;
        self.restart_wait(now, short);
    }

    /// The line has changed: one that waits begins again.
    pub(super) fn restart_wait(&mut self, now: Duration, short: bool) {
        let quiet = self.recovering && !short;
        self.back_at = quiet.then(|| now + bit_time(BUS_OFF_RECOVERY, self.bitrate));
    }

    /// Takes part again if its wait is over.
    pub(super) fn come_back(&mut self, now: Duration) -> bool {
        let back = self.back_at.take_if(|at| *at <= now).is_some();
        if back {
            self.recovering = false;
            self.counters = ErrorCounters::default();
        }
        back
    }

    fn next_index(&self) -> Option<usize> {
        let precedence =
            |at: &usize| self.queue.get(*at).map_or(u32::MAX, |held| priority(&held.frame));
        match self.station {
            Station::Gateway => (0..self.queue.len()).min_by_key(precedence),
            Station::Motor(_) | Station::Stranger => (!self.queue.is_empty()).then_some(0),
        }
    }
}
