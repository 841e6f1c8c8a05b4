//! Setpoints in their rhythm: each is new, with an expiry of its own, and none waits for the answer
//! to another.

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::replies::Done;
use host_protocol::requests as ask;
use host_protocol::{Bytes, Call, Error, MAX_CAN_DATA, Quantity, Setpoint};

use crate::clock::Clock;
use crate::error::ClientError;
use crate::inbox::{Answer, Arrived};

/// Setpoints are renewed after this part of the shortest TTL: eight in a row may get lost on a line
/// without delay, four behind a delay of 40 ms at a TTL of 100 ms.
const RENEWALS_PER_TTL: u32 = 10;
/// They are renewed at least this often, whatever the TTL: this keeps authority alive, too.
pub(crate) const RENEW_WITHIN: Duration = Duration::from_millis(25);
/// No more than one setpoint in this time, of all axes together: a third of what a link of 921600
/// bit/s carries.
const SHORTEST_SPACE: Duration = Duration::from_millis(1);
/// The gateway's clock is asked for this often.
const PING_EVERY: Duration = Duration::from_millis(50);
/// The part of its TTL by which a setpoint expires sooner.
const MARGIN_PART: u32 = 20;
/// Requests of one kind whose answers are still looked for. Older ones are lost.
const AWAITED: usize = 256;
/// A stream ends when the gateway has taken nothing of an axis for twice its TTL, but not sooner or
/// later than this.
const PATIENCE: (Duration, Duration) = (Duration::from_millis(500), Duration::from_secs(2));
/// Without any setpoint it ends when no ping has been answered for so long.
const PONG_PATIENCE: Duration = Duration::from_secs(1);

/// What an axis shall keep doing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Motion {
    Setpoint(Setpoint),
    Native(Bytes<MAX_CAN_DATA>),
}

/// One axis of a stream.
#[derive(Debug)]
pub(crate) struct Flow {
    pub(crate) axis: u8,
    pub(crate) epoch: u32,
    pub(crate) ttl: Duration,
    pub(crate) motion: Motion,
    /// The setpoints that have not been answered, and what `excess` and `narrowed` came to
    /// together when each was sent.
    awaited: VecDeque<(u16, Duration)>,
    /// When the gateway took one last, or the stream began.
    taken: Duration,
    /// It has come at the wrong time since.
    miss: Option<Error>,
    /// By how much the expiries of earlier setpoints lay too far ahead for the gateway, as far as
    /// its clock is not known better since.
    excess: Duration,
    /// By how much the bounds on the gateway's clock have come nearer to each other, in all.
    narrowed: Duration,
    /// Why it has ended.
    refusal: Option<ClientError>,
}

impl Flow {
    pub(crate) fn new(axis: u8, epoch: u32, ttl: Duration, motion: Motion) -> Self {
        Self {
            axis,
            epoch,
            ttl,
            motion,
            awaited: VecDeque::new(),
            taken: Duration::ZERO,
            miss: None,
            excess: Duration::ZERO,
            narrowed: Duration::ZERO,
            refusal: None,
        }
    }

    fn take(
        &mut self,
        now: Duration,
        answer: &Answer,
        sent_with: Duration,
        reply: &mut Option<Bytes<MAX_CAN_DATA>>,
    ) {
        let read = match self.motion {
            Motion::Setpoint(_) => answer.read::<ask::Setpoint>().map(|Done {}| None),
            Motion::Native(_) => answer.read::<ask::Native>().map(|native| Some(native.data)),
        };
        match read {
            Ok(data) => {
                (self.taken, self.miss) = (now, None);
                if data.is_some() {
                    *reply = data;
                }
            }
            // It was taken, and the next one came before the motor had answered.
            Err(ClientError::Gateway(Error::Superseded { .. })) => {
                (self.taken, self.miss) = (now, None)
            }
            Err(ClientError::Gateway(error)) if is_miss(&error) => {
                self.miss = Some(error);
                if let Some(excess) = expiry_excess(&error) {
                    self.stay_below(excess, sent_with);
                }
            }
            Err(error) => {
                self.refusal.get_or_insert(error);
            }
        }
    }

    /// For how long the next one is valid: a little less than the TTL, because some setpoints
    /// arrive sooner than the pings that the gateway's clock was measured by.
    pub(crate) fn lead(&self) -> Duration {
        (self.ttl - self.ttl / MARGIN_PART).saturating_sub(self.excess)
    }

    /// The gateway has found an expiry too far ahead, by so much. What the clock has told since that
    /// setpoint was sent counts already.
    fn stay_below(&mut self, excess: Duration, sent_with: Duration) {
        let needed = sent_with.saturating_add(excess).saturating_sub(self.narrowed);
        self.excess = self.excess.max(needed).min(self.ttl / 2);
    }

    /// The bounds on the gateway's time have come nearer to each other by so much: so much less can
    /// an expiry lie too far ahead.
    fn clock_narrowed(&mut self, by: Duration) {
        self.excess = self.excess.saturating_sub(by);
        self.narrowed = self.narrowed.saturating_add(by);
    }

    fn check(&mut self, now: Duration) -> Result<(), ClientError> {
        if let Some(error) = self.refusal.take() {
            return Err(error);
        }
        let patience = self.ttl.saturating_mul(2).clamp(PATIENCE.0, PATIENCE.1);
        if now.saturating_sub(self.taken) <= patience {
            return Ok(());
        }
        let request = match self.motion {
            Motion::Setpoint(_) => "Setpoint",
            Motion::Native(_) => "Native",
        };
        Err(self
            .miss
            .map_or(ClientError::NoAnswer { request, after: patience }, ClientError::Gateway))
    }
}

/// What is sent in its rhythm while a client holds axes, or only its link.
#[derive(Debug)]
pub(crate) struct Stream {
    pub(crate) flows: Vec<Flow>,
    period: Duration,
    next: Duration,
    next_ping: Duration,
    pings: VecDeque<(u16, Duration)>,
    ponged: Duration,
    /// The nearest that the bounds on the gateway's clock have come to each other, µs.
    narrowest_us: Option<u64>,
    /// What a motor answered to a native command, last.
    pub(crate) reply: Option<Bytes<MAX_CAN_DATA>>,
}

impl Stream {
    /// A stream that begins now.
    pub(crate) fn new(now: Duration, mut flows: Vec<Flow>) -> Self {
        let ttl = flows.iter().map(|flow| flow.ttl).min().unwrap_or(Duration::MAX);
        let axes = u32::try_from(flows.len()).unwrap_or(u32::MAX).max(1);
        let period =
            (ttl / RENEWALS_PER_TTL).min(RENEW_WITHIN).max(SHORTEST_SPACE.saturating_mul(axes));
        flows.iter_mut().for_each(|flow| flow.taken = now);
        let (pings, narrowest_us, reply) = (VecDeque::new(), None, None);
        Self { flows, period, next: now, next_ping: now, pings, ponged: now, narrowest_us, reply }
    }

    /// When something is to be sent next.
    pub(crate) fn due(&self) -> Duration {
        let flows = self.flows.iter().any(|flow| flow.refusal.is_none());
        if flows { self.next.min(self.next_ping) } else { self.next_ping }
    }

    /// Whether the setpoints are due now. What was missed is not made up for, and after a refusal
    /// nothing is due.
    pub(crate) fn takes_turn(&mut self, now: Duration) -> bool {
        let is_refused = self.flows.iter().any(|flow| flow.refusal.is_some());
        let is_due = !self.flows.is_empty() && !is_refused && now >= self.next;
        if now >= self.next {
            self.next = (self.next + self.period).max(now);
        }
        is_due
    }

    /// Whether a ping is due now.
    pub(crate) fn takes_ping(&mut self, now: Duration) -> bool {
        let is_due = now >= self.next_ping;
        if is_due {
            let period = if self.flows.is_empty() { RENEW_WITHIN } else { PING_EVERY };
            self.next_ping = (self.next_ping + period).max(now);
        }
        is_due
    }

    pub(crate) fn pinged(&mut self, sequence: u16, now: Duration) {
        if self.pings.len() == AWAITED {
            self.pings.pop_front();
        }
        self.pings.push_back((sequence, now));
    }

    pub(crate) fn sent(&mut self, flow: usize, sequence: u16) {
        let Some(flow) = self.flows.get_mut(flow) else { return };
        if flow.awaited.len() == AWAITED {
            flow.awaited.pop_front();
        }
        flow.awaited.push_back((sequence, flow.excess.saturating_add(flow.narrowed)));
    }

    /// Takes an answer if it is one to this stream.
    pub(crate) fn take(&mut self, now: Duration, arrived: &Arrived, clock: &mut Clock) -> bool {
        if let Some(at) = self
            .pings
            .iter()
            .position(|(sequence, _)| arrived.answers(*sequence, ask::Ping::NUMBER))
        {
            if let Some((_, sent)) = self.pings.remove(at)
                && let Ok(pong) = arrived.answer.read::<ask::Ping>()
            {
                let before = self.narrowest_us.or(clock.width_us(now)).unwrap_or(0);
                clock.measure(sent, now, pong.time_us);
                let after = clock.width_us(now).unwrap_or(0).min(before);
                self.narrowest_us = Some(after);
                let narrowed = Duration::from_micros(before - after);
                self.flows.iter_mut().for_each(|flow| flow.clock_narrowed(narrowed));
                self.ponged = now;
            }
            return true;
        }
        for flow in &mut self.flows {
            let number = match flow.motion {
                Motion::Setpoint(_) => ask::Setpoint::NUMBER,
                Motion::Native(_) => ask::Native::NUMBER,
            };
            let position =
                flow.awaited.iter().position(|(sequence, _)| arrived.answers(*sequence, number));
            if let Some((_, sent_with)) = position.and_then(|at| flow.awaited.remove(at)) {
                flow.take(now, &arrived.answer, sent_with, &mut self.reply);
                return true;
            }
        }
        false
    }

    /// Whether it may go on: every axis by itself.
    pub(crate) fn check(&mut self, now: Duration) -> Result<(), ClientError> {
        self.flows.iter_mut().try_for_each(|flow| flow.check(now))?;
        if self.flows.is_empty() && now.saturating_sub(self.ponged) > PONG_PATIENCE {
            return Err(ClientError::NoAnswer { request: "Ping", after: PONG_PATIENCE });
        }
        Ok(())
    }
}

/// Whether a setpoint only came at the wrong time, by what was known of the gateway's clock or by
/// what another host had asked of the motor.
fn is_miss(error: &Error) -> bool {
    matches!(
        error,
        Error::Stale { .. }
            | Error::Busy { .. }
            | Error::OutOfRange { quantity: Quantity::Expiry, .. }
    )
}

/// By how much an expiry lay too far ahead for the gateway, where that is its error.
pub(crate) fn expiry_excess(error: &Error) -> Option<Duration> {
    let Error::OutOfRange { quantity: Quantity::Expiry, value, max, .. } = error else {
        return None;
    };
    let excess_us = f64::from(*value) - f64::from(*max);
    Some(Duration::try_from_secs_f64(excess_us.clamp(0.0, 1e9) / 1e6).unwrap_or_default())
}
