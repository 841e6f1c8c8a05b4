//! What is kept of an axis so that nothing is searched: what is so of it, and when it is due.

use super::state::State;
use super::{Axis, Stop};
use crate::set::Set;
use crate::time::Instant;

/// What is asked of axes as a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Is {
    /// Not `Unconfigured`.
    Configured,
    /// It has a stop, under way or confirmed.
    Stopping,
    /// No command of its stop has left.
    FirstStop,
    /// It has something to send now.
    Ready,
    /// A time of it has passed and has not been looked at.
    Overdue,
    /// Its motor owes a reply.
    Awaiting,
    /// A reply is late and may still wait for the bus.
    ReplyOverdue,
    /// Its motor owes a reply with the id of the next frame to it.
    OwedOurId,
    /// Its motor answers requests to others.
    Objecting,
    /// Its setpoint of a cycle is still to be answered.
    Cycling,
    /// It has still to do its part in a period of the free-running cycle.
    InPeriod,
    /// It moves by a setpoint.
    Active,
    /// Its setpoint is late, but for the time that its bus may take.
    Late,
    /// Arming, armed, active, stopping or tripped.
    Moving,
    Tripped,
    Unreachable,
    /// Its trip has still to reach its group.
    Spreading,
    /// What outlives a reset has changed.
    Unsaved,
}

impl Is {
    /// [`Unsaved`](Self::Unsaved) is the last.
    pub const COUNT: usize = Self::Unsaved as usize + 1;

    const fn bit(self) -> u32 {
        1 << self as u32
    }
}

/// A look at one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Look {
    /// What is so of it, a bit for each [`Is`].
    pub flags: u32,
    /// When the axis must be looked at again; [`Instant::NEVER`] where time alone changes nothing.
    pub due: Instant,
    /// When its next command that stops is due; [`Instant::NEVER`] where none is.
    pub stop_due: Instant,
    /// Since when a command of its stop has not left; [`Instant::NEVER`] where none is owed.
    pub stop_unsent_since: Instant,
    /// The bus that it is on.
    pub bus: Set,
    config_version: u16,
}

impl Look {
    /// At an axis of which nothing is so, without configuration.
    pub const NONE: Self = Self {
        flags: 0,
        due: Instant::NEVER,
        stop_due: Instant::NEVER,
        stop_unsent_since: Instant::NEVER,
        bus: Set::NONE,
        config_version: 0,
    };

    /// At an axis at `now`. `after`: what was due until then has been done.
    pub fn at(axis: &Axis, now: Instant, after: Instant) -> Self {
        let mut look = Self {
            bus: axis.config.bus().map_or(Set::NONE, Set::of),
            config_version: axis.config.version(),
            ..Self::NONE
        };
        look.note(Is::Unsaved, axis.is_unsaved);
        look.note(Is::Objecting, axis.transactions.objects);
        if !axis.is_configured() {
            return look;
        }
        let over = look.note_state(&axis.state);
        let transactions = &axis.transactions;
        look.note(Is::Configured, true);
        look.note(Is::Awaiting, transactions.awaits_reply());
        look.note(Is::ReplyOverdue, transactions.overdue_since().is_some());
        look.note(Is::OwedOurId, axis.reply_with_our_id_since().is_some());
        look.note(Is::Cycling, axis.is_cycling());
        look.note(Is::InPeriod, axis.has_part());
        let [former, current] = transactions.deadlines();
        for at in [former, current, over, axis.job_stalls_at()] {
            look.ends(at, now, after);
        }
        if let Some(at) = axis.delivery_due_at() {
            look.note(Is::Late, at <= now);
            look.is_due(at, after);
        }
        if transactions.is_idle() {
            let at = axis.next_request_at(now).unwrap_or(Instant::NEVER);
            look.note(Is::Ready, at <= now);
            let again = || axis.next_request_at(after).unwrap_or(Instant::NEVER);
            look.is_due(if after == now { at } else { again() }, after);
            if let Some(at) = axis.due_beside_job() {
                look.is_due(at, after);
            }
        }
        if axis.stop().is_some() {
            look.stop_due = axis.stop_due_at().unwrap_or(Instant::NEVER);
            look.stop_unsent_since = axis.unsent_stop_since().unwrap_or(Instant::NEVER);
        }
        look
    }

    /// What of the axis decides how long others wait on its bus: where it is another its bus must
    /// work that out anew.
    pub fn traffic(&self) -> (Set, u16, bool) {
        (self.bus, self.config_version, self.flags & Is::Objecting.bit() != 0)
    }

    /// What is so of a state. Returns when something of it is over.
    fn note_state(&mut self, state: &State) -> Option<Instant> {
        match state {
            State::Unconfigured | State::Idle | State::Holding => None,
            State::Arming | State::Armed(_) => {
                self.note(Is::Moving, true);
                None
            }
            State::Active(_, motion) => {
                self.note(Is::Moving, true);
                self.note(Is::Active, true);
                motion.expires
            }
            State::Stopping(stop) => self.note_stop(stop),
            State::Tripped(tripped, stop) => {
                self.note(Is::Tripped, true);
                self.note(Is::Unreachable, stop.unreachable);
                self.note(Is::Spreading, tripped.spreads);
                self.note_stop(stop)
            }
        }
    }

    fn note_stop(&mut self, stop: &Stop) -> Option<Instant> {
        self.note(Is::Moving, true);
        self.note(Is::Stopping, true);
        self.note(Is::FirstStop, !stop.has_left());
        stop.gives_up_at()
    }

    fn note(&mut self, is: Is, so: bool) {
        self.flags |= if so { is.bit() } else { 0 };
    }

    /// Something is so of it, or is not any more.
    pub fn put(&mut self, is: Is, so: bool) {
        self.flags &= !is.bit();
        self.note(is, so);
    }

    /// Something of the axis is over at this time.
    fn ends(&mut self, at: Option<Instant>, now: Instant, after: Instant) {
        if let Some(at) = at {
            self.note(Is::Overdue, at <= now);
            self.is_due(at, after);
        }
    }

    fn is_due(&mut self, at: Instant, after: Instant) {
        if at > after {
            self.due = self.due.min(at);
        }
    }
}
