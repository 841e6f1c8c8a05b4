//! The part of an axis in a period of the free-running cycle.
//!
//! In each period the setpoint in force is sent anew, and what its reply does not tell is read. Its
//! expiry is what it was: a period extends no permission to move (GUARANTEES G2).

use super::Axis;
use super::cycle::Cycling;
use super::state::State;
use crate::protocol::{self, Exchange, Info};
use crate::time::Instant;
use crate::transaction::Transaction;
use host_protocol::{
    CycleEvent, CycleResult, CycleState, Error, SlowState, StateField, StateFields,
};
use serde::{Deserialize, Serialize};

/// What reads the fields that are told of every axis.
const READS: [(Exchange, StateField); 3] = [
    (Exchange::Position, StateField::Position),
    (Exchange::Velocity, StateField::Velocity),
    (Exchange::Current, StateField::Current),
];

/// What the axis has to do in the period under way.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Part {
    /// When the period began; what left before belongs to the one before.
    since: Instant,
    /// When the next one begins.
    next: Instant,
    /// The setpoint in force when the period began, or a later one, that the motor has yet to
    /// answer.
    motion: Option<u32>,
    /// What has still to be read, a bit for each of [`READS`].
    reads: u8,
    /// What is told in turns is wanted, too: polls ask for it.
    pub tells_slow: bool,
    result: CycleResult,
    /// That of the period before.
    before: CycleResult,
}

impl Part {
    pub const NONE: Self = Self {
        since: Instant::from_micros(0),
        next: Instant::from_micros(0),
        motion: None,
        reads: 0,
        tells_slow: false,
        result: CycleResult::Superseded,
        before: CycleResult::Superseded,
    };

    /// What is told of it when its period is over.
    fn told(&self) -> CycleResult {
        if self.is_open() { CycleResult::Superseded } else { self.result }
    }

    /// Whether it has still to end.
    pub fn is_open(&self) -> bool {
        self.motion.is_some() || self.reads != 0
    }
}

/// What keeps a part from its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Waits {
    /// A motor has not answered.
    ForMotor,
    /// A request has not left its bus.
    ForBus,
}

impl Axis {
    /// A period begins now, and the next one at `next`. What is not armed has no part in it.
    pub fn begin_part(&mut self, now: Instant, next: Instant, fields: StateFields) {
        let refused = Error::NotArmed { axis: self.index, state: self.state() }.number();
        let mut part = Part {
            since: now,
            next,
            tells_slow: fields.bits() & !CycleEvent::FAST.bits() != 0,
            result: CycleResult::Answered,
            before: self.part.told(),
            ..Part::NONE
        };
        let mut is_told = false;
        match &mut self.state {
            State::Active(armed, motion) => {
                // One that must not be sent twice is not.
                part.motion = motion.due.map(|_| armed.motions);
                motion.due = motion.due.map(|due| due.min(now));
                is_told = part.motion.is_some() && protocol::tells_state(&motion.command);
            }
            State::Armed(_) => {}
            _ => {
                let result = CycleResult::Refused { error: refused };
                self.part = Part { result, before: part.before, ..Part::NONE };
                return;
            }
        }
        part.reads = self.period_reads(fields, is_told).fold(0, |reads, read| reads | bit_of(read));
        self.part = part;
    }

    /// The cycle has ended: the axis goes on in its own rhythm.
    pub fn leave_cycle(&mut self) {
        self.part = Part::NONE;
    }

    /// What is read in a period beside the setpoint: what its reply does not tell. `is_told`: that
    /// tells the state where one reply tells all of it, as it does but for one of impedance.
    pub fn period_reads(
        &self,
        fields: StateFields,
        is_told: bool,
    ) -> impl Iterator<Item = Exchange> {
        let one_tells_all = Info::of_axis(&self.config).is_some_and(|info| info.angle.is_some());
        let wanted = move |(exchange, field): &(Exchange, StateField)| match one_tells_all {
            true => *exchange == Exchange::Velocity && !is_told,
            false => fields.contains(*field) && self.can(*exchange),
        };
        READS.into_iter().filter(wanted).map(|(exchange, _)| exchange)
    }

    /// What is to be read next in the period, and since when.
    pub(super) fn part_read(&self) -> Option<(Exchange, Instant)> {
        let (exchange, _) = READS.get(self.part.reads.trailing_zeros() as usize)?;
        Some((*exchange, self.part.since))
    }

    /// What keeps the part of the axis from its end; nothing where it has ended.
    pub fn part_waits(&self, now: Instant) -> Option<Waits> {
        // A late reply is let pass before the next request, but before a setpoint none to a poll.
        let is_motion = self.part.motion.is_some();
        let is_held_off = self.transactions.not_before(is_motion, now) > now;
        let is_awaited = self.transactions.is_awaited() || is_held_off;
        self.has_part().then_some(if is_awaited { Waits::ForMotor } else { Waits::ForBus })
    }

    /// Whether the axis has still to end its part of the period.
    pub fn has_part(&self) -> bool {
        self.part.is_open()
    }

    /// A request has ended so: what it was in a cycle and in a period has, too.
    pub(super) fn part_over(&mut self, request: &Transaction, result: CycleResult) {
        let is_motion = request.exchange == Exchange::Motion;
        if is_motion && self.cycling == Cycling::Waits(request.motion) {
            self.cycling = Cycling::Over(result);
        }
        let part = &mut self.part;
        let is_earlier = request.transmitted_at().is_some_and(|at| at < part.since);
        // The answer to one of the period before is not that of this one; a silence is told when
        // it is known.
        if !part.is_open() || is_earlier && result != CycleResult::NoReply {
            return;
        }
        let read = bit_of(request.exchange);
        let is_of_part = match request.exchange {
            // What was put on the bus before the period may have left in it.
            Exchange::Motion => {
                part.motion.take_if(|owed| !is_older(request.motion, *owed)).is_some()
            }
            _ => part.reads & read != 0,
        };
        part.reads &= !read;
        if is_of_part && part.result == CycleResult::Answered {
            part.result = result;
        }
    }

    /// The axis stops: its part has ended.
    pub(super) fn stop_part(&mut self) {
        if self.part.is_open() {
            self.part = Part { motion: None, reads: 0, result: CycleResult::Stopped, ..self.part };
        }
    }

    /// From when on a new setpoint is to be sent: in the place of one that this period still owes;
    /// else from the next period on, which is well within its refresh time and its life; at once
    /// where that is not so, or there is no cycle.
    pub(super) fn motion_due(&self, now: Instant, expires: Option<Instant>) -> Instant {
        let next = self.part.next;
        if next <= now {
            return now;
        }
        let is_owed = self.motion().and_then(|motion| motion.due).is_some_and(|due| due <= now);
        let refresh = self.refresh();
        let within = expires.map_or(refresh, |at| at.since(now).min(refresh));
        let may_wait = next.since(now).times(2) <= within && !is_owed;
        if may_wait { next } else { now }
    }

    /// The axis at the end of the period under way, or of the one before.
    pub fn part_state(&self, now: Instant, fields: StateFields, is_before: bool) -> CycleState {
        let result = if is_before { self.part.before } else { self.part.told() };
        CycleState { result, ..self.cycle_state(now, fields) }
    }

    /// What is told in turns.
    pub fn slow_state(&self, now: Instant, fields: StateFields) -> SlowState {
        let wanted = |field| self.measured.reading(now, field).filter(|_| fields.contains(field));
        SlowState {
            axis: self.index,
            voltage_v: wanted(StateField::Voltage),
            motor_temperature_c: wanted(StateField::MotorTemperature),
            driver_temperature_c: wanted(StateField::DriverTemperature),
            faults: self.faults(now).filter(|_| fields.contains(StateField::Faults)),
        }
    }
}

/// Which of [`READS`] an exchange is; nothing where it is none.
fn bit_of(exchange: Exchange) -> u8 {
    READS.iter().position(|(read, _)| *read == exchange).map_or(0, |bit| 1 << bit)
}

/// Whether a setpoint came before another.
fn is_older(number: u32, other: u32) -> bool {
    number.wrapping_sub(other) > u32::MAX / 2
}

/// Shortest and longest period of a free-running cycle, µs (PROTOCOL.md, `RunCycle`).
pub const PERIOD_US: (u32, u32) = (250, 20_000);
