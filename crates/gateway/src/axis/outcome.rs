//! What becomes of the requests of an axis, and what follows from it.

use super::Axis;
use super::first_stop::FirstStop;
use super::state::State;
use crate::measured::Observation;
use crate::outbox::Outbox;
use crate::protocol::{self, Command, Exchange, Info, Outcome, Received, Sets, Unasked};
use crate::time::{Duration, Instant};
use crate::transaction::{Match, Transaction};
use host_protocol::{CycleResult, Error, TripReason};
use serde::{Deserialize, Serialize};

/// Since when something is overdue that goes before all other polls.
const FIRST_OF_ALL: Instant = Instant::from_micros(0);
/// How often a motor that does not answer is asked for who watches it.
const SILENT_POLL: Duration = Duration::from_millis(1_000);

/// How long a motor has not answered.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Silence {
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
        let Self { transactions, state, config, .. } = self;
        let request = transactions.begin(now, exchange, command, slot, config);
        if let State::Active(armed, motion) = state
            && exchange == Exchange::Motion
        {
            (request.motion, request.once) = (armed.motions, motion.once);
            request.deliver_by = armed.deliver_by;
        }
        self.note_handed(now, exchange);
        self.note_restart(now, exchange, &command);
    }

    /// The frame in `slot` has left; its reply may come within `window`, and where it `waits` for the
    /// bus behind that. Of a setpoint that nothing else is under way beside, returns by when that
    /// is: nothing more follows.
    pub fn transmitted(
        &mut self,
        now: Instant,
        slot: u8,
        window: Duration,
        waits: bool,
        out: &mut Outbox<'_>,
    ) -> Option<Instant> {
        let request = self.transactions.transmitted(now, slot, window, waits, &self.config)?;
        self.first_stop_left(request.exchange);
        self.prolong_pause(now);
        self.note_restart(now, request.exchange, &request.command);
        if let Some(job) = &mut self.job {
            job.note_transmitted(&request.command);
        }
        if self.stop().is_some() {
            let silence = self.unreachable_silence();
            if let Some(stop) = self.stop_mut() {
                stop.transmitted(now, request.exchange, silence);
            }
        }
        if self.transactions.is_idle() {
            self.answered(now, &request, &Observation::default(), &[], out);
        }
        let is_setpoint = matches!(self.state, State::Active(..)) && self.job.is_none();
        let reply_by = self.transactions.current()?.deadline()?;
        (is_setpoint && self.reply_with_our_id_since().is_none()).then_some(reply_by)
    }

    /// Whether the frame in `slot` has not left and should not any more: a stop has preempted it,
    /// a newer setpoint has taken its place, or its time is over while the axis has still to be
    /// reached. The same setpoint again is the same frame; the same distance again is another move.
    pub fn has_replaced(&self, now: Instant, slot: u8) -> bool {
        let has_expired = self.has_expired(now);
        self.transactions.is_replaced(slot, |request| {
            let is_in_force = || {
                self.is_latest(request.motion)
                    || !request.once && self.is_in_force(&request.command)
            };
            has_expired || request.exchange == Exchange::Motion && !is_in_force()
        })
    }

    /// Whether the request under way is answered by this node, which is not the axis's own.
    pub fn awaits_node(&self, node: u8) -> bool {
        let awaited = self.transactions.current().filter(|current| current.is_awaited());
        awaited.is_some_and(|current| current.command.sets() == Sets::Node(node))
    }

    /// Since when a reply is due that would meet the next frame to the motor on the bus, bit for
    /// bit up to their data: where both have one id neither loses the arbitration, and the
    /// error repeats with them until a controller is off.
    pub fn reply_with_our_id_since(&self) -> Option<Instant> {
        let since = self.transactions.owed_since?;
        Info::of_axis(&self.config).filter(|info| info.free_ids).map(|_| since)
    }

    /// Whether the axis is stopped, and the [reply](Self::reply_with_our_id_since) is one that no
    /// manual prints: the stop lets it have its turn, and no more.
    pub fn stops_past_unprinted_reply(&self) -> bool {
        self.transactions.is_unprinted && !self.transactions.objects && self.stop().is_some()
    }

    /// The frame in `slot` will not leave any more: what it was for is due again.
    pub fn cancelled(&mut self, now: Instant, slot: u8) {
        if let Some(Transaction { exchange, command, .. }) = self.transactions.waiting_in(slot) {
            // The motor was not told.
            if self.is_restart(*exchange, command) {
                self.restarts_until = Instant::default();
            } else if *exchange == Exchange::RenewTimeout {
                self.timeout_not_told();
            }
        }
        let Some(request) = self.transactions.cancelled(slot) else { return };
        self.not_delivered(&request);
        match (request.exchange, &mut self.state) {
            (Exchange::Motion, _) => self.motion_not_sent(now),
            (exchange, State::Stopping(stop) | State::Tripped(_, stop)) => {
                stop.cancelled(now, exchange);
            }
            (Exchange::Faults, State::Armed(armed) | State::Active(armed, _)) => {
                armed.fault_poll_at = now;
            }
            (exchange, _) => {
                self.state_poll_at = now;
                // It was not asked: the poll that was counted is the next one again.
                let counted = self.poll_index;
                self.poll_index = counted.wrapping_sub(1);
                if !self.is_next_poll(now, exchange) {
                    self.poll_index = counted;
                }
            }
        }
    }

    /// Nobody has acknowledged this axis's frame in `slot` in time; it may still leave later. A
    /// stop stays under way: it is owed until it has left.
    pub fn unacknowledged(&mut self, now: Instant, slot: u8, out: &mut Outbox<'_>) {
        let stops = self.stop().is_some();
        if self.transactions.has_in(slot)
            && self.transactions.with_port().is_some_and(|exchange| !(stops && exchange.is_stop()))
        {
            self.give_up(now, out);
        }
    }

    /// Forgets what is under way, for a bus that starts anew.
    pub fn forget_requests(&mut self, now: Instant, out: &mut Outbox<'_>) {
        self.transactions.forget_former();
        // Who answers there may be another one.
        self.first_stop = FirstStop::OWED;
        let not_left = self.transactions.with_port().filter(|exchange| exchange.is_stop());
        self.give_up(now, out);
        if let (Some(exchange), Some(stop)) = (not_left, self.stop_mut()) {
            stop.cancelled(now, exchange);
        }
    }

    /// Closes windows that have passed, and notices what cannot be sent.
    pub(super) fn expire_requests(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let stops = self.stop().is_some();
        if let Some(request) = self.transactions.expire(now, stops, &self.config) {
            self.unanswered(now, &request, out);
        }
        self.expire_job(now, out);
        self.expire_stop(now, out);
    }

    /// The bus has had room for the late replies that are due since then or before: they come no
    /// more.
    pub fn miss_overdue(&mut self, now: Instant, due_since: Instant, out: &mut Outbox<'_>) {
        self.transactions.miss_overdue(now, due_since);
        self.expire_requests(now, out);
    }

    fn give_up(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let stops = self.stop().is_some();
        if let Some(request) = self.transactions.give_up(now, stops, &self.config) {
            self.unanswered(now, &request, out);
        }
    }

    /// A frame of the axis's motor with this data field has arrived. Returns what it is, if it does
    /// not end the request under way.
    pub fn received(
        &mut self,
        now: Instant,
        received: &Received,
        data: &[u8],
        out: &mut Outbox<'_>,
    ) -> Option<Unasked> {
        let mut seen = Observation::default();
        let found = self.transactions.received(now, received, &self.config, &mut seen);
        // What a motor says by itself does not show that it hears us; others show that they have
        // power.
        let hears = !matches!(found, Match::Unasked) || !self.is_polled_to_hold();
        // Who has it restart has it hold again behind that.
        if hears && self.may_have_let_go(now) && !self.waits_for_restart() {
            self.hold_again(now, out);
            self.fail_what_was_ignored(now, out);
        }
        if hears {
            self.heard(now);
        }
        let (request, outcome) = match found {
            Match::Ends(request, outcome) => (request, outcome),
            Match::Late => {
                self.late_speed(&seen);
                return Some(Unasked::Late);
            }
            Match::Unasked => {
                self.first_stop_may_be_heard(received);
                return Some(self.unasked(now, received, out));
            }
        };
        self.silence = Silence::NONE;
        self.first_stop_heard(request.exchange);
        match outcome {
            Outcome::Answered => self.answered(now, &request, &seen, data, out),
            Outcome::Refused => self.refused(now, &request, out),
            Outcome::Echoed if request.exchange == Exchange::Motion => {
                if let Some(armed) = self.armed_mut() {
                    armed.motion_silence = Silence::NONE;
                }
                self.echoed(now, &request, out);
            }
            _ => {}
        }
        None
    }

    /// A request was given up: its window has closed, or its frame cannot leave.
    fn unanswered(&mut self, now: Instant, request: &Transaction, out: &mut Outbox<'_>) {
        self.not_delivered(request);
        self.first_stop_may_be_lost(request.exchange);
        self.part_over(request, CycleResult::NoReply);
        let enough = self.config.missed_replies();
        let mut silent = self.silence.goes_on(now, request.window(), enough);
        // A motor that answers polls and no motion may be doing anything.
        if request.exchange == Exchange::Motion
            && let Some(armed) = self.armed_mut()
        {
            silent |= armed.motion_silence.goes_on(now, request.window(), enough);
        }
        let unread = self.stays_unread(request.exchange);
        // Whether a move that must not be sent twice was carried out is not known (GUARANTEES G2).
        if self.is_armed() && (silent || unread || request.once) {
            self.trip(now, TripReason::MotorSilent, out);
            return;
        }
        if self.is_idle_or_holding() && self.job.is_none() && !self.is_kept_holding() {
            // Who watches a motor that does not answer must not take the others' time.
            self.state_poll_at = now + SILENT_POLL;
        }
        if request.is_awaited() {
            self.stop_goes_on(now, request, Outcome::NoReply, &Observation::default(), out);
        }
        self.job_unanswered(now, request, out);
        // Whether it still holds is not known: its own timeout may have cut the output, or its
        // power is off. Who only asks does not keep it from being told again.
        if self.is_kept_holding() && silent && !self.is_busy_with_more_than_a_question() {
            self.silence = Silence::NONE;
            self.halt(now, out);
        }
    }

    fn answered(
        &mut self,
        now: Instant,
        request: &Transaction,
        seen: &Observation,
        data: &[u8],
        out: &mut Outbox<'_>,
    ) {
        let result = match self.transactions.motion_reply_is_ambiguous(now) {
            true => CycleResult::Ambiguous,
            false => CycleResult::Answered,
        };
        if !request.unambiguous && !request.repeats(self.stop().is_some()) {
            // It may have been the reply to the one before: then its own is still to come.
            self.transactions.may_be_answered_late(now, &request.command, &self.config);
        }
        self.observe(now, seen, out);
        if let (Some(run_time_ms), Some(asked)) = (seen.run_time_ms, request.transmitted_at()) {
            self.note_run_time(now, asked, run_time_ms, out);
        }
        self.part_over(request, result);
        self.judge_motion(now, request, seen, out);
        if self.stop().is_some() {
            self.stop_goes_on(now, request, Outcome::Answered, seen, out);
        }
        self.job_answered(now, request, seen, data, out);
    }

    /// Looks whether the motor carries the motion out. Where its reply does not tell, the speed
    /// read next does.
    fn judge_motion(
        &mut self,
        now: Instant,
        request: &Transaction,
        seen: &Observation,
        out: &mut Outbox<'_>,
    ) {
        let still = self.still(seen);
        let Some(armed) = self.armed_mut() else { return };
        match (request.exchange, still) {
            (Exchange::Motion, _) => {
                armed.motion_silence = Silence::NONE;
                armed.echo.is_doubtful = seen.may_be_thrown_back;
                armed.echo.was_echoed &= seen.may_be_thrown_back;
                if seen.may_be_thrown_back {
                    self.state_poll_at = FIRST_OF_ALL;
                } else if seen.velocity_rad_s.is_some()
                    && protocol::tells_state(&request.command)
                    && !request.once
                {
                    self.save_poll(now);
                }
            }
            (Exchange::Velocity, Some(still)) if armed.echo.is_doubtful => {
                armed.echo.is_doubtful = false;
                if still {
                    armed.echo.was_echoed = false;
                } else {
                    self.echoed(now, request, out);
                }
            }
            _ => {}
        }
    }

    /// An echo proves receipt, not motion: once it is asked again, twice it is a refusal
    /// (PROTOCOL-NOTES R20, R30).
    fn echoed(&mut self, now: Instant, request: &Transaction, out: &mut Outbox<'_>) {
        let Some(armed) = self.armed_mut() else { return };
        if armed.echo.was_echoed || request.once {
            self.trip(now, TripReason::CommandRefused { faults: self.measured.fault_word() }, out);
            return;
        }
        armed.echo.was_echoed = true;
        // The reason first, whatever else is overdue.
        armed.fault_poll_at = FIRST_OF_ALL;
        armed.motion_was_last = true;
        self.resend_motion(now);
    }

    fn refused(&mut self, now: Instant, request: &Transaction, out: &mut Outbox<'_>) {
        if self.is_armed() && self.stays_unread(request.exchange) {
            self.trip(now, TripReason::MotorSilent, out);
            return;
        }
        if self.is_armed() && request.exchange == Exchange::Motion {
            // The fault word that was read last is older than the refusal: the stop reads it.
            self.trip(now, TripReason::CommandRefused { faults: None }, out);
            return;
        }
        let faults = self.measured.fault_word();
        let error = Error::Refused { axis: self.index, faults }.number();
        self.part_over(request, CycleResult::Refused { error });
        self.stop_goes_on(now, request, Outcome::Refused, &Observation::default(), out);
        self.job_refused(now, request.exchange, out);
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

    /// A frame nobody asked for: what it says of faults counts all the same, and of what a motor
    /// sends by itself everything. Returns what it is.
    fn unasked(&mut self, now: Instant, received: &Received, out: &mut Outbox<'_>) -> Unasked {
        let seen = received.observation(&self.config);
        let unasked = received.unasked();
        let told = match unasked {
            Unasked::Telemetry(_) => seen,
            _ => Observation { faults: seen.faults, ..Observation::default() },
        };
        self.observe(now, &told, out);
        unasked
    }

    /// The bus has not sent what it had taken.
    fn not_delivered(&mut self, request: &Transaction) {
        if let Some(armed) = self.armed_mut() {
            armed.deliver_by = armed.deliver_by.min(request.deliver_by());
        }
    }

    /// When the setpoint in force is late, but for the time that its bus may take: its
    /// refresh time after it was accepted, or after its refresh was due. What a host has been told
    /// to be accepted is on the wire in time, or the axis trips (GUARANTEES G2): this looks at what
    /// has left, never at who should have sent it.
    pub fn delivery_due_at(&self) -> Option<Instant> {
        let State::Active(armed, _) = &self.state else { return None };
        let taken = self.transactions.current().map_or(Instant::NEVER, Transaction::deliver_by);
        let deliver_by = taken.min(armed.deliver_by);
        (deliver_by < Instant::NEVER).then_some(deliver_by)
    }
}
