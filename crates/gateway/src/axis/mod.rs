//! One axis: its configuration, its state, and what it has under way.
//!
//! An axis never sends by itself. Its bus asks for the [next request](Axis::next_request), takes
//! it, and reports what became of it (`outcome.rs`); a stop preempts every other request.

mod angle;
mod arming;
mod cycle;
mod first_stop;
mod identity;
mod job;
mod limits;
mod look;
mod outcome;
mod part;
mod polls;
mod restart;
mod sequence;
mod setpoint;
mod snapshot;
mod state;
mod stop;
mod stopping;
mod telemetry;
mod timeout;
mod together;
mod version;

pub(crate) use job::{Job, JobKind};
pub(crate) use look::{Is, Look};
pub use part::PERIOD_US;
pub(crate) use part::Waits;
pub(crate) use polls::{Priority, Request};
pub(crate) use stop::Stop;

use crate::config::AxisConfig;
use crate::measured::{Measured, Observation};
use crate::outbox::Outbox;
use crate::protocol::{self, Evidence};
use crate::time::{Duration, Instant};
use crate::transaction::Transactions;
use angle::Angle;
use core::num::NonZeroU64;
use cycle::Cycling;
use first_stop::FirstStop;
use host_protocol::replies::{AxisReport, AxisSettings, MAX_SETTINGS};
use host_protocol::{
    AxisParameter, AxisSummary, CycleResult, Event, FaultReading, MotorTimeout, Setting,
    StateField, StateFields,
};
use identity::Identity;
use outcome::Silence;
use part::Part;
use restart::RunTime;
use serde::Deserialize;
use state::State;
use telemetry::Telemetry;

/// A setpoint is refreshed this many times within the motor's own timeout (GUARANTEES G2).
const REFRESHES_IN_TIMEOUT: NonZeroU64 = NonZeroU64::new(3).unwrap();

/// Longest time between refreshes where the motor's own timeout is not known (GUARANTEES G2).
const REFRESH_UNKNOWN: Duration = Duration::from_millis(20);

/// One axis of the gateway.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Axis {
    pub index: u8,
    pub config: AxisConfig,
    state: State,
    cycling: Cycling,
    part: Part,
    job: Option<Job>,
    pub transactions: Transactions,
    silence: Silence,
    /// Requests that told nothing for what no other reply carries.
    faults_unread: u8,
    run_time_unread: u8,
    state_poll_at: Instant,
    /// Counts polls: which comes next follows from it.
    poll_index: usize,
    /// A host has subscribed to the axis.
    pub watched: bool,
    pub measured: Measured,
    angle: Angle,
    motor_timeout: MotorTimeout,
    /// The timeout last written to the motor, ms; 0 where none was, it was switched off, or
    /// something may have changed it since. It outlives a reset of the gateway, and arming
    /// writes it again where the motor may lose it, also where `motor_timeout` is unknown.
    written_timeout_ms: u32,
    /// Which motor that was, or was told that it has none; it outlives a reset of the gateway too.
    told_motor: Identity,
    /// That the timeout is off is assumed of a command that the motor is to be told; nobody knew
    /// before.
    off_is_assumed: bool,
    /// When the motor sent something last.
    heard_at: Instant,
    /// Time since the motor started, as last read.
    run_time: RunTime,
    /// Until then the motor may be silent, as it was told to restart and is not known to be back.
    restarts_until: Instant,
    /// A command was sent that acts only after a restart. It outlives a reset of the gateway.
    restart_owed: bool,
    /// When somebody gave it up without a confirmed stop.
    given_up_at: Instant,
    /// An asynchronous write waits in the motor.
    write_waits: bool,
    first_stop: FirstStop,
    /// What its answers said of the version of its protocol when it was asked last.
    evidence: Evidence,
    /// What outlives a reset of the gateway has changed and has still to be saved.
    pub is_unsaved: bool,
    /// The row of its configuration has changed by what its motor was told, and is to be measured.
    pub row_was_told: bool,
    pub telemetry: Telemetry,
}

impl Axis {
    #[inline(never)]
    pub const fn new(index: u8) -> Self {
        Self {
            index,
            config: AxisConfig::new(),
            state: State::Unconfigured,
            cycling: Cycling::Over(CycleResult::Superseded),
            part: Part::NONE,
            job: None,
            transactions: Transactions::new(),
            silence: Silence::NONE,
            faults_unread: 0,
            run_time_unread: 0,
            state_poll_at: Instant::from_micros(0),
            poll_index: 0,
            watched: false,
            measured: Measured::new(),
            angle: Angle::UNKNOWN,
            motor_timeout: MotorTimeout::Unknown,
            written_timeout_ms: 0,
            told_motor: Identity::UNKNOWN,
            off_is_assumed: false,
            heard_at: Instant::from_micros(0),
            run_time: RunTime::UNKNOWN,
            restarts_until: Instant::from_micros(0),
            restart_owed: false,
            given_up_at: Instant::from_micros(0),
            write_waits: false,
            first_stop: FirstStop::OWED,
            evidence: Evidence::NONE,
            is_unsaved: false,
            row_was_told: false,
            telemetry: Telemetry::NONE,
        }
    }

    /// Gives what is under way its tables again, which a snapshot leaves out.
    pub fn attach(&mut self) {
        self.attach_job();
        if let State::Stopping(stop) | State::Tripped(_, stop) = &mut self.state {
            stop.attach(&self.config);
        }
    }

    /// The configuration is another. Where it has `moved` what decides by which frames the motor is
    /// reached, nothing is known of the motor; the `same` one goes on holding.
    pub fn configured(&mut self, moved: bool, same: bool, out: &mut Outbox<'_>) {
        if moved {
            self.transactions.forget();
            self.silence = Silence::NONE;
            self.first_stop = FirstStop::OWED;
            self.state_poll_at = Instant::default();
            self.forget_motor_timeout();
            self.set_restart_owed(false);
            self.run_time = RunTime::UNKNOWN;
            self.restarts_until = Instant::default();
            self.measured = Measured::new();
            self.angle = Angle::UNKNOWN;
            self.evidence = Evidence::NONE;
        }
        let state = match self.state {
            _ if self.config.missing().is_some() => State::Unconfigured,
            State::Holding if same => State::Holding,
            _ => State::Idle,
        };
        self.enter(state, out);
    }

    /// The axis was configured so before a reset of the gateway; `told`: what its motor was.
    pub fn restore(&mut self, config: AxisConfig, told: u32) {
        self.state = if config.missing().is_none() { State::Idle } else { State::Unconfigured };
        self.config = config;
        self.told_before_reset(told);
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
        let velocity = self.measured.velocity_since(self.stop()?.since)?;
        Some(self.is_standstill(velocity))
    }

    fn is_standstill(&self, velocity_rad_s: f32) -> bool {
        velocity_rad_s.abs() <= self.config.standstill_rad_s()
    }

    /// Whether the speed in a reply is standstill, where it has one.
    fn still(&self, seen: &Observation) -> Option<bool> {
        seen.velocity_rad_s.map(|velocity| self.is_standstill(velocity))
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
            state: self.state(),
            epoch: self.armed().map(|armed| armed.epoch),
            trip: self.tripped(),
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
            stop_acknowledged: self.stop().is_some_and(|stop| stop.acknowledged),
        }
    }

    /// The chosen fields of the axis for a subscriber.
    pub fn sample(&self, now: Instant, fields: StateFields) -> Event {
        let wanted = |field| self.measured.reading(now, field).filter(|_| fields.contains(field));
        Event::Sample {
            axis: self.index,
            state: self.state(),
            position_rad: wanted(StateField::Position),
            velocity_rad_s: wanted(StateField::Velocity),
            current_a: wanted(StateField::Current),
            voltage_v: wanted(StateField::Voltage),
            motor_temperature_c: wanted(StateField::MotorTemperature),
            driver_temperature_c: wanted(StateField::DriverTemperature),
            faults: self.faults(now).filter(|_| fields.contains(StateField::Faults)),
        }
    }

    /// The parameters from the one with the number `first` on that are set, as many as fit.
    pub fn settings(&self, now: Instant, first: u16) -> AxisSettings {
        let mut set = AxisParameter::ALL
            .iter()
            .filter(|parameter| parameter.number() >= first && self.config.is_set(**parameter))
            .filter_map(|parameter| Some((parameter.number(), self.config.get(*parameter)?)));
        let settings = set.by_ref().take(MAX_SETTINGS);
        let settings = settings.map(|(parameter, value)| Setting { parameter, value }).collect();
        let next = set.next().map(|(parameter, _)| parameter);
        AxisSettings { settings, next, motor_timeout: self.settled_timeout(now) }
    }

    /// The axis in one line of the list.
    pub fn summary(&self) -> AxisSummary {
        AxisSummary {
            axis: self.index,
            bus: self.config.bus(),
            protocol: self.config.protocol(),
            node: self.config.node(),
            state: self.state(),
            missing: self.config.missing().map(|parameter| parameter.number()),
        }
    }
}
