//! The setpoint in force: a mailbox for the latest one.

use super::state::{Armed, State};
use super::{Axis, JobKind};
use crate::outbox::{Outbox, Ticket};
use crate::protocol::{self, Command, Demand, Effect, Exchange, Native};
use crate::rules;
use crate::time::{Duration, Instant};
use host_protocol::replies::MoveTarget;
use host_protocol::{AxisParameter, CycleResult, Error, Quantity, Setpoint, TripReason};
use serde::{Deserialize, Serialize};

/// A setpoint and the command that carries it out.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Motion {
    pub command: Command,
    /// When the permission to move ends; `None` only where the axis is configured without expiry,
    /// which is unsafe.
    pub expires: Option<Instant>,
    /// When it is to be sent next; `None` once it has been and must not be again.
    pub due: Option<Instant>,
    /// Sending it again would move the motor again.
    pub once: bool,
}

impl Motion {
    /// Whether it may still go out.
    pub fn is_permitted(&self, now: Instant) -> bool {
        self.expires.is_none_or(|at| now < at)
    }
}

/// The largest lead of an expiry that can be told from one in the past: half of what 32 bits of
/// microseconds count.
const HALF_RANGE: u32 = 1 << 31;

impl Axis {
    /// Takes a setpoint from the host, or says why not.
    pub fn set(
        &mut self,
        now: Instant,
        epoch: u32,
        expires_at_us: u32,
        setpoint: Setpoint,
        out: &mut Outbox<'_>,
    ) -> Result<(), Error> {
        let expires = self.permission(now, epoch, expires_at_us)?;
        if self.is_prepared() {
            return Err(Error::Busy { axis: self.index });
        }
        let command = rules::command(self.index, setpoint, &self.config)?;
        self.supersede(now, out);
        self.take_motion(now, command, expires, false, out);
        Ok(())
    }

    /// Takes a native command that moves as `demand` says, permitted until `expires`, or says why
    /// not. `ticket` is answered when the motor has answered it.
    pub fn move_natively(
        &mut self,
        now: Instant,
        expires: Option<Instant>,
        Native { command, effect }: Native,
        demand: Demand,
        ticket: Ticket,
        out: &mut Outbox<'_>,
    ) -> Result<(), Error> {
        rules::check_demand(self.index, demand, &self.config)?;
        let in_force = self.motion().map(|motion| &motion.command);
        // What follows on a target that was near is as near as the motor goes with it.
        if !(protocol::tracks(&command) && in_force.is_some_and(protocol::tracks)) {
            rules::check_nearness(self.index, demand, self.measured.position_and_way(now))?;
        }
        self.make_way(now, out);
        self.supersede(now, out);
        if self.is_busy() {
            return Err(Error::Busy { axis: self.index });
        }
        let once = matches!(effect, Effect::MovesOnce(_));
        self.take_motion(now, command, expires, once, out);
        self.start(now, JobKind::NativeMotion, ticket, out);
        Ok(())
    }

    /// Starts a relative move, permitted until `expires`: the position is read first.
    pub fn move_relative(
        &mut self,
        now: Instant,
        expires: Option<Instant>,
        distance_rad: f32,
        speed_limit_rad_s: f32,
        ticket: Ticket,
        out: &mut Outbox<'_>,
    ) -> Result<(), Error> {
        // What does not depend on the position is refused before it is read.
        rules::check_move(self.index, distance_rad, speed_limit_rad_s, &self.config)?;
        self.supersede(now, out);
        self.start(
            now,
            JobKind::MoveRelative { distance_rad, speed_limit_rad_s, expires },
            ticket,
            out,
        );
        Ok(())
    }

    /// The position has been read: from now on its sum with the distance is held.
    pub(super) fn hold_relative(
        &mut self,
        now: Instant,
        start_count: i32,
        distance_rad: f32,
        speed_limit_rad_s: f32,
        expires: Option<Instant>,
        out: &mut Outbox<'_>,
    ) -> Result<MoveTarget, Error> {
        if let Some(expired) = expires.filter(|at| *at <= now) {
            return Err(Error::Stale { now_us: now.low_bits(), expires_at_us: expired.low_bits() });
        }
        let setpoint = Setpoint::Position { position_rad: 0.0, speed_limit_rad_s };
        let command = protocol::motion(self.index, setpoint, &self.config)?;
        let further = protocol::further(command, start_count, distance_rad, &self.config)?;
        let target = Setpoint::Position { position_rad: further.target_rad, speed_limit_rad_s };
        rules::check_limits(target, &self.config)?;
        self.take_motion(now, further.command, expires, false, out);
        Ok(MoveTarget { start_rad: further.start_rad, target_rad: further.target_rad })
    }

    /// The end of the permission to move that a host gives, or why it gives none.
    pub fn permission(
        &self,
        now: Instant,
        epoch: u32,
        expires_at_us: u32,
    ) -> Result<Option<Instant>, Error> {
        let axis = self.index;
        let Some(armed) = self.armed() else {
            return Err(match self.trip_reason() {
                Some(reason) => Error::Tripped { axis, reason },
                None => Error::NotArmed { axis, state: self.state() },
            });
        };
        if epoch != armed.epoch {
            return Err(Error::StaleEpoch { axis, current: armed.epoch });
        }
        self.expiry(now, expires_at_us)
    }

    /// Puts a checked command into the mailbox. It is owed to the bus in time; one that takes the
    /// place of another, not sent yet, has no more time than that had.
    pub(super) fn take_motion(
        &mut self,
        now: Instant,
        command: Command,
        expires: Option<Instant>,
        once: bool,
        out: &mut Outbox<'_>,
    ) {
        let stays_doubtful =
            self.armed().is_some_and(|armed| armed.echo.is_doubtful) && self.is_in_force(&command);
        self.end_cycle(CycleResult::Superseded);
        let due = self.motion_due(now, expires);
        let deliver_by = now + self.refresh();
        let Some(armed) = self.armed_mut() else { return };
        armed.echo.is_doubtful = stays_doubtful;
        armed.motions = armed.motions.wrapping_add(1);
        let motion = Motion { command, expires, due: Some(due), once };
        match &mut self.state {
            State::Active(armed, before) => {
                armed.deliver_by = armed.deliver_by.min(deliver_by);
                *before = motion;
            }
            State::Armed(armed) => {
                let armed = Armed { deliver_by, ..*armed };
                self.enter(State::Active(armed, motion), out);
            }
            _ => {}
        }
    }

    /// The expiry as a point in gateway time: later than now, and not later than the axis's TTL
    /// allows.
    fn expiry(&self, now: Instant, expires_at_us: u32) -> Result<Option<Instant>, Error> {
        if self.config.flag(AxisParameter::UnsafeInfiniteTtl) {
            return Ok(None);
        }
        let now_us = now.low_bits();
        let lead = expires_at_us.wrapping_sub(now_us);
        if lead == 0 || lead >= HALF_RANGE {
            return Err(Error::Stale { now_us, expires_at_us });
        }
        Quantity::Expiry.check(lead, (0, self.config.ttl().as_micros_u32()))?;
        Ok(Some(now + Duration::from_micros(u64::from(lead))))
    }

    /// Whether the setpoint in force has expired.
    pub fn has_expired(&self, now: Instant) -> bool {
        self.motion().is_some_and(|motion| !motion.is_permitted(now))
    }

    /// What time alone brings about.
    pub fn expire(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if self.has_expired(now) {
            self.trip(now, TripReason::SetpointExpired, out);
        }
        self.expire_requests(now, out);
    }

    pub(super) fn resend_motion(&mut self, now: Instant) {
        if let State::Active(_, motion) = &mut self.state {
            motion.due = Some(now);
        }
    }

    /// A motion has not left: it is due again, and it is its turn.
    pub(super) fn motion_not_sent(&mut self, now: Instant) {
        if let State::Active(armed, _) = &mut self.state {
            armed.motion_was_last = false;
        }
        self.resend_motion(now);
    }

    /// Whether the mailbox still holds this very command.
    pub(super) fn is_in_force(&self, command: &Command) -> bool {
        self.motion().is_some_and(|motion| motion.command == *command)
    }

    /// Whether it is this motion that the mailbox holds.
    pub(super) fn is_latest(&self, number: u32) -> bool {
        matches!(&self.state, State::Active(armed, _) if armed.motions == number)
    }

    /// Plans what comes after an exchange that the bus has just taken.
    pub(super) fn note_handed(&mut self, now: Instant, exchange: Exchange) {
        if let Some(job) = &mut self.job {
            job.note_handed(exchange);
        }
        if exchange == Exchange::Motion {
            let refresh = self.refresh();
            if let State::Active(armed, motion) = &mut self.state {
                motion.due = (!motion.once).then_some(now + refresh);
                armed.deliver_by = motion.due.map_or(Instant::NEVER, |due| due + refresh);
                armed.motion_was_last = true;
            }
            return;
        }
        match &mut self.state {
            State::Armed(armed) | State::Active(armed, _) => {
                armed.motion_was_last = false;
                // The fault word has a rhythm of its own.
                if exchange == Exchange::Faults {
                    armed.fault_poll_at = now + self.config.fault_poll();
                    return;
                }
            }
            State::Stopping(stop) | State::Tripped(_, stop) => {
                stop.handed(now, exchange, &self.config);
                return;
            }
            _ => {}
        }
        // What a job asks for, or a cycle, has a rhythm of its own; but where it is what the polls ask
        // for too they have their turn, or they would be overdue longest for ever.
        let is_of_job = self.job_step() == Some(exchange);
        let is_of_part = self.part_read().is_some_and(|(read, _)| read == exchange);
        if !is_of_job && !is_of_part || self.is_next_poll(now, exchange) {
            // Whether a motor that holds turns is asked as often as before.
            if exchange != Exchange::RunTime || !self.is_kept_holding() {
                self.state_poll_at = now + self.turn();
            }
            self.poll_index = self.poll_index.wrapping_add(1);
        }
    }
}
