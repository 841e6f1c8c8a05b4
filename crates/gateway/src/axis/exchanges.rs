//! The one request of an axis that is under way, and the one before whose reply may still come.

use super::motion::Motion;
use super::{Axis, Observation};
use crate::outbox::Outbox;
use crate::protocol::{self, Command, Exchange, Info, Received, Sets, Unasked, Verdict};
use crate::time::{Duration, Instant};
use host_protocol::TripReason;

/// A request handed to the bus.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pending {
    pub exchange: Exchange,
    pub command: Command,
    /// Slot of the bus it was handed with.
    slot: u8,
    /// How long a reply is waited for.
    window: Duration,
    /// When the reply window closes; `None` until the frame has left.
    until: Option<Instant>,
    /// No older identical request was outstanding when it was handed over, so a reply can only be
    /// its own.
    pub unambiguous: bool,
    /// Sending it again would move the motor again.
    once: bool,
    /// Which motion of the axis it is, if it is one.
    pub motion: u32,
    /// Since when it has waited, if it is a motion.
    undelivered_since: Instant,
    /// The bus had taken it when the job under way began.
    pub predates_job: bool,
}

/// Since when something is overdue that goes before all other polls.
const FIRST_OF_ALL: Instant = Instant::from_micros(0);
/// What a motor has not answered for so long it answers no more (the longest reply window,
/// GUARANTEES).
const LATEST_REPLY: Duration = Duration::from_millis(300);
/// How often a motor that does not answer is asked for who watches it.
const SILENT_POLL: Duration = Duration::from_millis(1_000);

impl Pending {
    pub fn is_waiting(&self) -> bool {
        self.until.is_some()
    }

    pub fn deadline(&self) -> Option<Instant> {
        self.until
    }

    /// When the frame had left.
    fn left_at(&self) -> Option<Instant> {
        self.until.map(|until| until - self.window)
    }

    /// Since when the motion in it has waited, if it is one that has not left.
    pub fn undelivered_since(&self) -> Option<Instant> {
        let waits = self.exchange == Exchange::Motion && self.until.is_none();
        waits.then_some(self.undelivered_since)
    }
}

/// A request that is under way no longer while its reply may still come.
#[derive(Debug, Clone, Copy)]
pub(super) struct Displaced {
    command: Command,
    slot: u8,
    /// Until when its reply is expected; `None` until the frame has left.
    until: Option<Instant>,
    /// Its window has closed; it is only remembered so that a late reply is known.
    given_up: bool,
}

impl Displaced {
    /// Whether its reply is due within its window.
    pub fn is_awaited(&self) -> bool {
        self.until.is_some() && !self.given_up
    }

    pub fn deadline(&self) -> Option<Instant> {
        self.until
    }
}

/// A request was given up, and no other before then: its late reply must not be taken for the next
/// one's. Only a setpoint does not wait for what was no setpoint.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quiet {
    exchange: Exchange,
    until: Instant,
}

impl Quiet {
    pub const NONE: Self = Self { exchange: Exchange::Velocity, until: Instant::from_micros(0) };

    /// From when on a request that is due at `at`, a setpoint or not, may go out.
    pub fn delays(&self, is_motion: bool, at: Instant) -> Instant {
        let waits = !is_motion || self.exchange == Exchange::Motion;
        if waits { at.max(self.until) } else { at }
    }
}

/// How long a motor has not answered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Silence {
    missed: u8,
    since: Instant,
}

impl Silence {
    pub const NONE: Self = Self { missed: 0, since: Instant::from_micros(0) };

    /// Shortest silence that counts as one, however fast the requests follow each other (GUARANTEES
    /// G3).
    const SHORTEST: Duration = Duration::from_millis(50);

    /// Another reply was missed, its request having waited for `window`. Returns whether that makes
    /// `enough`.
    fn goes_on(&mut self, now: Instant, window: Duration, enough: u8) -> bool {
        if self.missed == 0 {
            self.since = now - window;
        }
        self.missed = self.missed.saturating_add(1);
        self.missed >= enough && now.since(self.since) >= Self::SHORTEST
    }
}

impl Axis {
    /// The bus has taken what the axis wanted.
    pub fn handed(&mut self, now: Instant, exchange: Exchange, command: Command, slot: u8) {
        let unambiguous = !self.may_answer_an_older(now, &command);
        let motion = self.motion.as_ref().filter(|_| exchange == Exchange::Motion);
        self.pending = Some(Pending {
            exchange,
            command,
            slot,
            window: Duration::ZERO,
            until: None,
            unambiguous,
            once: motion.is_some_and(Motion::is_once),
            motion: motion.map_or(0, |motion| motion.number),
            undelivered_since: self.undelivered_since,
            predates_job: false,
        });
        self.note_handed(now, exchange);
    }

    /// The frame in `slot` has left; its reply may come within `window`.
    pub fn left(&mut self, now: Instant, slot: u8, window: Duration, out: &mut Outbox<'_>) {
        if let Some(displaced) = &mut self.displaced
            && displaced.slot == slot
            && displaced.until.is_none()
        {
            displaced.until = Some(now + window);
            self.unanswered_since =
                protocol::is_answered(&displaced.command, &self.config).then_some(now);
            return;
        }
        let Some(pending) = &mut self.pending else { return };
        if pending.slot != slot || pending.until.is_some() {
            return;
        }
        pending.window = protocol::slow_reply(&pending.command).unwrap_or(window);
        pending.until = Some(now + pending.window);
        let pending = *pending;
        self.job_left(&pending.command);
        let silence = self.unreachable_silence();
        if let Some(stop) = &mut self.stop {
            stop.left(now, pending.exchange, silence);
        }
        let is_answered = protocol::is_answered(&pending.command, &self.config);
        self.unanswered_since = is_answered.then_some(now);
        self.objections_due = 0;
        if !is_answered {
            self.pending = None;
            self.completed(now, &pending, Observation::default(), &[], out);
        }
    }

    /// Whether the frame in `slot` has not left and should not any more: a stop has pushed it
    /// aside, or a newer setpoint has taken its place.
    pub fn has_replaced(&self, slot: u8) -> bool {
        let waits = |of: u8, until: Option<Instant>| of == slot && until.is_none();
        let displaced = self.displaced.as_ref().is_some_and(|d| waits(d.slot, d.until));
        let superseded = self.pending.as_ref().is_some_and(|p| {
            // The same setpoint again is the same frame; the same distance again is another move.
            let replaced =
                if p.once { !self.is_latest(p.motion) } else { !self.is_in_force(&p.command) };
            p.exchange == Exchange::Motion && waits(p.slot, p.until) && replaced
        });
        displaced || superseded
    }

    /// Whether the request under way is answered by this node, which is not the axis's own.
    pub fn awaits_node(&self, node: u8) -> bool {
        let waiting = self.pending.as_ref().filter(|p| p.is_waiting());
        waiting.is_some_and(|p| p.command.sets() == Sets::Node(node))
    }

    /// Since when a reply is due that would meet the next frame to the motor on the bus, bit for
    /// bit up to their data: where both have one id neither loses the arbitration, and the
    /// error repeats with them until a controller is off.
    pub fn reply_with_our_id_since(&self) -> Option<Instant> {
        let same_id = Info::of_axis(&self.config).is_some_and(|info| info.free_ids);
        self.unanswered_since.filter(|_| same_id)
    }

    /// A request to another motor of the bus has left: this one may answer it as well, under the id
    /// that its own frames have.
    pub fn may_object(&mut self, now: Instant) {
        if !self.objects {
            return;
        }
        self.objections_due = self.objections_due.saturating_add(1);
        if !self.pending.as_ref().is_some_and(Pending::is_waiting) {
            self.unanswered_since = Some(now);
        }
    }

    /// Since when an objection is due, where one is.
    fn objection_due(&self, now: Instant) -> Option<Instant> {
        (self.objections_due > 0).then_some(now)
    }

    /// Whether the motor answers requests to others.
    pub fn objects(&self) -> bool {
        self.objects
    }

    /// The next frame to the motor has met its reply on the bus and was taken back: the reply is
    /// let pass first.
    pub fn reply_comes_first(&mut self, now: Instant) {
        self.unanswered_since = Some(now);
    }

    /// Whether the frame in `slot` is the request under way.
    pub fn has_pending(&self, slot: u8) -> bool {
        self.pending.as_ref().is_some_and(|p| p.slot == slot)
    }

    /// The frame in `slot` will not leave any more.
    pub fn withdrawn(&mut self, now: Instant, slot: u8) {
        if self.displaced.as_ref().is_some_and(|d| d.slot == slot && d.until.is_none()) {
            self.displaced = None;
        } else if let Some(pending) = self.pending.take_if(|p| p.slot == slot && p.until.is_none())
        {
            self.not_delivered(&pending);
            self.send_again(now, pending.exchange);
        }
    }

    /// Nobody has acknowledged this axis's frame in `slot` in time; it may still leave later. A
    /// stop stays under way: it is owed until it has left.
    pub fn unacknowledged(&mut self, now: Instant, slot: u8, out: &mut Outbox<'_>) {
        let stops = |p: &Pending| self.stop.is_some() && p.exchange.is_stop();
        if self.pending.as_ref().is_some_and(|p| p.slot == slot && p.until.is_none() && !stops(p)) {
            self.give_up_pending(now, out);
        }
    }

    /// A frame of the axis's motor with this data field has arrived. Returns whether it answered
    /// something.
    pub fn received(
        &mut self,
        now: Instant,
        received: &Received,
        data: &[u8],
        out: &mut Outbox<'_>,
    ) -> Reception {
        self.heard(now);
        if received.unasked() == Unasked::Objection {
            self.objects = true;
            self.objections_due = self.objections_due.saturating_sub(1);
        }
        // What has not left cannot be answered: an answer of that kind is one that came twice.
        let displaced = self.displaced.as_ref().filter(|displaced| displaced.until.is_some());
        let late =
            displaced.map(|displaced| protocol::judge(&displaced.command, received, &self.config));
        if let Some(verdict) = late.filter(|verdict| *verdict != Verdict::Unrelated) {
            if let Verdict::Answer(seen) = &verdict {
                self.late_speed(seen);
            }
            self.displaced = None;
            // The reply to what was sent in its place is still due.
            self.unanswered_since = self
                .unanswered_since
                .filter(|_| self.pending.as_ref().is_some_and(Pending::is_waiting));
            return Reception::Late;
        }
        let Some(pending) = self.pending.filter(Pending::is_waiting) else {
            // Late beyond everything that is remembered, but it has come.
            self.unanswered_since = self.objection_due(now);
            return self.unasked(now, received, out);
        };
        let verdict = protocol::judge(&pending.command, received, &self.config);
        if verdict != Verdict::Unrelated {
            self.unanswered_since = self.objection_due(now);
        }
        match verdict {
            Verdict::Unrelated => self.unasked(now, received, out),
            Verdict::Answer(seen) => {
                self.pending = None;
                self.silence = Silence::NONE;
                self.completed(now, &pending, seen, data, out);
                Reception::Answer
            }
            Verdict::Refused => {
                self.pending = None;
                self.silence = Silence::NONE;
                self.refused(now, &pending, out);
                Reception::Answer
            }
            Verdict::NotExecuted => {
                self.pending = None;
                self.silence = Silence::NONE;
                if pending.exchange == Exchange::Motion {
                    self.motion_silence = Silence::NONE;
                    self.thrown_back(now, &pending, out);
                }
                Reception::Answer
            }
        }
    }

    /// Closes windows that have passed, and notices what cannot be sent.
    pub fn expire_pending(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let is_over =
            |displaced: &mut Displaced| displaced.deadline().is_some_and(|until| until <= now);
        if let Some(displaced) = self.displaced.take_if(is_over)
            && displaced.is_awaited()
        {
            self.may_be_answered_late(now, &displaced.command);
        }
        if self.pending.as_ref().and_then(Pending::deadline).is_some_and(|until| until <= now) {
            self.give_up_pending(now, out);
        }
        self.expire_job(now, out);
        self.expire_stop(now, out);
    }

    /// Makes room for a stop. What was under way may still be answered, and is then not taken for
    /// the stop's reply.
    pub(super) fn displace(&mut self) {
        if let Some(pending) = self.pending.take() {
            let Pending { command, slot, until, .. } = pending;
            self.displaced = Some(Displaced { command, slot, until, given_up: false });
        }
    }

    /// A request was not answered within its window. Where its reply cannot be told from that of
    /// the stop, it must not be taken for it.
    fn may_be_answered_late(&mut self, now: Instant, command: &Command) {
        if self.is_answered_like_the_stop(command) {
            self.stop_like_reply_until = now + LATEST_REPLY;
        }
    }

    /// Whether this is the command of the stop under way. To one that is sent again the reply to
    /// the one before says the same.
    fn repeats_stop(&self, exchange: Exchange) -> bool {
        self.stop.is_some() && exchange == Exchange::Stop
    }

    fn is_answered_like_the_stop(&self, command: &Command) -> bool {
        let stop = protocol::command(Exchange::Stop, &self.config);
        stop.is_some_and(|stop| protocol::are_answered_alike(command, &stop, &self.config))
    }

    /// Whether a reply to this command may be the late one to a command sent before.
    fn may_answer_an_older(&self, now: Instant, command: &Command) -> bool {
        let displaced = self.displaced.as_ref().map(|displaced| &displaced.command);
        let is_alike = |older| protocol::are_answered_alike(older, command, &self.config);
        displaced.is_some_and(is_alike)
            || now < self.stop_like_reply_until && self.is_answered_like_the_stop(command)
    }

    /// Forgets what is under way, for a bus that starts anew.
    pub fn forget_exchanges(&mut self, now: Instant, out: &mut Outbox<'_>) {
        self.displaced = None;
        if self.pending.is_some() {
            self.give_up_pending(now, out);
        }
    }

    /// The axis is reached otherwise from now on: what is under way, or was, belongs to the motor
    /// that it had.
    pub(super) fn leave_bus(&mut self) {
        self.pending = None;
        self.displaced = None;
        self.unanswered_since = None;
        self.objects = false;
        self.silence = Silence::NONE;
        self.quiet = Quiet::NONE;
        self.state_poll_at = FIRST_OF_ALL;
    }

    fn give_up_pending(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let Some(pending) = self.pending.take() else { return };
        self.not_delivered(&pending);
        // A late reply must find nothing identical under way: the next request waits another
        // window, and what a stop may be mistaken for is remembered as long.
        let until = now + pending.window;
        let repeats_stop = self.repeats_stop(pending.exchange);
        if !repeats_stop {
            self.may_be_answered_late(now, &pending.command);
        }
        if !repeats_stop && pending.until.is_some() {
            self.quiet = Quiet { exchange: pending.exchange, until };
            if self.displaced.is_none() {
                let (command, slot, until) = (pending.command, pending.slot, Some(until));
                self.displaced = Some(Displaced { command, slot, until, given_up: true });
            }
        }
        let enough = self.config.missed_replies();
        let mut silent = self.silence.goes_on(now, pending.window, enough);
        // A motor that answers polls and no motion may be doing anything.
        if pending.exchange == Exchange::Motion {
            silent |= self.motion_silence.goes_on(now, pending.window, enough);
        }
        let unread = self.stays_unread(pending.exchange);
        // Whether a move that must not be sent twice was carried out is not known (GUARANTEES G2).
        if self.is_armed() && (silent || unread || pending.once) {
            self.trip(now, TripReason::MotorSilent, out);
            return;
        }
        if self.is_kept_holding() && silent && self.job.is_none() {
            // Whether it still holds is not known: its own timeout may have cut the output, or its
            // power is off.
            self.silence = Silence::NONE;
            self.stop(now, out);
            return;
        }
        if self.is_idle_or_holding() && self.job.is_none() && !self.is_kept_holding() {
            // Who watches a motor that does not answer must not take the others' time.
            self.state_poll_at = now + SILENT_POLL;
        }
        if pending.is_waiting() {
            self.stop_unanswered(now, pending.exchange, out);
        }
        self.job_unanswered(now, &pending, out);
    }

    fn completed(
        &mut self,
        now: Instant,
        pending: &Pending,
        seen: Observation,
        data: &[u8],
        out: &mut Outbox<'_>,
    ) {
        if !pending.unambiguous && !self.repeats_stop(pending.exchange) {
            // It may have been the reply to the one before: then its own is still to come.
            self.may_be_answered_late(now, &pending.command);
        }
        self.observe(now, &seen, out);
        if let (Some(run_time_ms), Some(asked)) = (seen.run_time_ms, pending.left_at()) {
            self.note_run_time(now, asked, run_time_ms, out);
        }
        self.judge_motion(now, pending, &seen, out);
        self.stop_answered(now, pending, &seen, out);
        self.job_answered(now, pending, &seen, data, out);
    }

    /// Looks whether the motor carries the motion out. Where its reply does not tell, the speed
    /// read next does.
    fn judge_motion(
        &mut self,
        now: Instant,
        pending: &Pending,
        seen: &Observation,
        out: &mut Outbox<'_>,
    ) {
        match (pending.exchange, seen.velocity_rad_s) {
            (Exchange::Motion, _) => {
                self.motion_silence = Silence::NONE;
                self.in_doubt = seen.may_be_thrown_back;
                self.not_executed &= self.in_doubt;
                if self.in_doubt {
                    self.state_poll_at = FIRST_OF_ALL;
                }
            }
            (Exchange::Velocity, Some(velocity)) if self.in_doubt => {
                self.in_doubt = false;
                if self.is_standstill(velocity) {
                    self.not_executed = false;
                } else {
                    self.thrown_back(now, pending, out);
                }
            }
            _ => {}
        }
    }

    fn refused(&mut self, now: Instant, pending: &Pending, out: &mut Outbox<'_>) {
        if self.is_armed() && self.stays_unread(pending.exchange) {
            self.trip(now, TripReason::MotorSilent, out);
            return;
        }
        if self.is_armed() && pending.exchange == Exchange::Motion {
            self.trip(now, TripReason::CommandRefused { faults: self.measured.fault_word() }, out);
            return;
        }
        self.stop_refused(now, pending.exchange, out);
        self.job_refused(now, pending.exchange, out);
    }

    /// Counts a request that told nothing for what no other reply carries, the fault word and the
    /// run time, and says whether there were too many: a motor that answers everything else is
    /// as good as silent.
    fn stays_unread(&mut self, exchange: Exchange) -> bool {
        let unread = match exchange {
            Exchange::Faults => &mut self.faults_unread,
            Exchange::RunTime => &mut self.run_time_unread,
            _ => return false,
        };
        *unread = unread.saturating_add(1);
        *unread >= self.config.missed_replies()
    }

    /// An echo proves receipt, not motion: once it is asked again, twice it is a refusal
    /// (PROTOCOL-NOTES R20, R30).
    fn thrown_back(&mut self, now: Instant, pending: &Pending, out: &mut Outbox<'_>) {
        if !self.is_armed() {
            return;
        }
        if self.not_executed || pending.once {
            self.trip(now, TripReason::CommandRefused { faults: self.measured.fault_word() }, out);
            return;
        }
        self.not_executed = true;
        // The reason first, whatever else is overdue.
        self.fault_poll_at = FIRST_OF_ALL;
        self.motion_had_its_turn = true;
        self.resend_motion(now);
    }

    /// A frame nobody asked for: what it says of faults counts all the same, and of what a motor
    /// sends by itself everything.
    fn unasked(&mut self, now: Instant, received: &Received, out: &mut Outbox<'_>) -> Reception {
        let seen = received.observation(&self.config);
        let told = match received.unasked() {
            Unasked::Telemetry(_) => seen,
            _ => Observation { faults: seen.faults, ..Observation::default() },
        };
        self.observe(now, &told, out);
        Reception::Unasked
    }
}

/// What a frame was to the axis it came for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reception {
    /// It answered the request under way.
    Answer,
    /// It answered a request that a stop had displaced.
    Late,
    /// Nobody had asked.
    Unasked,
}
