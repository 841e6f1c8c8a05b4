//! What an axis wants to send next.

use super::Axis;
use super::state::{Armed, State};
use crate::protocol::{self, Command, Exchange, Info};
use crate::time::{Duration, Instant};
use host_protocol::AxisParameter;

/// Of so many polls of an armed motor one asks for its run time, at most: slow polls ask for it
/// each second, or every other time.
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
            Some(stop) if !stop.has_left() && stop.is_from_rest() => Priority::FirstStopAtRest,
            Some(stop) if !stop.has_left() => Priority::FirstStop,
            Some(_) if exchange.is_stop() => Priority::Stop,
            Some(stop) if stop.next().is_some_and(|(next, _)| next == exchange) => {
                Priority::StopStep
            }
            None if self.is_idle_or_holding() && self.job.is_none() => {
                let holds = self.is_kept_holding() && exchange == Exchange::Velocity;
                if holds { Priority::StopStep } else { Priority::Watch }
            }
            _ => Priority::Ordinary,
        };
        Some(Request { priority, due: at, exchange })
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
        let job = self.job_step().map(|exchange| (Next::This(exchange), self.job_since()));
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
                    (Some((Next::This(Exchange::Stop), _)), _) => next,
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
                self.earliest(&[job, poll])
            }
            State::Unconfigured | State::Arming => self.earliest(&[job]),
        }
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

    /// The next poll of an armed axis: every third is one that a limit or a
    /// watcher asks for.
    fn armed_poll(&self) -> Option<Exchange> {
        let asks = |armed: &Armed| armed.echo.is_doubtful || armed.uncommanded_since.is_some();
        if self.armed().is_some_and(asks) {
            return Some(Exchange::Velocity);
        }
        // Where the motor tells for how long it has run, it is asked now and then: it may have
        // restarted by itself.
        if self.poll_index.wrapping_add(1).is_multiple_of(self.run_time_every())
            && self.can(Exchange::RunTime)
        {
            return Some(Exchange::RunTime);
        }
        let info = Info::of_axis(&self.config)?;
        let (round, place) = (self.poll_index / 3, self.poll_index % 3);
        let further = |exchange: &Exchange| {
            *exchange != Exchange::Faults
                && !info.polls.contains(exchange)
                && self.is_asked_for(*exchange)
        };
        if place == 2 {
            let count = info.state.iter().filter(|exchange| further(exchange)).count();
            if let Some(index) = round.checked_rem(count) {
                return info.state.iter().copied().filter(further).nth(index);
            }
        }
        self.cyclic(info.polls, self.poll_index - round)
    }

    /// The reply to a setpoint has told the speed: a poll for it that is due before the next reply
    /// is not sent.
    pub(super) fn save_poll(&mut self, now: Instant) {
        if self.state_poll_at <= now + self.refresh()
            && self.armed_poll() == Some(Exchange::Velocity)
        {
            self.state_poll_at = self.state_poll_at.max(now) + self.state_poll();
            self.poll_index = self.poll_index.wrapping_add(1);
        }
    }

    fn run_time_every(&self) -> usize {
        let every = RUN_TIME_WITHIN.as_micros() / self.config.state_poll().as_micros().max(1);
        usize::try_from(every.clamp(2, RUN_TIME_EVERY)).unwrap_or(2)
    }

    /// Whether what an exchange reads is limited by the configuration, or a host watches the
    /// axis.
    fn is_asked_for(&self, exchange: Exchange) -> bool {
        let limited = |parameters: &[AxisParameter]| {
            parameters.iter().any(|parameter| self.config.float(*parameter).is_some())
        };
        let asked = self.watched
            || match exchange {
                Exchange::Position => {
                    limited(&[AxisParameter::PositionMinRad, AxisParameter::PositionMaxRad])
                }
                Exchange::Current => limited(&[AxisParameter::CurrentLimitA]),
                Exchange::MotorTemperature | Exchange::DriverTemperature => {
                    limited(&[AxisParameter::TemperatureLimitC])
                }
                _ => false,
            };
        asked && self.can(exchange)
    }

    /// The poll of an axis at rest: a motor that holds is watched every other time, whatever else
    /// a host wants to know.
    fn idle_poll(&self) -> Option<Exchange> {
        let holds = self.is_kept_holding();
        if holds && (!self.watched || self.poll_index.is_multiple_of(2)) {
            return Some(Exchange::Velocity);
        }
        let state = Info::of_axis(&self.config)?.state;
        let index = if holds { self.poll_index / 2 } else { self.poll_index };
        self.watched.then(|| self.cyclic(state, index)).flatten()
    }

    /// The exchange at a place that counts on and on, of those this motor has commands for.
    fn cyclic(&self, exchanges: &[Exchange], index: usize) -> Option<Exchange> {
        (0..exchanges.len())
            .filter_map(|offset| exchanges.get((index + offset) % exchanges.len()).copied())
            .find(|exchange| self.can(*exchange))
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
