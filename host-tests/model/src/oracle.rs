//! The oracle: what it is told, and what it is asked.

use crate::axis::{Axis, Cause, Duty, Place};
use crate::bus::{Bus, BusKind, Held};
use crate::checks::{History, Stored, Unlisted};
use crate::link::Link;
use crate::violation::{Check, Violation};
use crate::wire::{Request, Told};
use std::collections::BTreeSet;

/// A frame on a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame<'a> {
    /// A CAN frame: its id, with bit 31 for 29 bits and bit 30 for a remote frame, and its data.
    Can(u32, &'a [u8]),
    /// Bytes on a serial line.
    Serial(&'a [u8]),
}

impl Frame<'_> {
    pub(crate) fn text(&self) -> String {
        let (mut text, bytes) = match self {
            Self::Can(id, data) => (format!("{id:03X}#"), data),
            Self::Serial(bytes) => (String::new(), bytes),
        };
        bytes.iter().for_each(|byte| text += &format!("{byte:02X}"));
        text
    }
}

/// What a host may be silent for if it has set nothing else, µs (PROTOCOL.md, Gateway parameters).
pub(crate) const LINK_SILENCE_US: u64 = 250_000;

/// The model.
#[derive(Debug, Clone)]
pub struct Oracle {
    pub(crate) axes: Vec<Axis>,
    pub(crate) buses: Vec<Bus>,
    /// Epochs that were given, with their axes.
    pub(crate) epochs: BTreeSet<(u8, u32)>,
    pub(crate) links: Vec<Link>,
    /// The link whose host reads everything at once: its events are the news.
    pub(crate) listener: u8,
    /// The link in command, and when it was last heard.
    pub(crate) holder: Option<(u8, u64)>,
    pub(crate) silence_us: u64,
    pub(crate) e_stopped: bool,
    /// The e-stop input is open: pressed, or its cable cut.
    pub(crate) e_stop_open: bool,
    /// When a host asked for the e-stop last, or the input opened.
    pub(crate) e_stop_asked_us: Option<u64>,
    /// Starts since power came on.
    pub(crate) starts: u32,
    pub(crate) history: History,
    pub(crate) stored: Stored,
    /// Since the start nobody has been told how the axes are.
    pub(crate) unlisted: Option<Unlisted>,
    pub(crate) violations: Vec<Violation>,
    pub(crate) motions: u64,
    /// Starts of several motors.
    pub(crate) started: u64,
}

impl Oracle {
    /// The model of a gateway with these buses, and so many links and axes, of which nothing is
    /// configured. One host is listening.
    #[must_use]
    pub fn new(buses: &[BusKind], links: usize, listener: u8, axes: usize) -> Self {
        Self {
            axes: (0..axes).map(|_| Axis::default()).collect(),
            buses: buses.iter().map(|kind| Bus::new(*kind)).collect(),
            epochs: BTreeSet::new(),
            links: (0..links).map(|_| Link::default()).collect(),
            listener,
            holder: None,
            silence_us: LINK_SILENCE_US,
            e_stopped: false,
            e_stop_open: false,
            e_stop_asked_us: None,
            starts: 1,
            history: History::new(),
            stored: Stored::default(),
            unlisted: None,
            violations: Vec::new(),
            motions: 0,
            started: 0,
        }
    }

    /// Promises that were broken, in their order.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// Motion frames that were handed over so far.
    #[must_use]
    pub fn motions(&self) -> u64 {
        self.motions
    }

    /// Frames that have set several motors in motion.
    #[must_use]
    pub fn started_together(&self) -> u64 {
        self.started
    }

    /// Whether some axis is armed, active or stopping.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.axes.iter().any(Axis::is_busy)
    }

    /// Whether the e-stop was asked for at this instant.
    #[must_use]
    pub fn latches(&self, now: u64) -> bool {
        self.e_stopped && self.e_stop_asked_us == Some(now)
    }

    /// The state of an axis, as the gateway told it last.
    #[must_use]
    pub fn told(&self, axis: u8) -> Told {
        self.axes.get(usize::from(axis)).map_or(Told::Unconfigured, |axis| axis.told)
    }

    /// The epoch of an armed axis, as the gateway told it.
    #[must_use]
    pub fn epoch(&self, axis: u8) -> Option<u32> {
        self.axes.get(usize::from(axis)).and_then(|axis| axis.epoch)
    }

    /// Whether the axis owes a stop that its motor has not confirmed.
    #[must_use]
    pub fn owes_stop(&self, axis: u8) -> bool {
        let duty = self.axes.get(usize::from(axis)).and_then(|axis| axis.duty.as_ref());
        duty.is_some_and(|duty| !duty.confirmed)
    }

    /// Whether a controller holds a frame for an axis.
    #[must_use]
    pub fn is_held(&self, axis: u8) -> bool {
        self.buses.iter().flat_map(|bus| &bus.held).any(|held| held.axis == Some(axis))
    }

    /// Stop frames of an axis that have left since its stop became due.
    #[must_use]
    pub fn stops_left(&self, axis: u8) -> u32 {
        self.axes
            .get(usize::from(axis))
            .and_then(|axis| axis.duty.as_ref())
            .map_or(0, |duty| duty.left)
    }

    /// Results that a link owes its host.
    #[must_use]
    pub fn owed(&self, link: u8) -> usize {
        let records = self.links.get(usize::from(link)).map(|link| &link.records);
        records.map_or(0, |records| records.iter().filter(|record| record.result.is_none()).count())
    }

    /// Where an axis is configured to find its motor, and what to expect there.
    #[must_use]
    pub fn place(&self, axis: u8) -> Place {
        let Some(axis) = self.axes.get(usize::from(axis)) else { return Place::default() };
        let bus = axis.bus().and_then(|bus| self.buses.get(bus));
        Place { window_us: bus.map_or(0, |bus| bus.window_us), ..axis.place() }
    }

    /// How many axes are on a bus.
    pub(crate) fn axes_on(&self, bus: usize) -> u64 {
        self.axes.iter().filter(|axis| axis.bus() == Some(bus)).map(|_| 1).sum()
    }

    pub(crate) fn broken(&mut self, check: Check, at_us: u64, seen: String) {
        #[cfg(test)]
        crate::tests::BROKEN.with_borrow_mut(|broken| broken.push(check));
        self.violations.push(Violation { check, at_us, seen });
    }

    /// A port of a bus has handed a frame to its controller.
    pub fn handed(&mut self, now: u64, bus: u8, slot: u8, frame: Frame<'_>) {
        self.hand(now, bus, slot, frame, false);
        if let (Frame::Serial(bytes), Some(state)) = (frame, self.buses.get_mut(usize::from(bus))) {
            state.carries(bytes);
        }
    }

    /// The port of a serial line has taken a frame that it keeps until the reply to the one before
    /// has come.
    pub fn handed_behind_reply(&mut self, now: u64, bus: u8, slot: u8, frame: Frame<'_>) {
        self.hand(now, bus, slot, frame, true);
    }

    fn hand(&mut self, now: u64, bus: u8, slot: u8, frame: Frame<'_>, waits: bool) {
        self.advance(now);
        let Some(state) = self.buses.get(usize::from(bus)) else { return };
        if state.held.iter().any(|held| held.slot == slot) {
            self.broken(
                Check::StopNotFirst,
                now,
                format!("slot {slot} of bus {bus} is handed over twice"),
            );
        }
        let mut held = self.judge(now, bus, slot, frame);
        let moved =
            held.axis.filter(|_| held.is_motion).and_then(|axis| self.axes.get(usize::from(axis)));
        let motion_within = moved.map(Axis::ttl_us);
        let state = &mut self.buses[usize::from(bus)];
        let replied_by = state.left_us.map_or(now, |left| left + state.window_us);
        held.waits_until = waits.then_some(replied_by);
        held.acknowledged_by =
            state.acknowledged_by(held.waits_until.unwrap_or(now), motion_within);
        state.hand(now, held);
    }

    /// That reply has come: the line carries these bytes next.
    pub fn begins(&mut self, now: u64, bus: u8, bytes: &[u8]) {
        self.advance(now);
        if let Some(state) = self.buses.get_mut(usize::from(bus)) {
            state.begins(now);
            state.carries(bytes);
        }
    }

    /// The gateway wants the frame in a slot back.
    pub fn asked_back(&mut self, now: u64, bus: u8, slot: u8) {
        self.advance(now);
        let held = self
            .buses
            .get_mut(usize::from(bus))
            .and_then(|b| b.held.iter_mut().find(|h| h.slot == slot));
        if let Some(held) = held {
            held.asked_back = true;
            held.asked_back_us.get_or_insert(now);
        }
    }

    /// The frame in a slot has left.
    pub fn left(&mut self, now: u64, bus: u8, slot: u8) {
        self.advance(now);
        let Some(state) = self.buses.get_mut(usize::from(bus)) else { return };
        let Some(held) = state.take(now, slot) else { return };
        state.tally.sent += 1;
        state.left_us = Some(now);
        state.carried_us = None;
        self.outrank_stops(now, usize::from(bus), &held);
        self.count_left(now, usize::from(bus), held);
    }

    /// The controller has given the frame in a slot back, as it was asked: it has not left and will
    /// not.
    pub fn withdrawn(&mut self, now: u64, bus: u8, slot: u8) {
        self.advance(now);
        let Some(state) = self.buses.get_mut(usize::from(bus)) else { return };
        let Some(held) = state.lose(now, slot) else { return };
        state.tally.cancelled += 1;
        if held.missed_us.is_none() {
            let carried = state.carried_us.unwrap_or(held.acknowledged_by);
            state.carried_us = Some(carried.min(held.acknowledged_by));
        }
        self.may_be_sent_after_all(held);
    }

    /// The controller has dropped the frame in a slot: it went off, or was started again.
    pub fn dropped(&mut self, now: u64, bus: u8, slot: u8) {
        self.advance(now);
        let Some(state) = self.buses.get_mut(usize::from(bus)) else { return };
        let Some(held) = state.lose(now, slot) else { return };
        if held.missed_us == Some(now) {
            state.tally.missed -= 1;
            state.tally.missed_or_not += 1;
        }
        state.carried_us = None;
        self.may_be_sent_after_all(held);
    }

    /// A port has lost so many frames that came in.
    pub fn overflow(&mut self, bus: u8, lost: u32) {
        if let Some(state) = self.buses.get_mut(usize::from(bus)) {
            state.tally.overflows += lost;
        }
    }

    fn may_be_sent_after_all(&mut self, held: Held) {
        let Held { axis: Some(axis), data, is_motion: true, .. } = held else { return };
        let permits = &mut self.axes[usize::from(axis)].permits;
        permits.iter_mut().filter(|p| p.data.as_ref() == Some(&data)).for_each(|p| p.sent = false);
    }

    /// The cable of a bus is cut until a time: nothing is acknowledged, and nothing comes in.
    pub fn cut(&mut self, now: u64, bus: u8, until: u64) {
        self.advance(now);
        if let Some(state) = self.buses.get_mut(usize::from(bus)) {
            state.cut(now, until);
        }
    }

    /// A controller has gone off, or sends again. What it held is reported by
    /// [`dropped`](Self::dropped) before.
    pub fn bus_state(&mut self, now: u64, bus: u8, off: bool) {
        self.advance(now);
        let Some(state) = self.buses.get_mut(usize::from(bus)) else { return };
        let was_off = state.off_since.is_some();
        state.tally.sent_or_not += u32::from(state.left_us.take() == Some(now));
        state.set_off(now, off);
        if off && !was_off {
            state.tally.bus_offs += 1;
            state.raw.clear();
            state.off_noticed_us = Some(now);
            for axis in 0..self.axes.len() {
                if self.axes[axis].bus() == Some(usize::from(bus)) && self.axes[axis].armed {
                    self.owe_stop(axis, Cause::BusOff, now);
                }
            }
        }
    }

    /// The e-stop input was read.
    pub fn e_stop_input(&mut self, now: u64, open: bool) {
        self.advance(now);
        let pressed = open && !self.e_stop_open;
        self.e_stop_open = open;
        if pressed {
            self.e_stop_asked_us = Some(now);
            self.stop_on_request(now, &Request::EStop);
        }
    }

    /// Events follow from each other at this instant without end.
    pub fn never_rests(&mut self, now: u64) {
        self.broken(Check::Restless, now, "events follow from each other without end".into());
    }

    /// The core has panicked.
    pub fn panicked(&mut self, now: u64, said: String) {
        self.broken(Check::Panicked, now, said);
    }

    /// A bus has been handed a frame, and the event before did not name it.
    pub fn not_named(&mut self, now: u64, bus: u8) {
        self.broken(Check::NotNamed, now, format!("bus {bus} has a frame and was not named"));
    }

    /// Everything that has come about by this instant has been told: what is due now?
    pub fn settle(&mut self, now: u64) {
        self.advance(now);
        for seen in self.history.settle() {
            self.broken(Check::HistoryWrong, now, seen);
        }
        self.check_due(now);
        self.check_delivery(now);
    }

    /// A stop of this axis is due since `at`; permission to move has ended.
    pub(crate) fn owe_stop(&mut self, index: usize, cause: Cause, at: u64) {
        let Some(bus) = self.axes[index].bus().filter(|bus| *bus < self.buses.len()) else {
            return;
        };
        self.buses[bus].close_raw(at);
        let axis = &mut self.axes[index];
        axis.armed = false;
        axis.epoch = None;
        axis.permits.clear();
        axis.undelivered = None;
        axis.turns_since = None;
        axis.revoked = Some((cause, at));
        if axis.duty.is_some() {
            return;
        }
        let has_ended = matches!(axis.told, Told::Stopping | Told::Tripped { .. });
        let from_rest = axis.told.is_at_rest() || has_ended && axis.came_from_rest;
        let mut before = 0;
        for other in self.axes.iter_mut().filter(|other| other.bus() == Some(bus)) {
            // They take turns, and in the controller the lower id goes first, be it that of a
            // second stop: each of them may have to wait for the other.
            if let Some(duty) = other.duty.as_mut() {
                duty.k += 1;
                before += 1;
            }
        }
        self.axes[index].duty = Some(Duty {
            cause,
            since_us: at,
            from_rest,
            outside_us: self.buses[bus].not_ours_us(at, self.axes[index].outranked_us),
            k: 1 + before,
            rests: false,
            left: 0,
            left_before: 0,
            last: None,
            acknowledged_us: None,
            still: 0,
            stood: false,
            locking: false,
            locked: false,
            output_off: false,
            confirmed: false,
            nothing_waits: false,
            unsent_seen: false,
        });
    }
}
