//! What is handed to a bus, and what becomes of it.

use super::line::{LineTimes, PAUSE_BITS, serial_frame_bits};
use super::schedule::Room;
use super::{Bus, Due, InFlight};
use crate::axes::Axes;
use crate::axis::{Axis, Is, Priority, Request};
use crate::outbox::Outbox;
use crate::port::{Outgoing, Transmit};
use crate::protocol::{self, Exchange};
use crate::time::{Duration, Earliest, Instant};
use heapless::Vec;
use host_protocol::{BusKind, CanId, RawFrame, TripReason};

/// A frame that nobody has acknowledged within this and four frame times is overdue (GUARANTEES
/// G3).
const ACKNOWLEDGE_WITHIN: Duration = Duration::from_millis(20);
const ACKNOWLEDGE_FRAMES: u64 = 4;
/// A controller that has neither transmitted nor cancelled a frame within this and four frame times
/// is started again.
const CANCELLED_WITHIN: Duration = Duration::from_millis(10);
/// A frame that waited in vain for a reply with its own id, and has not left after so many frame
/// times in which the bus carried no other one, has met that reply.
const COLLIDED_AFTER_FRAMES: u64 = 3;
/// `TripReason::Internal` code: a command that was checked when it was accepted could not be
/// encoded.
const INTERNAL_ENCODING: u16 = 1;

/// How a frame goes to the port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Goes {
    /// Nothing goes beside it.
    Alone,
    /// Stops are under way, and may go beside it.
    BesideStops,
    /// It waits in the port until a reply has come.
    BehindReply,
}

impl Goes {
    fn transmit(self, slot: u8, frame: Outgoing) -> Transmit {
        let behind_reply = self == Self::BehindReply;
        Transmit { slot, frame, is_alone: self != Self::BesideStops, behind_reply }
    }
}

impl Bus {
    /// The next frame, if the bus may send one now.
    pub fn poll_transmit(
        &mut self,
        now: Instant,
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) -> Option<Transmit> {
        if self.config.is_none() || self.is_off() || !self.has_room() {
            return None;
        }
        let goes = match self.is_stopping(axes) {
            true => Goes::BesideStops,
            false if self.may_wait_for_reply(now, axes) => Goes::BehindReply,
            false => Goes::Alone,
        };
        let chosen = match goes {
            Goes::BehindReply => self.choose_ordinary(now, axes, self.which(Is::Ready, axes)),
            Goes::Alone | Goes::BesideStops => self.choose(now, axes, Room::Left),
        };
        if let Some((index, want)) = chosen
            && !self.empties_for_another_stop(now, axes, index)
        {
            return axes.hand_over(index, |axis| self.hand_over(now, axis, want, goes, out));
        }
        self.raw_frame(now, goes)
    }

    /// The port has sent the frame in `slot`.
    pub fn transmitted(&mut self, now: Instant, slot: u8, axes: &mut Axes, out: &mut Outbox<'_>) {
        let place = usize::from(slot);
        if self.in_flight.get(place).is_some_and(Option::is_some) {
            self.begins_held(now);
        }
        let Some(in_flight) = self.in_flight.get_mut(place).and_then(Option::take) else { return };
        self.counters.transmitted = self.counters.transmitted.saturating_add(1);
        self.carried(now);
        self.time_left = None;
        self.let_reply_pass = false;
        if in_flight.is_first_stop {
            self.first_stops_since = now;
        }
        let (window, waits) = (self.reply_window(), self.kind() == BusKind::Can);
        if self.kind() == BusKind::Rs485 {
            self.line.sent(now, self.line_times());
        }
        if let Some(from) = in_flight.axis {
            axes.transmitted(from.into(), |axis| axis.transmitted(now, slot, window, waits, out));
            axes.each(self.which(Is::Objecting, axes), |other| {
                if other.index != from {
                    other.transactions.may_object(now);
                }
            });
        }
    }

    /// The port sends now what it has kept until a reply came, if anything. Only now it was that
    /// axis's turn.
    pub(super) fn begins_held(&mut self, now: Instant) {
        if !self.line.is_holding() {
            return;
        }
        let begins_at = now + self.line_times().gap;
        let Some(early) = self.line.begins_held(begins_at) else { return };
        for in_flight in self.in_flight.iter_mut().flatten() {
            in_flight.deadline = in_flight.deadline - early;
            self.last_served = in_flight.axis.unwrap_or(self.last_served);
        }
    }

    /// The bus has carried a frame. What waits in the controller has waited for that meanwhile, and
    /// met no reply: while two frames destroy each other, neither passes.
    pub(super) fn carried(&mut self, now: Instant) {
        self.active_at = now;
        if self.in_flight.iter().flatten().all(|f| f.collided_at.is_none()) {
            return;
        }
        let (frame, latest) = (self.frame_time(1), now + self.frame_time(COLLIDED_AFTER_FRAMES));
        for in_flight in self.in_flight.iter_mut().flatten().filter(|f| f.cancel_by.is_none()) {
            in_flight.collided_at = in_flight.collided_at.map(|at| (at + frame).min(latest));
        }
    }

    /// Whether a bus that has just changed may have a frame to send or to cancel: where it stops
    /// nothing, it sends one frame at a time.
    pub fn may_want(&self, now: Instant, axes: &Axes) -> bool {
        if self.raw.is_some() {
            return true;
        }
        if self.is_stopping(axes) {
            return !self.waits_for_first_stop(now, axes);
        }
        match self.may_send_ordinary(now) || self.may_wait_for_reply(now, axes) {
            true => !self.which(Is::Ready, axes).is_empty(),
            false => self.unwanted(now, None, axes).is_some(),
        }
    }

    /// The next frame that the port should give back: its axis has replaced it, it keeps a stop out
    /// that goes before it, or the reply that it waits for has not come.
    pub fn poll_cancel(&mut self, now: Instant, axes: &Axes) -> Option<u8> {
        if self.nothing_in_flight() {
            return None;
        }
        let slot = match self.kind() {
            BusKind::Can => {
                let first_stop = self.first_stop_in_controller(now, axes);
                let unwanted = self.unwanted(now, first_stop, axes);
                unwanted.or_else(|| self.keeps_a_stop_out(now, axes))
            }
            BusKind::Rs485 => self.unwanted(now, None, axes),
        }?;
        let within = CANCELLED_WITHIN + self.frame_time(ACKNOWLEDGE_FRAMES);
        self.in_flight.get_mut(usize::from(slot))?.as_mut()?.cancel_by = Some(now + within);
        Some(slot)
    }

    /// A frame in the controller that is not to leave, and has not been asked back; on a line one
    /// that waits for a reply. `first_stop`: it goes before all that is no stop and has a higher
    /// id.
    pub(super) fn unwanted(
        &self,
        now: Instant,
        first_stop: Option<CanId>,
        axes: &Axes,
    ) -> Option<u8> {
        if self.kind() == BusKind::Rs485 && !self.line.is_holding() {
            return None;
        }
        let waits_in_vain = self.kind() == BusKind::Rs485
            && (!self.line.awaits_reply(now) || self.raw.is_some() || self.is_stopping(axes));
        let is_unwanted = |slot: u8, in_flight: &InFlight| {
            if waits_in_vain {
                return true;
            }
            let axis = in_flight.axis.and_then(|index| axes.get(usize::from(index)));
            match axis {
                // What was given up must not leave when nobody expects it any more.
                Some(axis) => {
                    in_flight.collided_at.is_some_and(|at| at <= now)
                        || axis.has_replaced(now, slot)
                        || !in_flight.is_stop && first_stop > in_flight.id
                        || in_flight.overdue
                            && !in_flight.is_stop
                            && !axis.transactions.has_in(slot)
                }
                None => in_flight.is_disowned || self.raw.is_none(),
            }
        };
        let held = (0u8..).zip(&self.in_flight).filter_map(|(slot, f)| Some((slot, f.as_ref()?)));
        let mut kept = held.filter(|(_, in_flight)| in_flight.cancel_by.is_none());
        kept.find(|(slot, in_flight)| is_unwanted(*slot, in_flight)).map(|(slot, _)| slot)
    }

    /// The controller has cancelled the frame in `slot`.
    pub fn cancelled(&mut self, now: Instant, slot: u8, axes: &mut Axes) {
        let Some(in_flight) = self.in_flight.get_mut(usize::from(slot)).and_then(Option::take)
        else {
            return;
        };
        self.counters.cancelled = self.counters.cancelled.saturating_add(1);
        self.line.gave_back();
        // Nothing takes the place of a frame that is nobody's any more.
        if !in_flight.overdue && in_flight.axis.is_some() {
            let left = in_flight.deadline.since(now);
            self.time_left = Some(self.time_left.map_or(left, |before| before.min(left)));
        }
        if let Some(axis) = in_flight.axis.and_then(|index| axes.get_mut(usize::from(index))) {
            axis.cancelled(now, slot);
            if in_flight.collided_at.is_some_and(|at| at <= now) {
                // The reply that it has met on the bus is let pass first.
                axis.transactions.owes_reply(now, false);
                self.let_reply_pass = true;
            }
        }
    }

    /// Looks for frames that nobody has acknowledged, or that the controller has not cancelled, in
    /// time. Returns whether there is one.
    pub fn expire_in_flight(
        &mut self,
        now: Instant,
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) -> bool {
        if self.in_flight.iter().flatten().filter_map(|f| f.cancel_by).any(|by| by <= now) {
            self.restart(now, axes, out);
            return true;
        }
        let mut is_overdue = false;
        for (slot, in_flight) in (0u8..).zip(&mut self.in_flight) {
            let Some(in_flight) = in_flight.as_mut().filter(|f| !f.overdue && f.deadline <= now)
            else {
                continue;
            };
            (in_flight.overdue, is_overdue) = (true, true);
            self.time_left = None;
            self.counters.missed_acknowledgements =
                self.counters.missed_acknowledgements.saturating_add(1);
            // What is behind it cannot leave either: whatever is armed on this bus is out of reach.
            axes.each(axes.on(self.index), |axis| {
                if axis.is_armed() {
                    axis.trip(now, TripReason::NotAcknowledged, out);
                }
            });
            if let Some(axis) = in_flight.axis.and_then(|index| axes.get_mut(usize::from(index))) {
                axis.unacknowledged(now, slot, out);
            }
        }
        // No acknowledgement is needed there: the port has lost it, and a stop must not wait for
        // ever.
        if self.kind() == BusKind::Rs485 && self.in_flight.iter().flatten().any(|f| f.overdue) {
            self.restart(now, axes, out);
        }
        is_overdue
    }

    /// Earliest time after `after` at which the bus must be looked at again, and earliest of all
    /// at which [`expire`](Self::expire) finds something.
    pub(super) fn deadlines(&self, after: Instant, axes: &Axes) -> Due {
        if self.config.is_none() {
            let at = self.stop_is_unsent_at(axes).unwrap_or(Instant::NEVER);
            return Due { at, expires: at };
        }
        let mut next = Earliest::after(after);
        next.consider(self.restart_at);
        for in_flight in self.in_flight.iter().flatten() {
            next.consider(Some(in_flight.deadline).filter(|_| !in_flight.overdue));
            next.consider(in_flight.cancel_by.or(in_flight.collided_at));
        }
        for axis in axes.of(self.which(Is::Late, axes)) {
            next.consider(axis.delivery_due_at().map(|due| due + self.delivered_within()));
        }
        let stops = self.is_stopping(axes);
        if stops {
            next.consider(self.stop_is_delayed_at(axes));
            next.consider(self.stop_is_unsent_at(axes));
        }
        if self.has_overdue(axes) {
            next.consider(self.misses_overdue_at(axes));
        }
        let expires = next.first();
        if stops {
            next.consider(self.first_stops_bar_until(axes));
        }
        for axis in axes.of(self.which(Is::OwedOurId, axes)) {
            next.consider(Some(self.id_is_free_at(axis, axes)));
        }
        next.consider(self.objections_are_over_at(axes));
        if self.kind() == BusKind::Rs485 {
            let times = self.line_times();
            // Behind a frame that is on its way the port says when it has left.
            if self.nothing_in_flight() || self.line.is_holding() {
                next.consider(Some(self.line.ready_at(times)));
            }
            for (_, due) in axes.times(self.which(Is::Stopping, axes), |look| look.stop_due) {
                next.consider(Some(self.line.stop_ready_at(due, times)));
            }
        }
        Due { at: next.at(), expires }
    }

    pub(super) fn line_times(&self) -> LineTimes {
        LineTimes {
            gap: self.bit_time(PAUSE_BITS),
            frame: self.bit_time(serial_frame_bits(self.line.serial())),
            window: self.reply_window(),
        }
    }

    pub(super) fn axes_here<'a>(&self, axes: &'a Axes) -> impl Iterator<Item = &'a Axis> + Clone {
        axes.of(self.here(axes))
    }

    pub(super) fn free_slot(&self) -> Option<u8> {
        (0u8..).zip(&self.in_flight).find(|(_, f)| f.is_none()).map(|(slot, _)| slot)
    }

    fn hand_over(
        &mut self,
        now: Instant,
        axis: &mut Axis,
        want: Request,
        goes: Goes,
        out: &mut Outbox<'_>,
    ) -> Option<Transmit> {
        let command = axis.command_for(want.exchange);
        let frame = command.and_then(|command| match self.kind() {
            BusKind::Can => protocol::to_can(&command, &axis.config).map(Outgoing::Can),
            BusKind::Rs485 => protocol::to_serial(&command, &axis.config)
                .and_then(|frame| Vec::from_slice(&frame).ok())
                .map(Outgoing::Serial),
        });
        let (Some(command), Some(frame), Some(slot)) = (command, frame, self.free_slot()) else {
            axis.trip(now, TripReason::Internal { code: INTERNAL_ENCODING }, out);
            return None;
        };
        // What goes out of turn takes nobody's.
        let has_turn = want.priority >= Priority::StopStep;
        if has_turn && goes != Goes::BehindReply {
            self.last_served = axis.index;
        }
        // Once for a frame that leaves: on a cut bus a stop stays in the controller.
        let may_come = self.kind() == BusKind::Can
            && (axis.reply_with_our_id_since().is_some() || axis.transactions.objects);
        let may_collide = may_come && !self.let_reply_pass;
        let collided_at = may_collide.then(|| now + self.frame_time(COLLIDED_AFTER_FRAMES));
        axis.handed(now, want.exchange, command, slot);
        let within = ACKNOWLEDGE_WITHIN + self.frame_time(ACKNOWLEDGE_FRAMES);
        let within = match want.exchange {
            Exchange::Motion => within.min(axis.config.ttl()),
            _ => within,
        };
        if let Some(in_flight) = self.launch(now, slot, &frame, goes, within) {
            in_flight.axis = Some(axis.index);
            // The stop command with which an arming begins stops nothing that must be stopped.
            in_flight.is_stop = want.exchange.is_stop() && want.priority < Priority::Ordinary;
            in_flight.is_first_stop = want.priority.is_first_stop();
            in_flight.collided_at = collided_at;
        }
        Some(goes.transmit(slot, frame))
    }

    fn raw_frame(&mut self, now: Instant, goes: Goes) -> Option<Transmit> {
        if self.raw.is_none() || !self.may_send_ordinary(now) {
            return None;
        }
        let slot = self.free_slot()?;
        let frame = match self.raw.as_mut()?.next_to_send()? {
            RawFrame::Can(frame) => Outgoing::Can(frame),
            RawFrame::Serial(bytes) => Outgoing::Serial(Vec::from_slice(bytes.as_slice()).ok()?),
        };
        let within = ACKNOWLEDGE_WITHIN + self.frame_time(ACKNOWLEDGE_FRAMES);
        self.launch(now, slot, &frame, goes, within);
        Some(goes.transmit(slot, frame))
    }

    /// The port takes a frame, nobody's as yet. Returns what is kept of it.
    fn launch(
        &mut self,
        now: Instant,
        slot: u8,
        frame: &Outgoing,
        goes: Goes,
        within: Duration,
    ) -> Option<&mut InFlight> {
        let mut begins_by = now;
        let id: Option<CanId> = match frame {
            Outgoing::Can(frame) => Some(CanId(frame.id())),
            Outgoing::Serial(bytes) => {
                match goes {
                    Goes::BehindReply => begins_by = self.line.holds(bytes).unwrap_or(now),
                    Goes::Alone | Goes::BesideStops => self.line.taken(now, bytes),
                }
                None
            }
        };
        let quiet_for = self.line_times().stop_delay() + self.frame_time(1);
        // A frame that has not left may be colliding all the time.
        if self.nothing_in_flight() && self.active_at + quiet_for <= now {
            self.quiet_at = now;
        }
        // A setpoint that takes the place of another one has no more time than that had.
        let within = self.time_left.map_or(within, |left| left.min(within));
        Some(self.in_flight.get_mut(usize::from(slot))?.insert(InFlight {
            axis: None,
            id,
            deadline: begins_by + within,
            overdue: false,
            is_stop: false,
            is_first_stop: false,
            is_disowned: false,
            cancel_by: None,
            collided_at: None,
        }))
    }
}
