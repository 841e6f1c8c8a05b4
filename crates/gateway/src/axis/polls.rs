//! What an axis wants to send next.

use super::state::{Armed, State};
use super::{Axis, Stop};
use crate::protocol::{self, Command, Exchange, Info};
use crate::time::{Duration, Instant};
use core::num::NonZeroU64;
use host_protocol::AxisParameter;

/// Where the position is polled, so many turns are in `state_poll_us`, the first of them its own.
const TURNS: NonZeroU64 = NonZeroU64::new(2).unwrap();
/// Of so many polls of other values of an armed motor one asks for its run time, at most: slow
/// polls ask for it each second, or every other time.
const RUN_TIME_EVERY: u64 = 16;
const RUN_TIME_WITHIN: Duration = Duration::from_millis(1_000);

/// What goes first on a bus. The order is the order of sending.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Priority {
    /// A stop of which nothing has been sent yet, of a motor that may move.
    FirstStop,
    /// The same of a motor that was at rest.
    FirstStopAtRest,
    /// The rest of a stop: what stops.
    Stop,
    /// And what shows that it has, or keeps a motor holding: on the bus as everything else, unless
    /// that is barred by a stop that cannot leave.
    StopStep,
    /// Everything else.
    Ordinary,
    /// Polls of an idle axis, for who watches it.
    Watch,
}

impl Priority {
    /// Whether nothing of the stop has been sent yet.
    pub fn is_first_stop(self) -> bool {
        matches!(self, Self::FirstStop | Self::FirstStopAtRest)
    }
}

/// A request that an axis wants sent now.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Request {
    pub priority: Priority,
    /// Since when.
    pub due: Instant,
    pub exchange: Exchange,
}

/// What an axis asks for next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Next {
    This(Exchange),
    /// The next poll. Which one that is takes a while to find, and matters only when it is due.
    Poll,
}

impl Axis {
    /// What the axis wants sent at `now`. Its [command](Self::command_for) takes longer to find
    /// than this, and only one axis is served.
    pub fn next_request(&self, now: Instant) -> Option<Request> {
        if !self.transactions.is_idle() || !self.is_configured() || now < self.nothing_before() {
            return None;
        }
        let (next, at) = self.next(now)?;
        if at > now {
            return None;
        }
        let exchange = match next {
            Next::This(exchange) => exchange,
            Next::Poll => self.poll_exchange()?,
        };
        let priority = match self.stop() {
            Some(stop) if !stop.has_left() && stop.from_rest => Priority::FirstStopAtRest,
            Some(stop) if !stop.has_left() => Priority::FirstStop,
            Some(_) if exchange.is_stop() => Priority::Stop,
            Some(stop) if stop.next().is_some_and(|(next, _)| next == exchange) => {
                Priority::StopStep
            }
            // Whatever is polled, the motor hears something.
            None if next == Next::Poll && self.is_kept_holding() => Priority::StopStep,
            None if self.is_idle_or_holding() && self.job.is_none() => Priority::Watch,
            _ => Priority::Ordinary,
        };
        Some(Request { priority, due: at, exchange })
    }

    /// Whether its motor holds, or may, and must hear something although a stop bars what is no
    /// stop: nobody tells one that is not moved what it holds again.
    pub fn must_be_fed(&self) -> bool {
        let holds = match self.state {
            State::Holding | State::Armed(_) => true,
            State::Arming => self.job.as_ref().is_some_and(|job| job.output_on),
            _ => false,
        };
        holds && self.is_polled_to_hold()
    }

    /// What such a motor hears, if it is due: where what a job asks of the axis is barred, an arming
    /// as well, a poll goes past it.
    pub fn feeding_request(&self, now: Instant) -> Option<Request> {
        if self.is_armed() {
            let request = self.next_request(now)?;
            return Some(Request { priority: Priority::StopStep, ..request });
        }
        let due = self.feeding_poll_at().filter(|due| *due <= now)?;
        let exchange = self.poll_exchange()?;
        let is_free = self.transactions.is_idle();
        is_free.then_some(Request { priority: Priority::StopStep, due, exchange })
    }

    /// When the next poll that keeps the motor holding is due.
    fn feeding_poll_at(&self) -> Option<Instant> {
        self.must_be_fed().then(|| self.from(Next::Poll, self.state_poll_at).1)
    }

    /// When what a job does not keep waiting is due: the stop behind a clearing, and what keeps a
    /// motor holding.
    pub fn due_beside_job(&self) -> Option<Instant> {
        self.job.as_ref()?;
        self.stop().and_then(Stop::next).map(|(_, at)| at).or_else(|| self.feeding_poll_at())
    }

    /// The command that serves an exchange now; `None` where there is none to send.
    pub fn command_for(&self, exchange: Exchange) -> Option<Command> {
        let exchange = match exchange {
            Exchange::Motion => return self.motion().map(|motion| motion.command),
            Exchange::Native => return self.native_command(),
            Exchange::RenewTimeout => Exchange::SetTimeout { timeout_ms: self.timeout_to_write()? },
            other => other,
        };
        protocol::command(exchange, &self.config)
    }

    /// Nothing is wanted before, as a short look tells: every axis is asked whenever its bus may
    /// send.
    fn nothing_before(&self) -> Instant {
        if self.job.is_some() {
            return Instant::default();
        }
        match &self.state {
            State::Stopping(_) | State::Tripped(..) => Instant::default(),
            _ if self.part_read().is_some() => Instant::default(),
            State::Armed(armed) => armed.fault_poll_at.min(self.state_poll_at),
            State::Active(armed, motion) => {
                let polls = armed.fault_poll_at.min(self.state_poll_at);
                motion.due.map_or(polls, |due| polls.min(due))
            }
            _ => self.state_poll_at,
        }
    }

    /// When the axis will want something, or is to be asked again, if nothing happens before.
    pub fn next_request_at(&self, now: Instant) -> Option<Instant> {
        let ask_again = self.nothing_before();
        if now < ask_again { Some(ask_again) } else { self.next(now).map(|(_, at)| at) }
    }

    /// What comes next and the time from which on it is wanted. Whatever is overdue longest goes
    /// first.
    fn next(&self, now: Instant) -> Option<(Next, Instant)> {
        // A motion of a job is over when its time is, as every other.
        let is_over = |exchange| {
            exchange == Exchange::Motion
                && !self.motion().is_some_and(|motion| motion.is_permitted(now))
        };
        let job = self.job_step().filter(|exchange| !is_over(*exchange));
        let job = job.map(|exchange| (Next::This(exchange), self.job_since()));
        match &self.state {
            State::Stopping(stop) | State::Tripped(_, stop) => {
                let next = stop.next().map(|(exchange, at)| (Next::This(exchange), at));
                match (next, job) {
                    // A confirmed stop is only repeated: a clearing comes between.
                    (Some((Next::This(Exchange::Stop), at)), Some(_)) if at > now => {
                        self.earliest(&[job]).filter(|(_, job_at)| *job_at < at).or(next)
                    }
                    (Some((_, at)), Some(_)) if at > now => self.earliest(&[job, next]),
                    (None, Some(_)) => self.earliest(&[job]),
                    // Nor does what ends a move to a position wait for a late reply.
                    (Some((Next::This(Exchange::Stop | Exchange::PositionStop), _)), _) => next,
                    (next, _) => self.earliest(&[next]),
                }
            }
            State::Armed(armed) | State::Active(armed, _) => {
                let mut other = self.from(Next::This(Exchange::Faults), armed.fault_poll_at);
                let mut consider = |candidate: (Next, Instant)| {
                    if candidate.1 < other.1 {
                        other = candidate;
                    }
                };
                consider(self.from(Next::Poll, self.state_poll_at));
                if let Some((read, since)) = self.part_read() {
                    consider(self.from(Next::This(read), since));
                }
                if let Some((next, since)) = job {
                    consider(self.from(next, since));
                }
                let motion = self.motion().filter(|motion| motion.is_permitted(now));
                let Some(due) = motion.and_then(|motion| motion.due) else { return Some(other) };
                let motion = self.from(Next::This(Exchange::Motion), due);
                Some(choose(now, armed.motion_was_last, motion, other))
            }
            State::Idle | State::Holding => {
                let polled = self.is_kept_holding() || self.watched;
                let poll = polled.then_some((Next::Poll, self.state_poll_at));
                self.behind_first_stop(self.earliest(&[job, poll]))
            }
            State::Unconfigured | State::Arming => self.behind_first_stop(self.earliest(&[job])),
        }
    }

    /// Puts what a motor that is new to us must hear first in the place of what is wanted.
    fn behind_first_stop(&self, next: Option<(Next, Instant)>) -> Option<(Next, Instant)> {
        let (wanted, at) = next?;
        Some((self.owed_first().map_or(wanted, Next::This), at))
    }

    fn earliest(&self, candidates: &[Option<(Next, Instant)>]) -> Option<(Next, Instant)> {
        let mut earliest: Option<(Next, Instant)> = None;
        for (next, at) in candidates.iter().flatten() {
            let candidate = self.from(*next, *at);
            if earliest.is_none_or(|(_, before)| candidate.1 < before) {
                earliest = Some(candidate);
            }
        }
        earliest
    }

    /// What is wanted from a time on, and from when on it may go out.
    fn from(&self, next: Next, at: Instant) -> (Next, Instant) {
        let is_motion = next == Next::This(Exchange::Motion);
        (next, self.transactions.not_before(is_motion, at))
    }

    /// The next poll.
    fn poll_exchange(&self) -> Option<Exchange> {
        if self.is_idle_or_holding() { self.idle_poll() } else { self.armed_poll() }
    }

    /// Whether this is the poll that is due; an axis that is being armed has none.
    pub(super) fn is_next_poll(&self, now: Instant, exchange: Exchange) -> bool {
        self.state_poll_at <= now
            && !matches!(self.state, State::Arming)
            && self.poll_exchange() == Some(exchange)
    }

    /// From one poll to the next: a motor that holds, or moves by a command that is not sent
    /// again, must hear something as often as a setpoint would tell it.
    #[inline(never)]
    pub(super) fn turn(&self) -> Duration {
        let configured = self.config.state_poll();
        let turn = if self.polls_position() { configured.part(TURNS) } else { configured };
        let unfed = match self.motion() {
            Some(motion) => motion.once,
            None => match self.state {
                State::Idle => false,
                State::Holding => self.is_kept_holding(),
                // Without it the motor lets go, or locks its brake.
                _ => self.is_polled_to_hold() && self.must_stand(),
            },
        };
        if unfed { turn.min(self.refresh()) } else { turn }
    }

    /// Whether every other poll is one of the position. It is not where nobody asks but what keeps
    /// the motor holding.
    #[inline(never)]
    fn polls_position(&self) -> bool {
        self.can(Exchange::Position) && (self.watched || !self.is_kept_holding())
    }

    /// So many polls, beside those of the fault word, are due in so long while setpoints go out, at
    /// most: a speed that the replies to them tell is not asked for.
    pub fn polls_in_motion(&self) -> (u64, Duration) {
        let state_poll = self.config.state_poll();
        let info = Info::of_axis(&self.config).filter(|_| self.can(Exchange::Position));
        let Some(info) = info else { return (1, state_poll) };
        let saved = info.angle.is_some() && self.refresh() <= state_poll.part(TURNS);
        let others = if saved { self.run_time_every() as u64 } else { 1 };
        (others + 1, state_poll.times(others))
    }

    /// Counts the polls of other values than the position; `None` where the next one is of the
    /// position.
    #[inline(never)]
    fn turn_of_others(&self) -> Option<usize> {
        match self.polls_position() {
            true => (self.poll_index % 2 == 1).then_some(self.poll_index / 2),
            false => Some(self.poll_index),
        }
    }

    /// The next poll of an armed axis: of those that are not of the position every third is one
    /// that a limit or a watcher asks for.
    #[inline(never)]
    fn armed_poll(&self) -> Option<Exchange> {
        let asks = |armed: &Armed| armed.echo.is_doubtful || armed.uncommanded_since.is_some();
        if self.armed().is_some_and(asks) {
            return Some(Exchange::Velocity);
        }
        let Some(index) = self.turn_of_others() else { return Some(Exchange::Position) };
        if self.is_turn_of_run_time(index) {
            return Some(Exchange::RunTime);
        }
        let info = Info::of_axis(&self.config)?;
        let (round, place) = (index / 3, index % 3);
        let further = if place == 2 { self.nth(info.state, round, info.polls) } else { None };
        further.or_else(|| self.nth(info.polls, index - round, &[]))
    }

    /// The reply to a setpoint has told the speed: a poll for it that is due before the next reply
    /// is not sent.
    pub(super) fn save_poll(&mut self, now: Instant) {
        if self.state_poll_at <= now + self.refresh()
            && self.armed_poll() == Some(Exchange::Velocity)
        {
            self.state_poll_at = self.state_poll_at.max(now) + self.turn();
            self.poll_index = self.poll_index.wrapping_add(1);
        }
    }

    /// Where the motor tells for how long it has run, it is asked now and then: it may have
    /// restarted by itself.
    fn is_turn_of_run_time(&self, index: usize) -> bool {
        index.wrapping_add(1).is_multiple_of(self.run_time_every()) && self.can(Exchange::RunTime)
    }

    #[inline(never)]
    fn run_time_every(&self) -> usize {
        let every = RUN_TIME_WITHIN.as_micros() / self.config.state_poll().as_micros().max(1);
        usize::try_from(every.clamp(2, RUN_TIME_EVERY)).unwrap_or(2)
    }

    /// Whether what an exchange reads is limited by the configuration, or a host watches the axis
    /// or has a cycle tell of it.
    fn is_asked_for(&self, exchange: Exchange) -> bool {
        let limited = |parameter| self.config.float(parameter).is_some();
        self.watched
            || self.part.tells_slow
            || match exchange {
                Exchange::Current => limited(AxisParameter::CurrentLimitA),
                Exchange::MotorTemperature | Exchange::DriverTemperature => {
                    limited(AxisParameter::TemperatureLimitC)
                }
                _ => false,
            }
    }

    /// The poll of an axis at rest: whether a motor that holds turns is asked in every other turn
    /// that is not of the position, whatever else a host wants to know.
    fn idle_poll(&self) -> Option<Exchange> {
        let holds = self.is_kept_holding();
        let Some(index) = self.turn_of_others() else { return Some(Exchange::Position) };
        if holds && self.is_turn_of_run_time(index) {
            return Some(Exchange::RunTime);
        }
        if holds && (!self.watched || index.is_multiple_of(2)) {
            return Some(Exchange::Velocity);
        }
        let state = Info::of_axis(&self.config)?.state;
        self.nth(state, if holds { index / 2 } else { index }, &[])
    }

    /// The exchange at a place that counts on and on, of those that this motor has commands for and
    /// that have no turns of their own; where others are polled, of those that are asked for beside
    /// them.
    #[inline(never)]
    fn nth(&self, exchanges: &[Exchange], index: usize, polled: &[Exchange]) -> Option<Exchange> {
        let beside = |exchange: &Exchange| {
            polled.is_empty()
                || *exchange != Exchange::Faults
                    && !polled.contains(exchange)
                    && self.is_asked_for(*exchange)
        };
        let wanted = |exchange: &&Exchange| {
            **exchange != Exchange::Position && self.can(**exchange) && beside(exchange)
        };
        let count = exchanges.iter().filter(wanted).count();
        exchanges.iter().filter(wanted).nth(index.checked_rem(count)?).copied()
    }
}

/// Motion goes first, but not twice in a row while something else is due.
fn choose(
    now: Instant,
    motion_was_last: bool,
    motion: (Next, Instant),
    other: (Next, Instant),
) -> (Next, Instant) {
    let other_first = match (motion.1 <= now, other.1 <= now) {
        (true, true) => motion_was_last,
        (false, false) => other.1 < motion.1,
        (_, other_is_due) => other_is_due,
    };
    if other_first { other } else { motion }
}
