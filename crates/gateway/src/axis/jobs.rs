//! What a host has asked for and takes exchanges of its own: arming, reading the state,
//! provisioning, clearing, native commands, relative moves.
//!
//! A job is a sequence of exchanges with a check after each; its result answers the host's request.

use super::exchanges::{Pending, Silence};
use super::restart::Restart;
use super::{Axis, Observation};
use crate::outbox::{Outbox, Ticket};
use crate::protocol::{self, Command, Exchange, Info, Sets};
use crate::time::{Duration, Instant};
use host_protocol::replies::{Armed, Done, MotorTimeoutReport, NativeReply};
use host_protocol::{
    AxisParameter, AxisState, Bytes, Error, Event, MotorTimeout, NoReplyHint, Protocol, Quantity,
    Reply, TogetherBar, TripReason, Value,
};

/// A sequence of exchanges under way for a host.
#[derive(Debug, Clone)]
pub(crate) struct Job {
    pub(super) kind: JobKind,
    ticket: Ticket,
    pub(super) step: usize,
    /// Requests of this step that were not answered.
    unanswered: u8,
    /// When the step began, its latest request ended, or the next one is due.
    pub(super) since: Instant,
    /// The holding brake has been freed.
    brake_freed: bool,
    /// The motor's output is on, as the axis held before the job or a command of the job has
    /// switched it on.
    output_on: bool,
}

/// How long a step may wait until the bus takes its request.
const TAKEN_WITHIN: Duration = Duration::from_millis(250);

/// What the job is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum JobKind {
    /// Arm the axis; it gets this epoch.
    Arm {
        /// The epoch that setpoints must carry from then on.
        epoch: u32,
    },
    /// Read everything the motor tells.
    ReadState,
    /// Program the motor's own timeout.
    Provision {
        /// Milliseconds; 0 switches it off.
        timeout_ms: u32,
    },
    /// Switch the output of a holding motor off.
    OutputOff,
    /// Clear the motor's own faults, look whether the cause of a trip is gone, and leave the
    /// tripped state.
    Clear,
    /// Have the motor start anew, see that it has, and clear.
    Restart(Restart),
    /// Send a native command that is no motion, and hand its reply on.
    Native {
        /// The command.
        command: Command,
        /// It only asks, so that it may be asked again.
        asks: bool,
    },
    /// Hand on the reply to the native motion in the mailbox.
    NativeMotion,
    /// Have a speed wait in the motor, and wait with it until all that shall start together are as
    /// far.
    Prepare {
        /// The speed, to wait.
        command: Command,
    },
    /// Show that nothing waits in the motor, for the same.
    StandBy {
        /// It does not move: its speed is set to 0, and so is what waits.
        clears: bool,
    },
    /// Read the position, and hold its sum with the distance.
    MoveRelative {
        /// rad.
        distance_rad: f32,
        /// rad/s.
        speed_limit_rad_s: f32,
        /// When the permission to move ends.
        expires: Option<Instant>,
    },
}

impl JobKind {
    /// Whether it changes nothing, in the motor or in the gateway.
    fn only_asks(self) -> bool {
        matches!(self, Self::ReadState | Self::Native { asks: true, .. })
    }

    fn step(self, index: usize, protocol: Protocol) -> Option<Exchange> {
        let info = Info::of(protocol);
        let steps = match self {
            Self::Arm { .. } => info.arming,
            Self::ReadState => info.state,
            Self::Clear => info.clearing,
            Self::Restart(_) => return Restart::step(index, info.clearing),
            Self::Provision { timeout_ms } => {
                return [Exchange::SetTimeout { timeout_ms }, Exchange::TimeoutSwitch]
                    .get(index)
                    .copied();
            }
            Self::OutputOff => &[Exchange::OutputOff],
            Self::Native { command, .. } => {
                // Whether it has restarted since is seen by its run time before.
                let restarts = command.sets() == Sets::AfterRestart;
                let before = restarts.then_some(Exchange::RunTime);
                let steps = [before, Some(Exchange::Native), command.read_back()];
                return steps.into_iter().flatten().nth(index);
            }
            Self::NativeMotion => &[Exchange::Motion],
            Self::Prepare { .. } => &[Exchange::Native, Exchange::PendingWrite],
            Self::StandBy { clears: false } => &[Exchange::PendingWrite],
            Self::StandBy { clears: true } => &[
                Exchange::Stop,
                Exchange::PendingWrite,
                Exchange::OverwritePending,
                Exchange::ExecutePending,
                Exchange::PendingWrite,
            ],
            Self::MoveRelative { .. } => &[Exchange::Position],
        };
        steps.get(index).copied()
    }
}

impl Axis {
    /// Starts a job. The caller has checked that the state allows it.
    pub fn start(&mut self, now: Instant, kind: JobKind, ticket: Ticket, out: &mut Outbox<'_>) {
        if !kind.only_asks() {
            self.make_way(now, out);
        }
        if self.job.is_some() {
            out.answer(ticket, &Err(Error::Busy { axis: self.index }));
            return;
        }
        if let Some(pending) = &mut self.pending {
            pending.predates_job = true;
        }
        let output_on = self.state == AxisState::Holding;
        self.job = Some(Job {
            kind,
            ticket,
            step: 0,
            unanswered: 0,
            since: now,
            brake_freed: false,
            output_on,
        });
        match kind {
            JobKind::Arm { .. } => self.enter(AxisState::Arming, out),
            JobKind::Provision { timeout_ms } => self.provisioning(timeout_ms),
            _ => {}
        }
        if self.pass_over_steps() {
            self.finish(now, &Observation::default(), &[], out);
        }
    }

    /// Ends a job that only asks, for one that does something: nobody who looks on may keep others
    /// from acting.
    pub fn make_way(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if self.job.as_ref().is_some_and(|job| job.kind.only_asks()) {
            self.interrupt(now, Error::Busy { axis: self.index }, out);
        }
    }

    /// Whether a job is under way that does not make way for another.
    pub fn is_busy_with_more_than_a_question(&self) -> bool {
        self.job.as_ref().is_some_and(|job| !job.kind.only_asks())
    }

    /// Whether a job of any kind is under way.
    pub fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// The exchange that the job wants next.
    pub(super) fn job_exchange(&self) -> Option<Exchange> {
        let job = self.job.as_ref()?;
        job.kind.step(job.step, self.config.protocol()?)
    }

    /// The native command of the job.
    pub(super) fn native_command(&self) -> Option<Command> {
        match self.job.as_ref()?.kind {
            JobKind::Native { command, .. } | JobKind::Prepare { command } => Some(command),
            _ => None,
        }
    }

    /// A newer setpoint takes the place of a motion whose result is still owed.
    pub(super) fn supersede(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let moves =
            |job: &Job| matches!(job.kind, JobKind::NativeMotion | JobKind::MoveRelative { .. });
        if self.job.as_ref().is_some_and(moves) {
            self.fail(now, Error::Superseded { axis: self.index }, out);
        }
    }

    /// Since when the job has waited for its step: what is overdue for longer goes first.
    pub(super) fn job_since(&self) -> Instant {
        self.job.as_ref().map(|job| job.since).unwrap_or_default()
    }

    /// Passes over the steps that this motor has no command for. Returns whether none is left.
    fn pass_over_steps(&mut self) -> bool {
        while let Some(exchange) = self.job_exchange() {
            let is_of_what_waits =
                matches!(exchange, Exchange::OverwritePending | Exchange::ExecutePending);
            let needless = is_of_what_waits && !self.write_waits;
            let has_command =
                matches!(exchange, Exchange::Motion) || self.command_for(exchange).is_some();
            if !needless && has_command {
                return false;
            }
            if let Some(job) = &mut self.job {
                job.step += 1;
            }
        }
        true
    }

    pub(super) fn job_answered(
        &mut self,
        now: Instant,
        pending: &Pending,
        seen: &Observation,
        data: &[u8],
        out: &mut Outbox<'_>,
    ) {
        let exchange = pending.exchange;
        // The reply to the setpoint before is not that of the native motion.
        let other_motion = exchange == Exchange::Motion && !self.is_latest(pending.motion);
        // Nor does a poll that was under way before the job began tell what was asked for since.
        if self.job_exchange() != Some(exchange) || other_motion || pending.predates_job {
            return;
        }
        if let Err(error) = self.check_step(exchange, seen) {
            self.fail(now, error, out);
            return;
        }
        if exchange == Exchange::RunTime && self.awaits_restart(now, out) {
            return;
        }
        self.step_done(now, seen, data, out);
    }

    fn step_done(&mut self, now: Instant, seen: &Observation, data: &[u8], out: &mut Outbox<'_>) {
        if let Some(job) = &mut self.job {
            job.step += 1;
            job.unanswered = 0;
            job.since = now;
        }
        if self.pass_over_steps() {
            self.finish(now, seen, data, out);
        }
    }

    pub(super) fn job_unanswered(&mut self, now: Instant, pending: &Pending, out: &mut Outbox<'_>) {
        let exchange = pending.exchange;
        if self.job_exchange() != Some(exchange) {
            return;
        }
        if self.is_restarting() {
            self.ask_restarted_again(
                now,
                Error::NoReply { axis: self.index, hint: NoReplyHint::None },
                out,
            );
            return;
        }
        let has_left = pending.is_waiting();
        let changes = matches!(
            self.job.as_ref().map(|job| job.kind),
            Some(JobKind::Native { asks: false, .. })
        ) && exchange == Exchange::Native;
        if changes && has_left && matches!(pending.command.sets(), Sets::AckLevel(_)) {
            self.step_done(now, &Observation::default(), &[], out);
            return;
        }
        // What changes the motor is sent once: whether it was carried out is not known.
        let tries = if changes { 1 } else { self.config.missed_replies() };
        let may_be_mute = protocol::command(Exchange::AckLevel, &self.config).is_some();
        let Some(job) = &mut self.job else { return };
        job.unanswered = job.unanswered.saturating_add(1);
        job.since = now;
        if job.unanswered >= tries {
            let hint = match exchange {
                _ if !has_left => NoReplyHint::NotAcknowledged,
                _ if changes && may_be_mute => NoReplyHint::AckLevelBelow,
                // A motor at acknowledgement level 0 answers nothing, not even this.
                Exchange::AckLevel => NoReplyHint::AckLevelZero,
                _ => NoReplyHint::None,
            };
            self.fail(now, Error::NoReply { axis: self.index, hint }, out);
        }
    }

    pub(super) fn job_refused(&mut self, now: Instant, exchange: Exchange, out: &mut Outbox<'_>) {
        if self.job_exchange() == Some(exchange) {
            let error = Error::Refused { axis: self.index, faults: self.measured.fault_word() };
            self.fail(now, error, out);
        }
    }

    /// The bus has taken an exchange of the job.
    pub(super) fn job_handed(&mut self, exchange: Exchange) {
        if let Some(job) = &mut self.job {
            job.brake_freed |= exchange == Exchange::ReleaseBrake;
        }
    }

    /// A command has left while the job is under way.
    pub(super) fn job_left(&mut self, command: &Command) {
        if let (Some(job), Sets::Output(on)) = (&mut self.job, command.sets()) {
            job.output_on = on;
        }
    }

    /// When the job is given up if the bus has not taken its next request, or keeps a stop that
    /// goes before it.
    pub(super) fn job_stalls_at(&self) -> Option<Instant> {
        let stop_waits =
            |p: &Pending| self.stop.is_some() && p.exchange.is_stop() && !p.is_waiting();
        let waiting = self.job.as_ref().filter(|_| self.pending.as_ref().is_none_or(stop_waits))?;
        let is_motion = self.job_exchange()? == Exchange::Motion;
        Some(self.quiet.delays(is_motion, waiting.since) + TAKEN_WITHIN)
    }

    /// Gives up a job whose next request the bus does not take: every request has a result.
    pub(super) fn expire_job(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if self.job_stalls_at().is_some_and(|at| at <= now) {
            let hint = NoReplyHint::NotAcknowledged;
            self.fail(now, Error::NoReply { axis: self.index, hint }, out);
        }
    }

    /// Ends the job because a stop needs the motor. Who only reads is told what is known.
    pub(super) fn interrupt(&mut self, now: Instant, error: Error, out: &mut Outbox<'_>) {
        if self.job.as_ref().is_some_and(|job| job.kind == JobKind::ReadState) {
            self.finish(now, &Observation::default(), &[], out);
        } else {
            self.fail(now, error, out);
        }
    }

    /// Ends a clearing, for a stop that somebody has asked for since.
    pub(super) fn give_up_clearing(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if self
            .job
            .as_ref()
            .is_some_and(|job| matches!(job.kind, JobKind::Clear | JobKind::Restart(_)))
        {
            self.fail(now, Error::Busy { axis: self.index }, out);
        }
    }

    /// Ends the job with an error. An arming that fails leaves the axis at rest, as it has only
    /// been sent stops; one that has freed the brake leaves it through the stop action.
    pub fn fail(&mut self, now: Instant, error: Error, out: &mut Outbox<'_>) {
        let Some(job) = self.job.take() else { return };
        if self.state == AxisState::Arming {
            if job.brake_freed {
                self.stop(now, out);
            } else {
                self.enter_rest(now, job.output_on, out);
            }
        }
        self.note_output(now, &job, out);
        out.answer(job.ticket, &Err(error));
    }

    /// A native command may have switched the output of an idle axis's motor on, also where its
    /// reply was lost.
    fn note_output(&mut self, now: Instant, job: &Job, out: &mut Outbox<'_>) {
        if self.state == AxisState::Idle && job.output_on {
            self.enter_rest(now, true, out);
        }
    }

    fn check_step(&mut self, exchange: Exchange, seen: &Observation) -> Result<(), Error> {
        let axis = self.index;
        match self.job.as_ref().map(|job| job.kind) {
            Some(JobKind::Arm { .. }) => self.check_arming_step(exchange, seen),
            Some(JobKind::Clear | JobKind::Restart(_)) => {
                match (self.barring(seen), seen.velocity_rad_s, &self.trip) {
                    (Some(faults), ..) => {
                        Err(Error::CauseRemains { axis, reason: TripReason::MotorFault { faults } })
                    }
                    (_, Some(velocity), Some(_))
                        if self.must_stand() && !self.is_standstill(velocity) =>
                    {
                        Err(Error::StopNotConfirmed { axis })
                    }
                    (.., Some(trip)) => self.check_limit_cause(trip.reason, seen),
                    _ => Ok(()),
                }
            }
            Some(JobKind::Native { command, .. })
                if exchange == Exchange::AckLevel
                    && seen
                        .ack_level
                        .is_some_and(|level| command.sets() != Sets::AckLevel(level)) =>
            {
                Err(Error::Refused { axis, faults: self.measured.fault_word() })
            }
            Some(JobKind::Prepare { .. }) if seen.write_pending == Some(false) => {
                Err(Error::Refused { axis, faults: self.measured.fault_word() })
            }
            Some(JobKind::StandBy { .. })
                if seen.write_pending == Some(true) && !self.is_read_again_later(exchange) =>
            {
                Err(Error::CannotStartTogether { axis, reason: TogetherBar::WriteWaits })
            }
            Some(JobKind::Provision { timeout_ms })
                if seen.timeout_on.is_some_and(|on| on == (timeout_ms == 0)) =>
            {
                Err(Error::Refused { axis, faults: self.measured.fault_word() })
            }
            _ => Ok(()),
        }
    }

    fn check_arming_step(&mut self, exchange: Exchange, seen: &Observation) -> Result<(), Error> {
        let axis = self.index;
        if let Some(level) = seen.ack_level {
            self.check_ack_level(level)?;
        }
        if let Some(on) = seen.timeout_on {
            self.motor_timeout = if on { MotorTimeout::Verified } else { MotorTimeout::Off };
        }
        if exchange == Exchange::BrakeSwitch && seen.brake_locked == Some(true) {
            return Err(Error::BrakeOn { axis });
        }
        if exchange == Exchange::RenewTimeout {
            self.timeout_renewed();
        }
        if seen.commanded_zero == Some(false) {
            // The motor has acknowledged speed 0 and keeps another one.
            return Err(Error::CannotConfirm { axis });
        }
        if let Some(faults) = self.barring(seen)
            && exchange == Exchange::Faults
            && !self.is_read_again_later(exchange)
        {
            return Err(Error::MotorFault { axis, faults });
        }
        if seen.run_time_ms.is_some() && self.owes_restart() {
            return Err(Error::RestartOwed { axis });
        }
        // A motion against a locked brake ends in a stall.
        if seen.brake_locked == Some(true)
            && !self.brake_is_freed_unseen()
            && self.config.has_brake()
        {
            return Err(Error::BrakeLocked { axis });
        }
        match seen.velocity_rad_s {
            Some(velocity_rad_s)
                if exchange == Exchange::Velocity && !self.is_standstill(velocity_rad_s) =>
            {
                Err(Error::NotStandstill { axis, velocity_rad_s })
            }
            _ => Ok(()),
        }
    }

    /// Whether the job has freed the brake of a motor that need not show it.
    fn brake_is_freed_unseen(&self) -> bool {
        let freed = self.job.as_ref().is_some_and(|job| job.brake_freed);
        freed && !self.config.verifies_brake()
    }

    /// A level other than the configured one would make every write look lost, or answers
    /// unexpected.
    fn check_ack_level(&self, level: u8) -> Result<(), Error> {
        let configured = self.config.unsigned(AxisParameter::D5AckLevel).unwrap_or(0);
        if u32::from(level) == configured {
            return Ok(());
        }
        let number = AxisParameter::D5AckLevel.number();
        #[allow(clippy::cast_precision_loss)]
        let expected = configured as f32;
        Err(Error::OutOfRange {
            quantity: Quantity::Parameter(number),
            value: f32::from(level),
            min: expected,
            max: expected,
        })
    }

    /// Whether a later step of the job asks the same, so that the first answer is only for the
    /// record.
    fn is_read_again_later(&self, exchange: Exchange) -> bool {
        let (Some(job), Some(protocol)) = (&self.job, self.config.protocol()) else { return false };
        (job.step + 1..)
            .map_while(|step| job.kind.step(step, protocol))
            .any(|later| later == exchange)
    }

    /// The last step is done: `seen` and `data` are what its reply told.
    fn finish(&mut self, now: Instant, seen: &Observation, data: &[u8], out: &mut Outbox<'_>) {
        let Some(kind) = self.job.as_ref().map(|job| job.kind) else { return };
        let result = match kind {
            // It waits for the others.
            JobKind::Prepare { .. } | JobKind::StandBy { .. } => return,
            JobKind::Arm { epoch } => match self.check_motor_timeout(now) {
                Ok(()) => {
                    self.armed(now, epoch, out);
                    Ok(Reply::Arm(Armed { epoch, motor_timeout: self.motor_timeout(now) }))
                }
                Err(error) => Err(error),
            },
            JobKind::ReadState => Ok(Reply::ReadState(self.report(now))),
            JobKind::Provision { timeout_ms } => {
                self.provisioned(timeout_ms);
                Ok(Reply::ProvisionMotorTimeout(MotorTimeoutReport {
                    timeout: self.motor_timeout(now),
                }))
            }
            JobKind::Clear => {
                self.cleared(now, out);
                Ok(Reply::Clear(Done {}))
            }
            JobKind::Restart(_) => {
                self.cleared(now, out);
                Ok(Reply::ClearByRestart(Done {}))
            }
            JobKind::OutputOff => {
                self.enter_rest(now, false, out);
                Ok(Reply::OutputOff(Done {}))
            }
            JobKind::Native { .. } | JobKind::NativeMotion => {
                if let JobKind::Native { command, .. } = kind
                    && let Sets::Stream(stream) = command.sets()
                {
                    let _ = self.set_stream(stream);
                }
                Ok(Reply::Native(NativeReply { data: Bytes::from_slice(data).unwrap_or_default() }))
            }
            JobKind::MoveRelative { distance_rad, speed_limit_rad_s, expires } => {
                match seen.position_count {
                    Some(start) => self
                        .hold_relative(now, start, distance_rad, speed_limit_rad_s, expires, out)
                        .map(Reply::MoveRelative),
                    None => Err(Error::NoReply { axis: self.index, hint: NoReplyHint::None }),
                }
            }
        };
        match result {
            Ok(reply) => {
                if let Some(job) = self.job.take() {
                    self.note_output(now, &job, out);
                    out.answer(job.ticket, &Ok(reply));
                }
            }
            Err(error) => self.fail(now, error, out),
        }
    }

    /// From now on the motor sends these frames by itself (`stream`).
    pub fn set_stream(&mut self, word: u32) -> Result<(), Error> {
        self.is_unsaved = true;
        self.config.set(AxisParameter::Stream, Value::Unsigned(word))
    }

    /// The trip is over, and the repeated stop with it.
    fn cleared(&mut self, now: Instant, out: &mut Outbox<'_>) {
        self.stop = None;
        if self.trip.take().is_some() {
            self.enter_rest(now, self.holds_after_stop(), out);
        }
    }

    fn armed(&mut self, now: Instant, epoch: u32, out: &mut Outbox<'_>) {
        if self.brake_is_freed_unseen() {
            out.event(&Event::BrakeUnverified { axis: self.index, locked: false });
        }
        self.epoch = epoch;
        self.motion = None;
        self.not_executed = false;
        self.in_doubt = false;
        self.uncommanded_since = None;
        self.motion_silence = Silence::NONE;
        self.fault_poll_at = now + self.config.fault_poll();
        self.state_poll_at = now + self.state_poll();
        self.enter(AxisState::Armed, out);
    }
}
