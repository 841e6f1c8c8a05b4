//! Within what time a stop must have left the bus, and what follows where one has not (GUARANTEES
//! G4, G5).

use super::Bus;
use super::frame_bits::longest_frame_bits;
use super::load::{objections, streamed_permille};
use super::schedule::{EXCHANGE_FRAMES, MAX_OUTSTANDING};
use crate::axes::Axes;
use crate::axis::{Axis, Is, Stop};
use crate::outbox::Outbox;
use crate::protocol::{self, Info};
use crate::time::{Duration, Instant};
use core::num::NonZeroU64;
use host_protocol::{BusKind, CanId, Event, TripReason};
use serde::{Deserialize, Serialize};

/// [`MAX_OUTSTANDING`] as a divisor.
const OUTSTANDING: NonZeroU64 = NonZeroU64::new(MAX_OUTSTANDING as u64).unwrap();
/// What our software takes, g of the bounds.
pub(super) const SOFTWARE: Duration = Duration::from_micros(100);
/// What is allowed beyond the bound before a stop counts as delayed: error frames, and that the
/// port has to report the frame.
const ALLOWANCE: Duration = Duration::from_millis(1);
/// A stop that has not left so long after its bound counts as one that could not be sent
/// (GUARANTEES G4).
const NOT_SENT_AFTER: Duration = Duration::from_millis(100);

/// Requests of each axis behind which a frame that is no stop may have to leave: its own poll or
/// another motor's request, and where that falls silent two stops, and what overwrites a write that
/// may wait in it.
const REQUESTS_IN_FRONT: u64 = 4;

/// What the axes of a bus have it carry, and how long others wait for it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Bounds {
    /// Frames beyond the first with which motors answer one motion each.
    further_replies: u64,
    /// Requests outstanding at most, where replies to them win the arbitration against stops; else
    /// 0.
    pub outranking_replies: u64,
    /// A motor's reply may have the id of the next frame to it.
    pub shares_ids: bool,
    /// What the frames take that motors may send by themselves one behind the other.
    pub streamed_at_once: Duration,
    /// The share of the bus's time that these take.
    pub streamed_permille: u64,
    /// Within what time a frame that is no stop has left after it was due: behind
    /// [`REQUESTS_IN_FRONT`] of each axis.
    ordinary: Duration,
    /// How long a reply may take: the window, and on CAN a frame to each other motor and the reply to
    /// that, which may go before it.
    pub longest_reply: Duration,
    /// How long a motor waits for what it must hear, a reply of its own being lost: behind the
    /// requests of the others.
    feeding: Duration,
}

impl Bounds {
    /// These, beside frames of others that take such a part of the bus's time, one at once.
    pub fn beside_foreign(self, permille: u64, frame: Duration) -> Self {
        if permille == 0 {
            return self;
        }
        Self {
            streamed_at_once: self.streamed_at_once + frame,
            streamed_permille: self.streamed_permille + permille,
            ..self
        }
    }

    /// What takes so long on a bus to itself, beside the frames that motors here send by
    /// themselves: those that are due when it begins, and those that come due meanwhile.
    fn beside_streams(&self, alone: Duration) -> Duration {
        if self.streamed_at_once == Duration::ZERO {
            return alone;
        }
        let left = left_of(self.streamed_permille).unwrap_or(NonZeroU64::MIN);
        (alone + self.streamed_at_once).times(1_000).part(left)
    }
}

/// What is left of a bus's time beside such a part of it, permille, if anything is. Axes that take
/// all of it are refused when they are configured.
pub(super) fn left_of(taken_permille: u64) -> Option<NonZeroU64> {
    NonZeroU64::new(1_000_u64.saturating_sub(taken_permille))
}

impl Bus {
    /// Within what time the last of `stops` stops that began together has left, if nobody else
    /// talks.
    fn bound(&self, stops: u64, axes: &Axes) -> Duration {
        self.bound_beside(&self.bounds, stops, axes)
    }

    /// The same with these bounds of the bus.
    pub(super) fn bound_beside(&self, bounds: &Bounds, stops: u64, axes: &Axes) -> Duration {
        match self.kind() {
            // F(2k − 1 + m) until it starts, and one F more until it has left; it waits for a reply
            // that has its id, and may be behind another.
            BusKind::Can => {
                let replies = bounds.outranking_replies + bounds.further_replies;
                let frame = self.frame_time(1);
                let wait = if bounds.shares_ids {
                    self.line_times().stop_delay() + frame
                } else {
                    Duration::ZERO
                };
                // Behind each stop those motors have their say that answer what was for others, and
                // are waited for.
                let objections =
                    if self.which(Is::Objecting, axes).is_empty() { Duration::ZERO } else { wait };
                let alone =
                    SOFTWARE + wait + objections.times(stops) + frame.times(2 * stops + replies);
                bounds.beside_streams(alone)
            }
            BusKind::Rs485 => SOFTWARE + self.line_times().stop_bound(stops),
        }
    }

    /// When the first late reply counts as missed: none waits for a bus that has carried nothing for
    /// as long as a frame, or has had the time for all that goes before it.
    #[inline(never)]
    pub(super) fn misses_overdue_at(&self, axes: &Axes) -> Option<Instant> {
        let overdue = axes.of(self.which(Is::ReplyOverdue, axes));
        let since = overdue.filter_map(|axis| axis.transactions.overdue_since()).min()?;
        Some(self.is_quiet_at().min(since + self.bounds.longest_reply))
    }

    /// Whether a late reply here may wait for the bus: where hosts ask without end it would have no
    /// room beside anything but first stops.
    pub(super) fn has_overdue(&self, axes: &Axes) -> bool {
        !self.which(Is::ReplyOverdue, axes).is_empty()
    }

    fn is_quiet_at(&self) -> Instant {
        self.active_at + SOFTWARE + self.frame_time(1)
    }

    /// Gives up the late replies that do not wait for the bus.
    #[inline(never)]
    pub(super) fn expire_overdue(&mut self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        let is_quiet = self.is_quiet_at() <= now;
        let due_since = if is_quiet { now } else { now - self.bounds.longest_reply };
        axes.each(self.which(Is::ReplyOverdue, axes), |axis| {
            axis.miss_overdue(now, due_since, out);
        });
    }

    /// A frame with this id has come: late replies that would have gone before it do not wait for
    /// the bus.
    #[inline(never)]
    pub(super) fn miss_replies_before(
        &mut self,
        now: Instant,
        id: CanId,
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) {
        let goes_before =
            |axis: &Axis| protocol::reply_id(&axis.config).is_some_and(|reply| CanId(reply) < id);
        let missed = axes.those(self.which(Is::ReplyOverdue, axes), goes_before);
        axes.each(missed, |axis| axis.miss_overdue(now, now, out));
    }

    /// Works out what the axes here have the bus carry, and how long others wait for it.
    pub fn measure(&mut self, axes: &Axes) {
        self.longest_frame_bits = longest_frame_bits(self.axes_here(axes));
        let frame = self.frame_time(1);
        let mut bounds = Bounds::default();
        for protocol in self.config.iter().flat_map(|config| config.protocols.iter()) {
            let info = Info::of(protocol);
            bounds.shares_ids |= info.free_ids;
            if info.replies_outrank_stops {
                bounds.outranking_replies = MAX_OUTSTANDING as u64;
            }
        }
        for axis in self.axes_here(axes) {
            let replies = u64::from(protocol::replies_to_motion(&axis.config));
            bounds.further_replies += replies - 1 + objections(axis, self.axes_here(axes));
            let streamed = protocol::stream(&axis.config).map_or(0, |stream| stream.frames);
            bounds.streamed_at_once = bounds.streamed_at_once + frame.times(streamed);
            bounds.streamed_permille += streamed_permille(axis, frame);
        }
        self.bounds = bounds;
        let count: u64 = self.here(axes).len().into();
        let goes_before = match self.kind() {
            BusKind::Can => self.frame_time(EXCHANGE_FRAMES * count.saturating_sub(1)),
            BusKind::Rs485 => Duration::ZERO,
        };
        self.bounds.longest_reply = self.reply_window() + goes_before;
        self.bounds.ordinary = self.ordinary_bound(axes, REQUESTS_IN_FRONT * count);
        self.bounds.feeding = self.ordinary_bound(axes, 2 * count.saturating_sub(1));
    }

    /// Within what time a frame that is no stop has left after it was due, if nobody else talks:
    /// behind the stop of each axis here, behind so many requests, with what their replies may
    /// take, and behind the own one before: the window of its reply, and as long again where that
    /// may come late.
    fn ordinary_bound(&self, all: &Axes, requests: u64) -> Duration {
        let axes = self.here(all).len().into();
        let window = self.reply_window();
        let exchange = match self.kind() {
            // A request and its reply, and what a reply with its id may wait for; where so many may
            // be outstanding they share a window.
            BusKind::Can => {
                let share = match self.bounds.outranking_replies {
                    0 => Duration::ZERO,
                    _ => window.part(OUTSTANDING),
                };
                self.frame_time(3) + share
            }
            BusKind::Rs485 => self.line_times().frame.times(2) + self.line_times().gap + window,
        };
        let further = self.frame_time(2 * self.bounds.further_replies);
        self.bound(axes, all)
            + self.bounds.beside_streams(window.times(2) + exchange.times(requests) + further)
    }

    /// How long a motor here may wait for what it must hear; no time where nothing carries it.
    pub fn feeds_within(&self) -> Duration {
        if self.config.is_some() { self.bounds.feeding } else { Duration::ZERO }
    }

    /// Within what time a setpoint that is due must have left; at once where nothing carries it.
    pub(super) fn delivered_within(&self) -> Duration {
        if self.config.is_some() { self.bounds.ordinary } else { Duration::ZERO }
    }

    /// Trips the axes whose setpoint has not been sent in time, whatever kept it (GUARANTEES G2).
    pub fn expire_deliveries(&self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        let within = self.delivered_within();
        axes.each(self.which(Is::Late, axes), |axis| {
            if axis.delivery_due_at().is_some_and(|due| due + within <= now) {
                axis.trip(now, TripReason::NotDelivered, out);
            }
        });
    }

    /// The stops here of which no command has left and that have not been reported: whose, since
    /// when, and when they are due for it.
    fn delayed_stops<'a>(
        &'a self,
        axes: &'a Axes,
    ) -> impl Iterator<Item = (u8, Instant, Instant)> + 'a {
        // Most begin together, and are due together.
        let mut before = None;
        axes.of(self.which(Is::FirstStop, axes)).filter_map(move |axis| {
            let since = axis.stop()?.unreported_since()?;
            let due = before
                .filter(|(began, _)| *began == since)
                .map(|(_, due)| due)
                .unwrap_or_else(|| {
                    let beside =
                        |other: &&Axis| other.stop().is_some_and(|stop| stop.had_not_left(since));
                    let together = self.axes_here(axes).filter(beside).count();
                    since + self.bound(together as u64, axes) + ALLOWANCE
                });
            before = Some((since, due));
            Some((axis.index, since, due))
        })
    }

    /// The axes here whose stop does not leave, and when that counts as not sent. A bus that is not
    /// configured carries none, and has no bound. What follows a first command may have to take its
    /// turn, and has the bound of what is no stop.
    fn unsent_stops<'a>(&'a self, axes: &'a Axes) -> impl Iterator<Item = (usize, Instant)> + 'a {
        let stopping = self.which(Is::Stopping, axes);
        let bound = if self.config.is_some() {
            self.bound(stopping.len().into(), axes)
        } else {
            Duration::ZERO
        };
        let within = move |index: usize| match axes.get(index) {
            Some(axis) if axis.stop().is_some_and(Stop::has_left) => self.delivered_within(),
            _ => bound,
        };
        axes.times(stopping, |look| look.stop_unsent_since)
            .map(move |(index, since)| (index, since + within(index) + NOT_SENT_AFTER))
    }

    /// When the next stop counts as one that could not be sent.
    pub fn stop_is_unsent_at(&self, axes: &Axes) -> Option<Instant> {
        self.unsent_stops(axes).map(|(_, at)| at).min()
    }

    /// Tells the axes whose stop could not be sent; it stays owed.
    pub fn report_unsent_stops(&self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        let late = self.unsent_stops(axes).filter(|(_, at)| *at <= now);
        axes.each(late.map(|(index, _)| index).collect(), |axis| axis.stop_not_sent(now, out));
    }

    /// When the next stop that has not left is to be reported.
    pub(super) fn stop_is_delayed_at(&self, axes: &Axes) -> Option<Instant> {
        self.delayed_stops(axes).map(|(.., at)| at).min()
    }

    /// Reports the stops whose first frame has not left within their bound, each once: what acts
    /// now is the second layer.
    pub fn report_delayed_stops(&self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        loop {
            let late = self.delayed_stops(axes).find(|(.., at)| *at <= now);
            let Some((index, since, _)) = late else { return };
            let Some(axis) = axes.get_mut(usize::from(index)) else { return };
            axis.stop_reported();
            let waiting_us = now.since(since).as_micros_u32();
            out.event(&Event::StopDelayed { bus: self.index, axis: index, waiting_us });
        }
    }
}
