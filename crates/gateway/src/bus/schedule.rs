//! What goes out next on a bus: stops first, on CAN those with the lowest id, everything else in
//! order.

use super::{Bus, InFlight};
use crate::axes::Axes;
use crate::axis::{Axis, Is, Priority, Request, Stop};
use crate::protocol;
use crate::set::Set;
use crate::time::{Duration, Instant};
use host_protocol::{BusKind, CanId};

/// Requests outstanding on a CAN bus where replies win the arbitration against stops: a stop can
/// lose to so many (GUARANTEES G5).
pub(super) const MAX_OUTSTANDING: usize = 4;
/// The frames of a request and its reply, on CAN or RS485.
pub(super) const EXCHANGE_FRAMES: u64 = 2;
/// A first stop that may leave and has not within so many frame times keeps no other stop from
/// being repeated and confirmed (GUARANTEES G4).
const FIRST_STOPS_BAR_FRAMES: u64 = 4;

/// Where a frame would go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Room {
    /// The room that the port has now.
    Left,
    /// That of all frames which it can cancel.
    All,
}

/// What decides between requests: the least goes first. The priority, then the id where that
/// decides, compared as in the arbitration.
type Precedence = (u8, Option<CanId>);

/// How far the stops on a bus are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stops {
    /// There is none.
    None,
    /// The first command of each has left.
    Sent,
    /// A first one has still to leave, and keeps everything else from the bus.
    First,
    /// A first one has waited for too long: it bars only what is no part of a stop.
    Held,
}

impl Bus {
    /// The axis to serve now.
    pub(super) fn choose(&self, now: Instant, axes: &Axes, room: Room) -> Option<(usize, Request)> {
        let ready = self.which(Is::Ready, axes);
        if ready.is_empty() {
            return None;
        }
        let stops = self.stops(now, axes);
        let may_ordinary = room == Room::Left
            && matches!(stops, Stops::None | Stops::Sent)
            && self.may_send_ordinary(now)
            && self.leaves_replies_room(now, axes)
            && self.objections_are_over_at(axes).is_none_or(|at| at <= now);
        if stops == Stops::None {
            return if may_ordinary { self.choose_ordinary(now, axes, ready) } else { None };
        }
        if !may_ordinary && !self.may_send_any_stop(now, stops, axes) {
            return None;
        }
        let least = self.least_precedence(stops);
        // On CAN a first stop may have to wait for a reply, which anything else would hold up.
        let candidates = match (stops, self.kind()) {
            (Stops::First, BusKind::Can) => ready.and(self.which(Is::FirstStop, axes)),
            _ => ready,
        };
        let mut best: Option<(usize, Request, Precedence)> = None;
        for index in candidates.behind(self.last_served) {
            let Some(axis) = axes.get(index) else { continue };
            if !may_ordinary && axis.stop().is_none() && !axis.must_be_fed() {
                continue;
            }
            // Behind a first stop nothing of an axis with a higher id goes: what that wants need
            // not be known.
            if best.as_ref().is_some_and(|(.., chosen)| {
                chosen.0 == Priority::FirstStop as u8 && self.first_stop_precedence(axis) >= *chosen
            }) {
                continue;
            }
            let is_barred = !may_ordinary && axis.stop().is_none();
            let want = if is_barred { axis.feeding_request(now) } else { axis.next_request(now) };
            let Some(mut want) = want else { continue };
            // A motor that misses its stops must not keep the others from hearing anything.
            if want.priority == Priority::Stop
                && stops == Stops::Sent
                && !axis.stop().is_some_and(Stop::is_urgent)
                && !self.is_stuck()
            {
                want.priority = Priority::Ordinary;
            }
            let precedence = self.precedence(axis, &want, stops);
            if best.as_ref().is_some_and(|(.., chosen)| precedence >= *chosen)
                || axis.command_for(want.exchange).is_none()
            {
                continue;
            }
            let allowed = match want.priority {
                Priority::FirstStop | Priority::FirstStopAtRest => {
                    self.may_send_stop(now, axis, &want, axes, room)
                }
                Priority::Stop => {
                    !self.has_overdue(axes) && self.may_send_stop(now, axis, &want, axes, room)
                }
                Priority::StopStep if stops == Stops::Held => {
                    self.leaves_replies_room(now, axes)
                        && self.may_send_stop(now, axis, &want, axes, room)
                }
                Priority::StopStep | Priority::Ordinary | Priority::Watch => {
                    may_ordinary
                        && (want.priority != Priority::Watch || self.may_watch(now, axes))
                        && self.id_is_free_at(axis, axes) <= now
                }
            };
            if allowed {
                best = Some((index, want, precedence));
                if Some(precedence) == least {
                    break;
                }
            }
        }
        best.map(|(index, want, _)| (index, want))
    }

    /// Whether a stop may have to wait for a reply, and so for the time when none comes.
    pub fn stops_wait_for_time(&self) -> bool {
        self.kind() == BusKind::Rs485 || self.bounds.shares_ids
    }

    /// A frame cannot leave the controller: it keeps no stop out that would win against it, be it
    /// one that takes its turn.
    fn is_stuck(&self) -> bool {
        self.in_flight.iter().flatten().any(|f| f.overdue)
    }

    /// Where there is no stop: one after the other, what somebody only watches last.
    pub(super) fn choose_ordinary(
        &self,
        now: Instant,
        axes: &Axes,
        ready: Set,
    ) -> Option<(usize, Request)> {
        let wants = |index: usize| {
            let axis = axes.get(index)?;
            let want = axis.next_request(now)?;
            let may = axis.command_for(want.exchange).is_some()
                && self.id_is_free_at(axis, axes) <= now
                && (want.priority != Priority::Watch || self.may_watch(now, axes));
            may.then_some((index, want))
        };
        let mut watched = None;
        for (index, want) in ready.behind(self.last_served).filter_map(wants) {
            if want.priority != Priority::Watch {
                return Some((index, want));
            }
            watched = watched.or(Some((index, want)));
        }
        watched
    }

    /// On CAN the lowest id goes first among stops: the controllers' arbitration would turn any
    /// other order round. Others go one after the other.
    fn precedence(&self, axis: &Axis, want: &Request, stops: Stops) -> Precedence {
        let (first, id) = self.first_stop_precedence(axis);
        match (want.priority, stops) {
            (Priority::StopStep, Stops::Sent | Stops::First) => (Priority::Ordinary as u8, None),
            (priority, _) if self.kind() == BusKind::Rs485 => (priority as u8, None),
            // One of those that are held up stays in the controller; beside it goes what wins
            // against them.
            (Priority::FirstStop | Priority::FirstStopAtRest, Stops::Held)
                if self.holds_first_stop() =>
            {
                (Priority::Stop as u8, id)
            }
            (Priority::FirstStop | Priority::FirstStopAtRest, _) => (first, id),
            (Priority::Stop | Priority::StopStep, _) => (Priority::Stop as u8, id),
            (priority @ (Priority::Ordinary | Priority::Watch), _) => (priority as u8, None),
        }
    }

    /// What nothing goes before, where that needs no look at the axes.
    fn least_precedence(&self, stops: Stops) -> Option<Precedence> {
        match (stops, self.kind()) {
            (Stops::Sent, BusKind::Rs485) => Some((Priority::Stop as u8, None)),
            (Stops::First, BusKind::Rs485) => Some((Priority::FirstStop as u8, None)),
            _ => None,
        }
    }

    /// Whether a command of a stop may go now, as far as the line says so for all of them.
    fn may_send_any_stop(&self, now: Instant, stops: Stops, axes: &Axes) -> bool {
        match (stops, self.kind()) {
            (Stops::Sent, BusKind::Rs485) => {
                let ready = self.which(Is::Ready, axes);
                let due = axes.times(ready, |look| look.stop_due).map(|(_, at)| at).min();
                due.is_some_and(|due| self.line.stop_ready_at(due, self.line_times()) <= now)
            }
            _ => true,
        }
    }

    /// Nothing of the axis goes before this.
    fn first_stop_precedence(&self, axis: &Axis) -> Precedence {
        let id = match self.kind() {
            BusKind::Can => protocol::stop_id(&axis.config),
            BusKind::Rs485 => None,
        };
        (Priority::FirstStop as u8, id)
    }

    fn holds_first_stop(&self) -> bool {
        self.in_flight.iter().flatten().any(|f| f.is_first_stop)
    }

    /// Whether the frame in a slot is a stop that was handed over beside what may have to come
    /// back: for it, or for the stop behind it.
    pub fn is_crowded(&self, slot: u8) -> bool {
        let mut held = (0u8..).zip(&self.in_flight).filter_map(|(at, f)| Some((at, f.as_ref()?)));
        let handed = held.clone().find(|(at, f)| *at == slot && f.is_stop);
        handed.is_some_and(|(_, stop)| {
            held.any(|(at, f)| at != slot && (!f.is_first_stop || f.id > stop.id))
        })
    }

    fn stops(&self, now: Instant, axes: &Axes) -> Stops {
        if !self.is_stopping(axes) {
            return Stops::None;
        }
        if self.which(Is::FirstStop, axes).is_empty() {
            return Stops::Sent;
        }
        if self.first_stops_bar(now, axes) { Stops::First } else { Stops::Held }
    }

    /// Whether first stops bar what is part of other stops, as `first_stops_bar_until` says: found
    /// as soon as one of them does.
    fn first_stops_bar(&self, now: Instant, axes: &Axes) -> bool {
        let bars_for = self.first_stops_bar_for(axes);
        let bars = |since: Instant| now < since + bars_for;
        self.kind() == BusKind::Rs485
            || bars(self.first_stops_since)
            || self.first_stops_may_leave(axes).any(bars)
    }

    /// Until when first stops bar what is part of other stops: four frame times after one of them
    /// left or may have, and the replies that go before it. A line knows no arbitration: a
    /// first stop always leaves there.
    pub(super) fn first_stops_bar_until(&self, axes: &Axes) -> Option<Instant> {
        if self.kind() == BusKind::Rs485 {
            return None;
        }
        Some(
            self.first_stops_may_leave(axes).max()?.max(self.first_stops_since)
                + self.first_stops_bar_for(axes),
        )
    }

    fn first_stops_bar_for(&self, axes: &Axes) -> Duration {
        // Those to the stops before it, too.
        let outranked = self.bounds.outranking_replies > 0 || self.bounds.shares_ids;
        let stops = if outranked { self.which(Is::Stopping, axes).len() } else { 0 };
        let replies = self.bounds.outranking_replies + u64::from(stops);
        self.frame_time(FIRST_STOPS_BAR_FRAMES + replies) + self.bounds.streamed_at_once
    }

    /// From when on each first stop that has not left may leave.
    fn first_stops_may_leave<'a>(&'a self, axes: &'a Axes) -> impl Iterator<Item = Instant> + 'a {
        let first_stops = axes.of(self.which(Is::FirstStop, axes));
        first_stops.filter_map(|axis| Some(axis.stop()?.since.max(self.id_is_free_at(axis, axes))))
    }

    /// A frame in the controller that keeps a stop out which goes before it.
    pub(super) fn keeps_a_stop_out(&self, now: Instant, axes: &Axes) -> Option<u8> {
        if self.is_off() || self.nothing_in_flight() || !self.is_stopping(axes) {
            return None;
        }
        // A second frame may go beside whatever is there, unless a reply with its id is due.
        let has_room = self.free_slot().is_some();
        if has_room && !self.bounds.shares_ids {
            return None;
        }
        let (index, _) = self.choose(now, axes, Room::All)?;
        let axis = axes.get(index)?;
        let goes_alone = !self.may_go_beside_others(axis);
        if has_room && !goes_alone {
            return None;
        }
        let id = protocol::stop_id(&axis.config);
        let is_first = axis.stop().is_some_and(|stop| !stop.has_left())
            && self.stops(now, axes) == Stops::First;
        let held =
            self.in_flight.iter().flatten().filter(|f| f.is_first_stop).filter_map(|f| f.id).min();
        let loses = |f: &InFlight| match is_first {
            true => f.id > id || !f.is_first_stop,
            false => f.id > id && !(f.is_first_stop && f.id == held),
        };
        // Beside one that stays there is no room for it anyway.
        if goes_alone && !self.in_flight.iter().flatten().all(loses) {
            return None;
        }
        let loser = |f: &&InFlight| f.cancel_by.is_none() && loses(f);
        (0u8..)
            .zip(&self.in_flight)
            .find(|(_, f)| f.as_ref().is_some_and(|f| loser(&f)))
            .map(|(slot, _)| slot)
    }

    /// Whether the controller has first stops and nothing else, none waits beside them, and they
    /// still go before everything else.
    pub(super) fn waits_for_first_stop(&self, now: Instant, axes: &Axes) -> bool {
        self.kind() == BusKind::Can
            && !self.nothing_in_flight()
            && self.in_flight.iter().flatten().all(|f| f.is_first_stop)
            && self.unwanted(now, None, axes).is_none()
            && self.which(Is::Ready, axes).and(axes.which(Is::FirstStop)).is_empty()
            && self.stops(now, axes) == Stops::First
    }

    /// The highest id of a first stop in the controller that still goes before everything else: a
    /// frame beside it with a lower id would leave before it.
    pub(super) fn first_stop_in_controller(&self, now: Instant, axes: &Axes) -> Option<CanId> {
        let first_stops = self.in_flight.iter().flatten().filter(|f| f.is_first_stop);
        first_stops.filter_map(|f| f.id).max().filter(|_| self.stops(now, axes) == Stops::First)
    }

    /// Whether the controller is being emptied for the stop of another axis than `chosen`, which
    /// must go alone: whatever took the room meanwhile would be asked back for it as well, and
    /// so without end.
    pub(super) fn empties_for_another_stop(
        &self,
        now: Instant,
        axes: &Axes,
        chosen: usize,
    ) -> bool {
        if !self.bounds.shares_ids || self.nothing_in_flight() {
            return false;
        }
        let is_asked_back = self.in_flight.iter().flatten().any(|f| f.cancel_by.is_some());
        let goes_alone =
            |index: usize| axes.get(index).is_some_and(|axis| !self.may_go_beside_others(axis));
        let wanted = self.choose(now, axes, Room::All);
        wanted.is_some_and(|(index, _)| index != chosen && goes_alone(index))
            && (is_asked_back || self.keeps_a_stop_out(now, axes).is_some())
    }

    /// Whether the port takes another frame, be it a stop: a line one at a time.
    pub(super) fn has_room(&self) -> bool {
        match self.kind() {
            BusKind::Can => self.free_slot().is_some(),
            BusKind::Rs485 => self.nothing_in_flight(),
        }
    }

    /// Whether the port holds no frame.
    pub fn nothing_in_flight(&self) -> bool {
        self.in_flight.iter().all(Option::is_none)
    }

    pub(super) fn may_send_ordinary(&self, now: Instant) -> bool {
        self.nothing_in_flight()
            && (self.kind() == BusKind::Can || self.line.ready_at(self.line_times()) <= now)
    }

    /// Whether the port may be given a frame that waits for the reply to the one before: of another
    /// motor, as this one's next request may follow from its reply.
    pub fn may_wait_for_reply(&self, now: Instant, axes: &Axes) -> bool {
        self.kind() == BusKind::Rs485
            && self.line.awaits_reply(now)
            && self.nothing_in_flight()
            && self.raw.is_none()
            && !self.is_stopping(axes)
            && self.which(Is::Objecting, axes).is_empty()
    }

    /// Whether what is no stop leaves the replies that are due their room, late ones and those
    /// behind lower ids, and stops that lose to replies their bound.
    fn leaves_replies_room(&self, now: Instant, axes: &Axes) -> bool {
        let loses = self.kind() == BusKind::Can && self.bounds.outranking_replies > 0;
        let outstanding = self.which(Is::Awaiting, axes).len() as usize;
        !self.has_overdue(axes)
            && (!loses || outstanding < MAX_OUTSTANDING)
            && !self.lets_replies_pass(now, axes)
    }

    /// Who watches waits: for raw access, and while an axis that may move is due within what one
    /// more exchange can take.
    fn may_watch(&self, now: Instant, axes: &Axes) -> bool {
        let until =
            now + self.reply_window() + self.bit_time(EXCHANGE_FRAMES * self.longest_frame_bits);
        let due = |axis: &Axis| {
            axis.is_armed() && axis.next_request_at(now).is_some_and(|at| at <= until)
        };
        self.raw.is_none() && !self.axes_here(axes).any(due)
    }

    fn may_send_stop(
        &self,
        now: Instant,
        axis: &Axis,
        want: &Request,
        axes: &Axes,
        room: Room,
    ) -> bool {
        match self.kind() {
            BusKind::Can => {
                let id = protocol::stop_id(&axis.config);
                let taken = self.in_flight.iter().flatten().any(|f| f.id == id);
                let fits = room == Room::All || self.may_go_beside_others(axis);
                !taken && fits && self.id_is_free_at(axis, axes) <= now
            }
            BusKind::Rs485 => self.line.stop_ready_at(want.due, self.line_times()) <= now,
        }
    }

    /// A reply that is still due could win the bus together with it behind another frame.
    fn may_go_beside_others(&self, axis: &Axis) -> bool {
        self.nothing_in_flight() || axis.reply_with_our_id_since().is_none()
    }

    /// From when on a frame to the motor of the axis cannot meet a reply with its own id. It waits
    /// for the reply, no longer than on RS485 since the bus has been quiet: before, the reply
    /// may have had to wait for others. What others that can be is bounded, as replies
    /// are let pass: of each axis the reply that was due as well, the first stop, and the reply to
    /// that.
    pub(super) fn id_is_free_at(&self, axis: &Axis, axes: &Axes) -> Instant {
        let since = axis.reply_with_our_id_since().filter(|_| self.kind() == BusKind::Can);
        let Some(since) = since else { return Instant::from_micros(0) };
        // Another motor's reply or objection may have begun when nothing has come for so long, and
        // that of this one be behind it.
        let objects = axis.transactions.objects;
        let others = self.which(Is::OwedOurId, axes).without(Set::of(axis.index));
        let behind =
            if !others.is_empty() || objects { self.frame_time(1) } else { Duration::ZERO };
        let delay = self.line_times().stop_delay() + behind;
        // It has missed its turn, unless it objects to what has left since.
        if since + delay <= self.quiet_at && !objects {
            return self.quiet_at;
        }
        let all = self.bit_time(3 * self.longest_frame_bits).times(self.here(axes).len().into());
        if axis.stops_past_unprinted_reply() {
            return since + delay;
        }
        (since.max(self.active_at) + delay).min(since + all + delay)
    }

    /// Whether a reply with the id of its request may be waiting behind lower ids: what we sent now
    /// could hold it up until the next frame to its motor meets it. No longer than until the
    /// bus has been quiet once when the reply window was over.
    fn lets_replies_pass(&self, now: Instant, axes: &Axes) -> bool {
        let mut owed = axes.of(self.which(Is::OwedOurId, axes));
        let held_up = |axis: &Axis| {
            axis.reply_with_our_id_since().is_some_and(|since| {
                let late = since + self.line_times().stop_delay() <= now;
                let missed = self.quiet_at >= since + self.reply_window();
                late && !missed && self.id_is_free_at(axis, axes) > now
            })
        };
        owed.any(held_up)
    }

    /// When every motor has had its say to the latest request, where some answer what was for
    /// others: each under the id of the next frame to it, so that what is no stop waits until
    /// nothing has come for as long as a motor takes and its frame.
    pub(super) fn objections_are_over_at(&self, axes: &Axes) -> Option<Instant> {
        let object = !self.which(Is::Objecting, axes).is_empty();
        object.then(|| self.active_at + self.line_times().stop_delay() + self.frame_time(1))
    }
}
