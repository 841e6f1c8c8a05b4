//! One axis: its configuration, its state, and everything it has under way.
//!
//! An axis never sends by itself. The bus asks what it [wants](Axis::wants), takes it, and reports
//! what became of it; one request of an axis is under way at a time, and a stop displaces it.

mod config;
mod delivery;
mod exchanges;
mod jobs;
mod limits;
mod measured;
mod motion;
mod restart;
mod stop;
mod telemetry;
mod timeout;
mod together;
mod trips;
mod wants;

pub(crate) use config::{Address, AxisConfig};
pub(crate) use exchanges::Reception;
pub(crate) use jobs::{Job, JobKind};
use measured::Measured;
pub(crate) use measured::Observation;
pub(crate) use motion::{NativeMotion, Permit};
pub(crate) use restart::Restart;
pub(crate) use stop::Stop;
pub(crate) use wants::{Priority, Want};

use crate::axes::Traffic;
use crate::outbox::Outbox;
use crate::protocol::{self, Exchange};
use crate::time::{Duration, Earliest, Instant};
use core::num::NonZeroU64;
use exchanges::{Displaced, Pending, Quiet, Silence};
use host_protocol::replies::AxisReport;
use host_protocol::{
    AxisState, AxisSummary, Event, FaultReading, MotorTimeout, StateField, StateFields, Trip,
};
use motion::Motion;
use restart::RunTime;
use telemetry::Telemetry;

/// A setpoint is refreshed this many times within the motor's own timeout (GUARANTEES G2).
const REFRESHES_IN_TIMEOUT: NonZeroU64 = NonZeroU64::new(3).unwrap();

/// Longest time between refreshes where the motor's own timeout is not known (GUARANTEES G2).
const REFRESH_UNKNOWN: Duration = Duration::from_millis(20);

/// One axis of the gateway.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    pub index: u8,
    pub config: AxisConfig,
    pub state: AxisState,
    motor_timeout: MotorTimeout,
    /// The timeout last written to the motor, ms; 0 where none was, it was switched off, or
    /// something may have changed it since. It outlives a reset of the gateway, and arming
    /// writes it again where the motor may lose it, also where `motor_timeout` is unknown.
    written_timeout_ms: u32,
    /// What outlives a reset of the gateway has changed and has still to be saved.
    is_unsaved: bool,
    /// When the motor sent something last.
    heard_at: Instant,
    pub measured: Measured,
    pub trip: Option<Trip>,
    /// The trip has still to reach the others of its group.
    trip_spreads: bool,
    /// The trip has still to go into the history.
    trip_unrecorded: bool,
    /// The epoch of the latest arming; setpoints must carry it.
    epoch: u32,
    motion: Option<Motion>,
    /// Motions so far.
    motions: u32,
    /// Since when the first setpoint, or the first refresh of one, waits that the bus has not
    /// taken; later than now where none does.
    undelivered_since: Instant,
    stop: Option<Stop>,
    job: Option<Job>,
    pending: Option<Pending>,
    displaced: Option<Displaced>,
    silence: Silence,
    quiet: Quiet,
    fault_poll_at: Instant,
    state_poll_at: Instant,
    poll_turn: usize,
    /// After a motion frame whatever else is due goes first, so that fast setpoints starve no
    /// poll.
    motion_had_its_turn: bool,
    /// The motor has echoed the last motion command without carrying it out.
    not_executed: bool,
    /// It has answered it by zeros: the speed is to be read, which tells whether that was a state
    /// (PROTOCOL-NOTES R30).
    in_doubt: bool,
    /// How long motions have not been answered, whatever else has.
    motion_silence: Silence,
    /// Until when a reply may come late that cannot be told from the one to the axis's stop.
    stop_like_reply_until: Instant,
    /// Somebody has subscribed to the axis: an idle one is polled too.
    watched: bool,
    /// Requests in a row for the fault word that told nothing.
    faults_unread: u8,
    /// Since when the motor of the armed axis has been seen to turn without a setpoint.
    uncommanded_since: Option<Instant>,
    /// When the request left that the motor has not answered.
    unanswered_since: Option<Instant>,
    /// Time since the motor started, as last read.
    run_time: RunTime,
    /// Requests in a row for it that told nothing.
    run_time_unread: u8,
    /// The motor was told something that acts after a restart, and has not been seen to
    /// restart since.
    restart_owed: bool,
    /// An asynchronous write waited in the motor when it was last asked.
    write_waits: bool,
    /// What hosts have been told of the frames that its motor sends by itself.
    pub telemetry: Telemetry,
    /// The motor has answered a request to another one, saying that it was not for it, and will
    /// again.
    objects: bool,
    /// How often it may still do so, since the last frame to it.
    objections_due: u8,
}

impl Axis {
    #[inline(never)]
    pub const fn new(index: u8) -> Self {
        Self {
            index,
            config: AxisConfig::new(),
            state: AxisState::Unconfigured,
            motor_timeout: MotorTimeout::Unknown,
            written_timeout_ms: 0,
            is_unsaved: false,
            heard_at: Instant::from_micros(0),
            measured: Measured::new(),
            trip: None,
            trip_spreads: false,
            trip_unrecorded: false,
            epoch: 0,
            motion: None,
            motions: 0,
            undelivered_since: Instant::from_micros(0),
            stop: None,
            job: None,
            pending: None,
            displaced: None,
            silence: Silence::NONE,
            quiet: Quiet::NONE,
            fault_poll_at: Instant::from_micros(0),
            state_poll_at: Instant::from_micros(0),
            poll_turn: 0,
            motion_had_its_turn: false,
            not_executed: false,
            in_doubt: false,
            motion_silence: Silence::NONE,
            stop_like_reply_until: Instant::from_micros(0),
            watched: false,
            faults_unread: 0,
            uncommanded_since: None,
            unanswered_since: None,
            run_time: RunTime::UNKNOWN,
            run_time_unread: 0,
            restart_owed: false,
            write_waits: false,
            telemetry: Telemetry::NONE,
            objects: false,
            objections_due: 0,
        }
    }

    /// Whether motion is allowed or under way, so that polls, limits and trips apply.
    pub fn is_armed(&self) -> bool {
        matches!(self.state, AxisState::Armed | AxisState::Active)
    }

    /// Whether motion is allowed to whoever knows this epoch.
    pub fn is_armed_in(&self, epoch: u32) -> bool {
        self.is_armed() && self.epoch == epoch
    }

    /// Whether the axis may be configured: nothing is allowed and nothing is under way.
    pub fn is_at_rest(&self) -> bool {
        (self.state == AxisState::Unconfigured || self.is_idle_or_holding()) && self.job.is_none()
    }

    /// Whether it is configured and nothing moves or may, the motor's output on or off.
    pub fn is_idle_or_holding(&self) -> bool {
        matches!(self.state, AxisState::Idle | AxisState::Holding)
    }

    /// Whether the axis needs its motor as it is: it holds, may move or moves, or has yet to be
    /// stopped or cleared.
    pub fn is_in_use(&self) -> bool {
        !matches!(self.state, AxisState::Unconfigured | AxisState::Idle)
    }

    /// Whether there is a stop, under way or confirmed.
    pub fn has_stop(&self) -> bool {
        self.stop.is_some()
    }

    /// Whether there is a stop of which no command has left yet.
    pub fn stop_has_not_left(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| !stop.has_left())
    }

    /// Since when there is a stop.
    pub fn stop_since(&self) -> Option<Instant> {
        self.stop.as_ref().map(Stop::since)
    }

    /// Since when there is a stop of which no command has left, if that has not been reported.
    pub fn unreported_stop(&self) -> Option<Instant> {
        self.stop
            .as_ref()
            .filter(|stop| !stop.has_left() && !stop.delay_is_reported())
            .map(Stop::since)
    }

    /// The stop that has not left has been reported.
    pub fn stop_reported(&mut self) {
        if let Some(stop) = &mut self.stop {
            stop.report_delay();
        }
    }

    /// Whether a first stop of this axis was to leave at `since` or later.
    pub fn stops_beside(&self, since: Instant) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.had_not_left(since))
    }

    /// Whether so many stops stayed unconfirmed that nothing is known of the motor.
    pub fn is_unreachable(&self) -> bool {
        self.trip.as_ref().is_some_and(|trip| trip.unreachable)
    }

    /// Whether a reply of the axis's motor may come that is due within the bus's window.
    pub fn awaits_reply(&self) -> bool {
        let awaited = self
            .pending
            .as_ref()
            .is_some_and(|p| p.is_waiting() && protocol::slow_reply(&p.command).is_none());
        awaited || self.displaced.as_ref().is_some_and(Displaced::is_awaited)
    }

    /// Whether somebody has subscribed to the axis.
    pub fn is_watched(&self) -> bool {
        self.watched
    }

    /// Whether somebody has subscribed to the axis.
    pub fn watch(&mut self, watched: bool) {
        self.watched = watched;
    }

    /// Whether an exchange is only for those who watch an idle axis, so that everything else goes
    /// before it.
    fn is_for_watchers(&self, exchange: Exchange) -> bool {
        self.is_idle_or_holding()
            && self.job.is_none()
            && !(self.is_kept_holding() && exchange == Exchange::Velocity)
    }

    /// A parameter has been set. Where it has `moved` what decides by which frames the motor is
    /// reached, nothing is known of the motor; the `same` one goes on holding.
    pub fn configured(&mut self, moved: bool, same: bool, complete: bool, out: &mut Outbox<'_>) {
        if moved {
            self.leave_bus();
            self.forget_motor_timeout();
            self.forget_run_time();
            self.measured = Measured::new();
        }
        let state = match self.state {
            _ if !complete => AxisState::Unconfigured,
            AxisState::Holding if same => AxisState::Holding,
            _ => AxisState::Idle,
        };
        self.enter(state, out);
    }

    /// How often a setpoint goes out: as configured, and at least every third of the motor's own
    /// timeout.
    pub fn refresh(&self) -> Duration {
        let configured = self.config.refresh();
        match self.programmed_timeout() {
            Some(timeout) => configured.min(timeout.part(REFRESHES_IN_TIMEOUT)),
            None => configured.min(REFRESH_UNKNOWN),
        }
    }

    /// Standstill as far as a reading taken since the stop tells.
    fn standstill(&self) -> Option<bool> {
        let since = self.stop.as_ref()?.since();
        let velocity = self.measured.velocity_since(since)?;
        Some(self.is_standstill(velocity))
    }

    fn is_standstill(&self, velocity_rad_s: f32) -> bool {
        velocity_rad_s.abs() <= self.config.standstill_rad_s()
    }

    /// The motor's fault word as a host sees it.
    fn faults(&self, now: Instant) -> Option<FaultReading> {
        let word = self.measured.fault_word()?;
        let warnings = protocol::warnings(word, &self.config);
        Some(FaultReading { word, warnings, age_us: self.measured.age_us(now, StateField::Faults) })
    }

    /// The axis as a host sees it.
    pub fn report(&self, now: Instant) -> AxisReport {
        let reading = |field| self.measured.reading(now, field);
        AxisReport {
            axis: self.index,
            state: self.state,
            epoch: self.is_armed().then_some(self.epoch),
            trip: self.trip,
            position_rad: reading(StateField::Position),
            velocity_rad_s: reading(StateField::Velocity),
            current_a: reading(StateField::Current),
            voltage_v: reading(StateField::Voltage),
            motor_temperature_c: reading(StateField::MotorTemperature),
            driver_temperature_c: reading(StateField::DriverTemperature),
            faults: self.faults(now),
            fault_record: self.measured.fault_record,
            motor_timeout: self.motor_timeout(now),
            standstill: self.standstill(),
            stop_acknowledged: self.stop.as_ref().is_some_and(Stop::is_acknowledged),
        }
    }

    /// The chosen fields of the axis for a subscriber.
    pub fn sample(&self, now: Instant, fields: StateFields) -> Event {
        let wanted = |field| self.measured.reading(now, field).filter(|_| fields.contains(field));
        Event::Sample {
            axis: self.index,
            state: self.state,
            position_rad: wanted(StateField::Position),
            velocity_rad_s: wanted(StateField::Velocity),
            current_a: wanted(StateField::Current),
            voltage_v: wanted(StateField::Voltage),
            motor_temperature_c: wanted(StateField::MotorTemperature),
            driver_temperature_c: wanted(StateField::DriverTemperature),
            faults: self.faults(now).filter(|_| fields.contains(StateField::Faults)),
        }
    }

    /// The axis in one line of the list.
    pub fn summary(&self) -> AxisSummary {
        AxisSummary {
            axis: self.index,
            bus: self.config.bus(),
            protocol: self.config.protocol(),
            node: self.config.node(),
            state: self.state,
            missing: self.config.missing().map(|parameter| parameter.number()),
        }
    }

    /// Earliest time after `after` at which the axis must be looked at again.
    pub fn next_deadline(&self, after: Instant) -> Option<Instant> {
        if self.state == AxisState::Unconfigured {
            return None;
        }
        let mut next = Earliest::after(after);
        self.timers().into_iter().for_each(|at| next.consider(at));
        if self.pending.is_none() {
            next.consider(self.next_want_at(after));
        }
        next.at()
    }

    /// When something of the axis is over.
    fn timers(&self) -> [Option<Instant>; 5] {
        [
            self.displaced.as_ref().and_then(Displaced::deadline),
            self.pending.as_ref().and_then(Pending::deadline),
            self.motion.as_ref().and_then(Motion::deadline),
            self.job_stalls_at(),
            self.stop.as_ref().and_then(Stop::gives_up_at),
        ]
    }

    /// What of the axis decides how long others wait on its bus.
    pub fn traffic(&self) -> Traffic {
        let protocol = self.config.protocol();
        Traffic {
            bus: self.config.bus(),
            protocol,
            is_extended: protocol::has_extended_ids(&self.config),
            objects: self.objects,
            replies: protocol::replies_to_motion(&self.config),
            stream: protocol::stream_word(&self.config),
        }
    }

    /// Whether something of the axis is over that nobody has looked at.
    pub fn is_overdue(&self, now: Instant) -> bool {
        self.state != AxisState::Unconfigured
            && self.timers().into_iter().flatten().any(|at| at <= now)
    }

    /// Whether the axis has something to send.
    pub fn is_ready(&self, now: Instant) -> bool {
        self.state != AxisState::Unconfigured
            && self.pending.is_none()
            && self.next_want_at(now).is_some_and(|at| at <= now)
    }
}
