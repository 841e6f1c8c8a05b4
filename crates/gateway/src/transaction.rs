//! The fate of an axis's requests: with the port, transmitted and awaited, late, done.
//!
//! One request of an axis is under way at a time. A stop preempts it; the request before is
//! remembered as long as its reply may come, so that this reply answers nothing else.

use crate::config::AxisConfig;
use crate::measured::Observation;
use crate::protocol::{self, Command, Exchange, Outcome, Received, Unasked};
use crate::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// What a motor has not answered for so long it answers no more (the longest reply window,
/// GUARANTEES).
const LATEST_REPLY: Duration = Duration::from_millis(300);

/// One request and where it stands.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Transaction {
    pub exchange: Exchange,
    pub command: Command,
    /// The slot of the bus that its frame was handed with.
    slot: u8,
    stage: Stage,
    /// No older request with the same reply was outstanding when it was handed over, so a reply
    /// can only be its own.
    pub unambiguous: bool,
    /// Sending it again would move the motor again.
    pub once: bool,
    /// Which motion of the axis it is, if it is one.
    pub motion: u32,
    /// By when that motion must leave; [`Instant::NEVER`] where it is none.
    pub deliver_by: Instant,
    /// The bus had taken it when the job under way began.
    pub predates_job: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    /// The port has its frame.
    WithPort,
    /// Its frame left at `since`; its reply is due until then. `waits`: behind that it may still
    /// wait for the bus.
    Awaited { since: Instant, until: Instant, waits: bool },
    /// Its reply is late, and may wait for the bus until that is found to have had room for it.
    Overdue { since: Instant },
    /// Its window has closed. It is remembered, so that a late reply is known.
    Late { until: Instant },
}

/// What a received frame is to the requests of an axis.
pub(crate) enum Match {
    /// The reply to a request that is under way no longer.
    Late,
    /// It ends the request under way.
    Ends(Transaction, Outcome),
    /// Nobody has asked.
    Unasked,
}

impl Transaction {
    /// Whether its frame has left and its reply may come.
    pub fn is_awaited(&self) -> bool {
        matches!(self.stage, Stage::Awaited { .. } | Stage::Overdue { .. })
    }

    /// Since when its reply is due, if that is late and may wait for the bus.
    fn overdue_since(&self) -> Option<Instant> {
        match self.stage {
            Stage::Overdue { since } => Some(since),
            _ => None,
        }
    }

    /// Whether time has ended it. A reply that is late may have to wait for the bus.
    fn is_over(&mut self, now: Instant) -> bool {
        let is_over = self.deadline().is_some_and(|until| until <= now);
        match self.stage {
            Stage::Awaited { since, waits: true, .. } if is_over => {
                self.stage = Stage::Overdue { since };
                false
            }
            _ => is_over,
        }
    }

    fn is_with_port(&self) -> bool {
        self.stage == Stage::WithPort
    }

    /// Whether its frame is in this slot and has not left.
    fn waits_in(&self, slot: u8) -> bool {
        self.slot == slot && self.is_with_port()
    }

    /// When something of it is over that time alone ends.
    pub fn deadline(&self) -> Option<Instant> {
        match self.stage {
            Stage::WithPort | Stage::Overdue { .. } => None,
            Stage::Awaited { until, .. } | Stage::Late { until } => Some(until),
        }
    }

    /// When its frame had left.
    pub fn transmitted_at(&self) -> Option<Instant> {
        match self.stage {
            Stage::Awaited { since, .. } | Stage::Overdue { since } => Some(since),
            _ => None,
        }
    }

    /// How long its reply is waited for; no time before its frame has left.
    pub fn window(&self) -> Duration {
        match self.stage {
            Stage::Awaited { since, until, .. } => until.since(since),
            _ => Duration::ZERO,
        }
    }

    /// Whether it is the command of a stop under way: to one that is sent again the reply to the
    /// one before says the same.
    pub fn repeats(&self, stops: bool) -> bool {
        stops && self.exchange == Exchange::Stop
    }

    /// By when the motion in it must leave; [`Instant::NEVER`] where it is none, or has left.
    pub fn deliver_by(&self) -> Instant {
        if self.is_with_port() { self.deliver_by } else { Instant::NEVER }
    }
}

/// A request was given up, and no other before then: its late reply must not be taken for the next
/// one's. Only a setpoint does not wait for what was no setpoint.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Holdoff {
    /// It was a setpoint.
    is_motion: bool,
    until: Instant,
}

impl Holdoff {
    const NONE: Self = Self { is_motion: false, until: Instant::from_micros(0) };
}

/// The requests of one axis.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Transactions {
    current: Option<Transaction>,
    /// A request that is under way no longer while its reply may come: preempted, or given up.
    former: Option<Transaction>,
    holdoff: Holdoff,
    /// Until then a reply that would confirm a stop may be a late one.
    stop_like_reply_until: Instant,
    /// Until then a reply to a motion may be a late one to another.
    motion_reply_until: Instant,
    /// Since when the motor owes a reply or an objection.
    pub owed_since: Option<Instant>,
    /// That reply is not printed: none is expected, but one that came would meet the next frame.
    pub is_unprinted: bool,
    /// The motor has answered a request to another one, and will again.
    pub objects: bool,
    /// How often it may still do so, since the last frame to it.
    objections_due: u8,
}

impl Transactions {
    pub const fn new() -> Self {
        Self {
            current: None,
            former: None,
            holdoff: Holdoff::NONE,
            stop_like_reply_until: Instant::from_micros(0),
            motion_reply_until: Instant::from_micros(0),
            owed_since: None,
            is_unprinted: false,
            objects: false,
            objections_due: 0,
        }
    }

    /// The request under way.
    pub fn current(&self) -> Option<&Transaction> {
        self.current.as_ref()
    }

    /// Whether no request is under way.
    pub fn is_idle(&self) -> bool {
        self.current.is_none()
    }

    /// The request under way, while its frame has not left.
    pub fn with_port(&self) -> Option<Exchange> {
        self.current.as_ref().filter(|c| c.is_with_port()).map(|c| c.exchange)
    }

    /// Whether the reply to the request under way may come.
    pub fn is_awaited(&self) -> bool {
        self.current.as_ref().is_some_and(Transaction::is_awaited)
    }

    /// Whether the frame in `slot` is the request under way.
    pub fn has_in(&self, slot: u8) -> bool {
        self.current.as_ref().is_some_and(|current| current.slot == slot)
    }

    /// From when on a request that is due at `at` may go out.
    pub fn not_before(&self, is_motion: bool, at: Instant) -> Instant {
        let waits = !is_motion || self.holdoff.is_motion;
        if waits { at.max(self.holdoff.until) } else { at }
    }

    /// When something is over that time alone ends.
    pub fn deadlines(&self) -> [Option<Instant>; 2] {
        [&self.former, &self.current].map(|request| request.as_ref()?.deadline())
    }

    /// Whether a reply may come that is due within the bus's window.
    pub fn awaits_reply(&self) -> bool {
        let within = |request: &Transaction| {
            request.is_awaited() && protocol::slow_reply(&request.command).is_none()
        };
        self.current.as_ref().is_some_and(within) || self.former.as_ref().is_some_and(within)
    }

    /// Since when the first reply is due that is late and may wait for the bus.
    pub fn overdue_since(&self) -> Option<Instant> {
        let since = |request: &Option<Transaction>| request.as_ref()?.overdue_since();
        // It had left before the one that has taken its place.
        since(&self.former).or_else(|| since(&self.current))
    }

    /// The bus has had room for the late replies that are due since then or before: they come no
    /// more.
    pub fn miss_overdue(&mut self, now: Instant, due_since: Instant) {
        for request in [&mut self.former, &mut self.current].into_iter().flatten() {
            if let Some(since) = request.overdue_since().filter(|since| *since <= due_since) {
                request.stage = Stage::Awaited { since, until: now, waits: false };
            }
        }
    }

    /// A job begins: the request under way is not of it.
    pub fn job_begins(&mut self) {
        if let Some(current) = &mut self.current {
            current.predates_job = true;
        }
    }

    /// The bus has taken a request, which is no motion until its axis says so.
    pub fn begin(
        &mut self,
        now: Instant,
        exchange: Exchange,
        command: Command,
        slot: u8,
        config: &AxisConfig,
    ) -> &mut Transaction {
        let unambiguous = !self.may_answer_an_older(now, &command, config);
        self.current.insert(Transaction {
            exchange,
            command,
            slot,
            stage: Stage::WithPort,
            unambiguous,
            once: false,
            motion: 0,
            deliver_by: Instant::NEVER,
            predates_job: false,
        })
    }

    /// The frame in `slot` has left, and its reply may come within `window`; `waits`: and behind
    /// that where the bus has no room for it. Returns the request under way if it is that; one that
    /// its motor does not answer is over.
    pub fn transmitted(
        &mut self,
        now: Instant,
        slot: u8,
        window: Duration,
        waits: bool,
        config: &AxisConfig,
    ) -> Option<Transaction> {
        let owed = |command| protocol::is_answered(command, config).then_some(now);
        if let Some(former) = self.former.as_mut().filter(|former| former.waits_in(slot)) {
            former.stage = Stage::Awaited { since: now, until: now + window, waits };
            (self.owed_since, self.is_unprinted) = (owed(&former.command), false);
            return None;
        }
        let current = self.current.as_mut().filter(|current| current.waits_in(slot))?;
        let window = protocol::slow_reply(&current.command).unwrap_or(window);
        current.stage = Stage::Awaited { since: now, until: now + window, waits };
        (self.owed_since, self.is_unprinted) = (owed(&current.command), false);
        self.objections_due = 0;
        let transmitted = *current;
        if self.owed_since.is_none() {
            self.current = None;
        }
        Some(transmitted)
    }

    /// The request whose frame is in `slot`, under way or not, which has not left.
    pub fn waiting_in(&self, slot: u8) -> Option<&Transaction> {
        let requests = [&self.former, &self.current].into_iter().flatten();
        requests.into_iter().find(|request| request.waits_in(slot))
    }

    /// The frame in `slot` will not leave any more. Returns the request under way if it is that.
    pub fn cancelled(&mut self, slot: u8) -> Option<Transaction> {
        if self.former.as_ref().is_some_and(|former| former.waits_in(slot)) {
            self.former = None;
            return None;
        }
        self.current.take_if(|current| current.waits_in(slot))
    }

    /// Whether the frame in `slot` has not left and should not any more: a stop has preempted it,
    /// or it is `unwanted`.
    pub fn is_replaced(&self, slot: u8, unwanted: impl Fn(&Transaction) -> bool) -> bool {
        let is_old = |current: &Transaction| current.waits_in(slot) && unwanted(current);
        self.former.as_ref().is_some_and(|former| former.waits_in(slot))
            || self.current.as_ref().is_some_and(is_old)
    }

    /// Makes room for a stop. What was under way may still be answered, and is then not taken for
    /// the stop's reply.
    pub fn preempt(&mut self) {
        if let Some(current) = self.current.take() {
            self.former = Some(current);
        }
    }

    /// The same, but for a stop that has still to leave: it is owed until it has.
    pub fn preempt_all_but_a_stop(&mut self) {
        if !self.with_port().is_some_and(Exchange::is_stop) {
            self.preempt();
        }
    }

    /// A frame of the motor has arrived: what it is, and what it tells as an answer.
    pub fn received(
        &mut self,
        now: Instant,
        received: &Received,
        config: &AxisConfig,
        seen: &mut Observation,
    ) -> Match {
        if received.unasked() == Unasked::Objection {
            self.objects = true;
            self.objections_due = self.objections_due.saturating_sub(1);
        }
        // What has not left cannot be answered: an answer of that kind is one that came twice.
        if let Some(former) = self.former.as_ref().filter(|former| !former.is_with_port())
            && protocol::judge(&former.command, received, config, seen).is_some()
        {
            self.former = None;
            // The reply to what was sent in its place is still due.
            self.owed_since = self.owed_since.filter(|_| self.is_awaited());
            return Match::Late;
        }
        let objection_due = (self.objections_due > 0).then_some(now);
        let Some(current) = self.current.as_ref().filter(|current| current.is_awaited()) else {
            // Late beyond everything that is remembered, but it has come.
            self.owed_since = objection_due;
            return Match::Unasked;
        };
        let Some(outcome) = protocol::judge(&current.command, received, config, seen) else {
            return Match::Unasked;
        };
        self.owed_since = objection_due;
        self.current.take().map_or(Match::Unasked, |current| Match::Ends(current, outcome))
    }

    /// Ends what time has ended. `stops`: a stop is under way. Returns the request under way if its
    /// window has closed.
    pub fn expire(
        &mut self,
        now: Instant,
        stops: bool,
        config: &AxisConfig,
    ) -> Option<Transaction> {
        self.former.take_if(|former| former.is_over(now));
        let is_over = self.current.as_mut().is_some_and(|current| current.is_over(now));
        is_over.then(|| self.give_up(now, stops, config))?
    }

    /// Gives up the request under way. A late reply must find nothing identical under way: the next
    /// request waits another window, and what a stop may be mistaken for is remembered as long, but
    /// for a stop that is [sent again](Transaction::repeats).
    pub fn give_up(
        &mut self,
        now: Instant,
        stops: bool,
        config: &AxisConfig,
    ) -> Option<Transaction> {
        let current = self.current.take()?;
        if current.repeats(stops) {
            return Some(current);
        }
        self.may_be_answered_late(now, &current.command, config);
        if current.exchange == Exchange::Motion {
            self.motion_reply_until = now + LATEST_REPLY;
        }
        if current.is_awaited() {
            let until = now + current.window();
            // What is answered slowly is answered as nothing else, and however late by a motor that
            // does it: the stop need not wait for that.
            if protocol::slow_reply(&current.command).is_none() {
                self.holdoff = Holdoff { is_motion: current.exchange == Exchange::Motion, until };
                self.former.get_or_insert(Transaction { stage: Stage::Late { until }, ..current });
            }
        }
        Some(current)
    }

    /// Forgets the request before, as the bus starts anew.
    pub fn forget_former(&mut self) {
        self.former = None;
    }

    /// The axis is reached otherwise from now on: what is under way, or was, belongs to the motor
    /// that it had.
    pub fn forget(&mut self) {
        self.current = None;
        self.former = None;
        self.owed_since = None;
        self.objects = false;
        self.holdoff = Holdoff::NONE;
    }

    /// A request was not answered within its window. Where its reply cannot be told from that of
    /// the stop, it must not be taken for it.
    pub fn may_be_answered_late(&mut self, now: Instant, command: &Command, config: &AxisConfig) {
        if is_answered_like_the_stop(command, config) {
            self.stop_like_reply_until = now + LATEST_REPLY;
        }
    }

    /// Whether the reply that ends a motion now may be the late one to a motion that was given up.
    pub fn motion_reply_is_ambiguous(&self, now: Instant) -> bool {
        now < self.motion_reply_until
    }

    /// Whether a reply to this command may be the late one to a command sent before.
    fn may_answer_an_older(&self, now: Instant, command: &Command, config: &AxisConfig) -> bool {
        let is_alike = |f: &Transaction| protocol::are_answered_alike(&f.command, command, config);
        self.former.as_ref().is_some_and(is_alike)
            || now < self.stop_like_reply_until && is_answered_like_the_stop(command, config)
    }

    /// A request to another motor of the bus has left: this one may answer it as well, under the id
    /// that its own frames have.
    pub fn may_object(&mut self, now: Instant) {
        if self.objects {
            self.objections_due = self.objections_due.saturating_add(1);
            if !self.is_awaited() {
                self.owed_since = Some(now);
            }
        }
    }

    /// The motor owes a reply that is let pass before the next frame to it, perhaps one that no
    /// manual prints.
    pub fn owes_reply(&mut self, now: Instant, is_unprinted: bool) {
        (self.owed_since, self.is_unprinted) = (Some(now), is_unprinted);
    }
}

fn is_answered_like_the_stop(command: &Command, config: &AxisConfig) -> bool {
    protocol::command(Exchange::Stop, config)
        .is_some_and(|stop| protocol::are_answered_alike(command, &stop, config))
}
