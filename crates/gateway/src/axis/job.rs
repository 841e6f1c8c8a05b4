//! What a host has asked for and takes exchanges of its own: arming, reading the state,
//! provisioning, clearing, native commands, relative moves.
//!
//! A job is a sequence of exchanges with a check after each; its result answers the host's request.

use super::Axis;
use super::identity::Identity;
use super::sequence::Sequence;
use super::state::State;
use crate::config::AxisConfig;
use crate::measured::{Observation, Versions};
use crate::outbox::{Outbox, Ticket};
use crate::protocol::{Command, Exchange, Info, Sets};
use crate::time::{Duration, Instant};
use crate::transaction::Transaction;
use host_protocol::replies::{Armed, Done, MotorTimeoutReport, NativeReply};
use host_protocol::{AxisParameter, Bytes, Error, Event, NoReplyHint, Reply, Value};
use serde::{Deserialize, Serialize};

/// A sequence of exchanges under way for a host.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Job {
    pub(super) kind: JobKind,
    ticket: Ticket,
    pub(super) sequence: Sequence,
    /// Requests of this step that were not answered.
    unanswered: u8,
    /// When the step began, its latest request ended, or the next one is due.
    pub(super) since: Instant,
    /// The holding brake has been freed.
    pub(super) brake_freed: bool,
    /// The motor may have been told another timeout of its own.
    timeout_told: bool,
    /// The motor's output is on, as the axis held before the job or a command of the job has
    /// switched it on.
    pub(super) output_on: bool,
    /// Which motor answers it, where it asks that.
    pub(super) identity: Identity,
    /// That motor tells its model in parts.
    pub(super) model_goes_on: bool,
}

/// How long a step may wait until the bus takes its request.
const TAKEN_WITHIN: Duration = Duration::from_millis(250);

/// What the job is for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum JobKind {
    /// Arm the axis; it gets this epoch.
    Arm {
        /// The epoch that setpoints must carry from then on.
        epoch: u32,
        /// Its end answers the request, not that of the last of several axes.
        alone: bool,
    },
    /// Read everything the motor tells.
    ReadState,
    /// Read what tells which version of its protocol the motor speaks.
    Recognise,
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
    Restart,
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
        matches!(self, Self::ReadState | Self::Recognise | Self::Native { asks: true, .. })
    }

    /// Its steps. Those that the motor has no command for are passed over. Output off goes before a
    /// change, as a motor that has such a command ignores what it is told first behind its own
    /// timeout.
    fn steps(self, config: &AxisConfig) -> &'static [Exchange] {
        let Some(info) = Info::of_axis(config) else { return &[] };
        match self {
            Self::Arm { .. } => info.arming,
            Self::ReadState => info.state,
            Self::Recognise => info.recognising,
            Self::Clear => info.clearing,
            Self::Restart => info.restarting,
            Self::Provision { .. } => &[
                Exchange::OutputOff,
                Exchange::RenewTimeout,
                Exchange::TimeoutSwitch,
                Exchange::Identity(0),
                Exchange::Identity(1),
                Exchange::Identity(2),
                Exchange::Identity(3),
            ],
            Self::OutputOff => &[Exchange::OutputOff],
            // Whether it has restarted since is seen by its run time before.
            Self::Native { command, .. } if command.sets() == Sets::AfterRestart => {
                &[Exchange::RunTime, Exchange::OutputOff, Exchange::Native]
            }
            Self::Native { command, .. } if command.read_back().is_some() => {
                &[Exchange::Native, Exchange::AckLevel]
            }
            Self::Native { command, asks } if asks || command.sets() == Sets::Output(false) => {
                &[Exchange::Native]
            }
            Self::Native { .. } => &[Exchange::OutputOff, Exchange::Native],
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
        }
    }
}

impl Job {
    /// The bus has taken an exchange.
    pub(super) fn note_handed(&mut self, exchange: Exchange) {
        self.brake_freed |= exchange == Exchange::ReleaseBrake;
        self.timeout_told |= exchange == Exchange::RenewTimeout;
    }

    /// A command has left.
    pub(super) fn note_transmitted(&mut self, command: &Command) {
        if let Sets::Output(on) = command.sets() {
            self.output_on = on;
        }
    }
}

impl Axis {
    /// Starts a job. The caller has checked that the state allows it.
    pub fn start(&mut self, now: Instant, kind: JobKind, ticket: Ticket, out: &mut Outbox<'_>) {
        if !kind.only_asks() {
            self.make_way(now, out);
        }
        if self.job.is_some() {
            out.answer(ticket, Err(Error::Busy { axis: self.index }));
            return;
        }
        self.transactions.job_begins();
        self.job = Some(Job {
            kind,
            ticket,
            sequence: Sequence::new(kind.steps(&self.config)),
            unanswered: 0,
            since: now,
            brake_freed: false,
            timeout_told: false,
            output_on: matches!(self.state, State::Holding),
            identity: Identity::UNKNOWN,
            model_goes_on: false,
        });
        match kind {
            JobKind::Arm { .. } => self.enter(State::Arming, out),
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
        if self.job_kind().is_some_and(JobKind::only_asks) {
            self.interrupt(now, Error::Busy { axis: self.index }, out);
        }
    }

    /// Whether a job is under way that does not make way for another.
    pub fn is_busy_with_more_than_a_question(&self) -> bool {
        self.job_kind().is_some_and(|kind| !kind.only_asks())
    }

    /// Refuses what such a job keeps from beginning.
    pub fn refuse_busy(&self) -> Result<(), Error> {
        match self.is_busy_with_more_than_a_question() {
            true => Err(Error::Busy { axis: self.index }),
            false => Ok(()),
        }
    }

    /// Whether the axis is being armed in this epoch.
    pub fn is_arming_in(&self, epoch: u32) -> bool {
        matches!(self.job_kind(), Some(JobKind::Arm { epoch: of, .. }) if of == epoch)
    }

    /// What the job under way is for.
    pub(super) fn job_kind(&self) -> Option<JobKind> {
        self.job.as_ref().map(|job| job.kind)
    }

    /// Whether a job of any kind is under way.
    pub fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// The exchange that the job wants next.
    pub(super) fn job_step(&self) -> Option<Exchange> {
        self.job.as_ref()?.sequence.step()
    }

    /// The native command of the job.
    pub(super) fn native_command(&self) -> Option<Command> {
        match self.job_kind()? {
            JobKind::Native { command, .. } | JobKind::Prepare { command } => Some(command),
            _ => None,
        }
    }

    /// A newer setpoint takes the place of a motion whose result is still owed.
    pub(super) fn supersede(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let kind = self.job_kind();
        if matches!(kind, Some(JobKind::NativeMotion | JobKind::MoveRelative { .. })) {
            self.fail(now, Error::Superseded { axis: self.index }, out);
        }
    }

    /// Since when the job has waited for its step: what is overdue for longer goes first.
    pub(super) fn job_since(&self) -> Instant {
        self.job.as_ref().map(|job| job.since).unwrap_or_default()
    }

    /// Gives the job its table again, which a snapshot leaves out.
    pub(super) fn attach_job(&mut self) {
        if let Some(job) = &mut self.job {
            job.sequence.attach(job.kind.steps(&self.config));
        }
    }

    /// Passes over the steps that this motor has no command for. Returns whether none is left.
    fn pass_over_steps(&mut self) -> bool {
        let Some(mut sequence) = self.job.as_ref().map(|job| job.sequence) else { return false };
        let lets_go = self.job_kind() == Some(JobKind::OutputOff);
        sequence.pass_over(|exchange| match exchange {
            Exchange::Motion => false,
            // A motor that holds is told to again behind a silence, and goes on holding.
            Exchange::OutputOff if !lets_go && self.is_held() => true,
            Exchange::OverwritePending | Exchange::ExecutePending if !self.write_waits => true,
            Exchange::Identity(read) if self.needs_no_identity(read) => true,
            _ => self.command_for(exchange).is_none(),
        });
        if let Some(job) = &mut self.job {
            job.sequence = sequence;
        }
        sequence.step().is_none()
    }

    pub(super) fn job_answered(
        &mut self,
        now: Instant,
        request: &Transaction,
        seen: &Observation,
        data: &[u8],
        out: &mut Outbox<'_>,
    ) {
        let exchange = request.exchange;
        // The reply to the setpoint before is not that of the native motion.
        let other_motion = exchange == Exchange::Motion && !self.is_latest(request.motion);
        // Nor does a poll that was under way before the job began tell what was asked for since.
        if self.job_step() != Some(exchange) || other_motion || request.predates_job {
            return;
        }
        if let Err(error) = self.check_step(exchange, seen) {
            self.fail(now, error, out);
            return;
        }
        if exchange == Exchange::RunTime && self.awaits_restart(now, out) {
            return;
        }
        if let Some(read) = self.version_told(exchange)
            && !self.version_read(now, read, data, seen.versions, out)
        {
            return;
        }
        self.note_identity(exchange, seen.versions, data);
        self.step_done(now, seen, data, out);
    }

    fn step_done(&mut self, now: Instant, seen: &Observation, data: &[u8], out: &mut Outbox<'_>) {
        if let Some(job) = &mut self.job {
            job.sequence.advance();
            job.unanswered = 0;
            job.since = now;
        }
        if self.pass_over_steps() {
            self.finish(now, seen, data, out);
        }
    }

    pub(super) fn job_unanswered(
        &mut self,
        now: Instant,
        request: &Transaction,
        out: &mut Outbox<'_>,
    ) {
        let exchange = request.exchange;
        if self.job_step() != Some(exchange) && self.owed_first() != Some(exchange) {
            // A first stop has had its time.
            if exchange.is_stop()
                && self.stop().is_none()
                && let Some(job) = &mut self.job
            {
                job.since = now;
            }
            return;
        }
        if self.waits_for_restart() {
            let error = Error::NoReply { axis: self.index, hint: NoReplyHint::None };
            return self.ask_restarted_again(now, error, out);
        }
        let has_left = request.is_awaited();
        let changes = exchange == Exchange::Native
            && matches!(self.job_kind(), Some(JobKind::Native { asks: false, .. }));
        let goes_on = match exchange {
            _ if !has_left => false,
            // It is read back.
            Exchange::Native => changes && matches!(request.command.sets(), Sets::AckLevel(_)),
            // Silence tells nothing of the version. Where that bars the arming, the job is over.
            Exchange::Version(read) => self.version_read(now, read, &[], Versions::NONE, out),
            _ => false,
        };
        if goes_on {
            return self.step_done(now, &Observation::default(), &[], out);
        }
        // What changes the motor is sent once: whether it was carried out is not known.
        let tries = if changes { 1 } else { self.config.missed_replies() };
        let may_be_mute = self.can(Exchange::AckLevel);
        let Some(job) = &mut self.job else { return };
        job.unanswered = job.unanswered.saturating_add(1);
        job.since = now;
        if job.unanswered >= tries && has_left && matches!(exchange, Exchange::Identity(_)) {
            // It does not tell.
            self.step_done(now, &Observation::default(), &[], out);
        } else if job.unanswered >= tries {
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
        if self.job_step() == Some(exchange) {
            let error = Error::Refused { axis: self.index, faults: self.measured.fault_word() };
            self.fail(now, error, out);
        }
    }

    /// The motor's own timeout has acted behind the step before: what it was told since it has
    /// ignored, and a brake that it had opened is locked again.
    pub(super) fn fail_what_was_ignored(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let changes = match self.job_step() {
            Some(Exchange::RenewTimeout | Exchange::ReleaseBrake) => true,
            Some(Exchange::Native) => !self.job_kind().is_some_and(JobKind::only_asks),
            _ => false,
        };
        if changes {
            let hint = NoReplyHint::None;
            self.fail(now, Error::NoReply { axis: self.index, hint }, out);
        }
    }

    /// When the job is given up if the bus has not taken its next request, or keeps a stop that
    /// goes before it.
    pub(super) fn job_stalls_at(&self) -> Option<Instant> {
        let job = self.job.as_ref()?;
        let is_motion = self.job_step()? == Exchange::Motion;
        let stop_waits = || {
            self.stop().is_some() && self.transactions.with_port().is_some_and(Exchange::is_stop)
        };
        let waits = self.transactions.is_idle() || stop_waits();
        waits.then(|| self.transactions.not_before(is_motion, job.since) + TAKEN_WITHIN)
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
        if self.job_kind() == Some(JobKind::ReadState) {
            self.finish(now, &Observation::default(), &[], out);
        } else {
            self.fail(now, error, out);
        }
    }

    /// Ends a clearing, for a stop that a host has asked for since.
    pub(super) fn give_up_clearing(&mut self, now: Instant, out: &mut Outbox<'_>) {
        if matches!(self.job_kind(), Some(JobKind::Clear | JobKind::Restart)) {
            self.fail(now, self.aborted(), out);
        }
    }

    /// What is told of a job that a stop has ended.
    pub(super) fn aborted(&self) -> Error {
        Error::Aborted { axis: self.index, state: self.state() }
    }

    /// Ends the job with an error. An arming that fails leaves the axis at rest, as it has only
    /// been sent stops; one that has freed the brake leaves it through the stop action.
    pub fn fail(&mut self, now: Instant, error: Error, out: &mut Outbox<'_>) {
        let Some(job) = self.job.take() else { return };
        if matches!(self.state, State::Arming) {
            if job.brake_freed {
                self.halt(now, out);
            } else {
                self.enter_rest(now, job.output_on, out);
            }
        }
        if matches!(job.kind, JobKind::Provision { .. }) && !job.timeout_told {
            self.timeout_not_told();
        }
        self.note_output(now, &job, out);
        out.answer(job.ticket, Err(error));
    }

    /// A native command may have switched the output of an idle axis's motor on, also where its
    /// reply was lost. One that held may have let go likewise, and is stopped again.
    fn note_output(&mut self, now: Instant, job: &Job, out: &mut Outbox<'_>) {
        match self.state {
            State::Idle if job.output_on => self.enter_rest(now, true, out),
            State::Holding if job.kind == JobKind::OutputOff && !job.output_on => {
                self.halt(now, out);
            }
            _ => {}
        }
    }

    /// The last step is done: `seen` and `data` are what its reply told.
    fn finish(&mut self, now: Instant, seen: &Observation, data: &[u8], out: &mut Outbox<'_>) {
        let Some(kind) = self.job_kind() else { return };
        match kind {
            // It waits for the others.
            JobKind::Prepare { .. } | JobKind::StandBy { .. } => {}
            JobKind::Arm { epoch, alone } => match self.check_told_timeout(now) {
                Ok(()) => {
                    if self.brake_is_freed_unseen() {
                        out.event(&Event::BrakeUnverified { axis: self.index, locked: false });
                    }
                    self.enter_armed(now, epoch, out);
                    if !alone {
                        self.job = None;
                        return;
                    }
                    let motor_timeout = self.motor_timeout(now);
                    self.end_job(now, &Reply::Arm(Armed { epoch, motor_timeout }), out);
                }
                Err(error) => self.fail(now, error, out),
            },
            JobKind::ReadState => {
                self.end_job(now, &Reply::ReadState(self.report(now)), out);
            }
            JobKind::Recognise => {
                self.end_job(now, &Reply::Recognise(self.recognition()), out);
            }
            JobKind::Provision { timeout_ms } => {
                self.provisioned(timeout_ms);
                let timeout = self.motor_timeout(now);
                let report = MotorTimeoutReport { timeout };
                self.end_job(now, &Reply::ProvisionMotorTimeout(report), out);
            }
            JobKind::Clear => {
                self.cleared(now, self.holds_after_stop(), out);
                let done = Reply::Clear(Done {});
                self.end_job(now, &done, out);
            }
            JobKind::Restart => {
                // The restart has switched the output off; the stop switches it on again.
                self.cleared(now, false, out);
                let done = Reply::ClearByRestart(Done {});
                self.end_job(now, &done, out);
                if self.holds_after_stop() {
                    self.halt(now, out);
                }
            }
            JobKind::OutputOff => {
                self.enter_rest(now, false, out);
                let done = Reply::OutputOff(Done {});
                self.end_job(now, &done, out);
            }
            JobKind::Native { .. } | JobKind::NativeMotion => {
                if let JobKind::Native { command, .. } = kind
                    && let Sets::Row(parameter, value) = command.sets()
                {
                    let _ = self.motor_was_told(parameter, value);
                }
                let data = Bytes::from_slice(data).unwrap_or_default();
                self.end_job(now, &Reply::Native(NativeReply { data }), out);
            }
            JobKind::MoveRelative { distance_rad, speed_limit_rad_s, expires } => {
                let error = Error::NoReply { axis: self.index, hint: NoReplyHint::None };
                let start = seen.position_count.ok_or(error);
                match start.and_then(|start| {
                    self.hold_relative(now, start, distance_rad, speed_limit_rad_s, expires, out)
                }) {
                    Ok(held) => self.end_job(now, &Reply::MoveRelative(held), out),
                    Err(error) => self.fail(now, error, out),
                }
            }
        }
    }

    /// The job has done what it was for. The reply is made where it is passed on, as a copy of the
    /// largest one costs more than the rest; behind a name, as a constant would be as long.
    #[inline(never)]
    fn end_job(&mut self, now: Instant, reply: &Reply, out: &mut Outbox<'_>) {
        if let Some(job) = self.job.take() {
            self.note_output(now, &job, out);
            out.answer(job.ticket, Ok(reply));
        }
    }

    /// The motor keeps this of a command: its row says so from now on.
    pub fn motor_was_told(&mut self, parameter: AxisParameter, value: u32) -> Result<(), Error> {
        (self.is_unsaved, self.row_was_told) = (true, true);
        self.config.set(parameter, Value::Unsigned(value))
    }
}
