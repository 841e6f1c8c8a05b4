//! A simulated thruster without an encoder (Thruster manual), on CAN.

use std::f64::consts::TAU;
use std::time::Duration;

use host_protocol::CanFrame;
use thruster::{
    Celsius, Deciamps, Decidegrees, Decivolts, Faults, LimitDecidegrees, Node, POSITION_LIMITS, Percent,
    Reply, Request, Rpm, SIGNAL_MAX, SPEED_MIN_MAGNITUDE, TIMEOUT_MAX, TIMEOUT_MIN, TIMEOUT_OFF,
};

use super::counts::{to_i16, to_u16};
use super::dynamics::{Characteristics, Drive, Plant};
use super::lenient;
use super::model::{Context, Model};
use super::stall::StallGuard;
use super::watch::Watch;
use crate::bus::Wire;

/// Time from a request to its answer.
const REPLY_MIN: Duration = Duration::from_micros(100);
const REPLY_MAX: Duration = Duration::from_micros(200);

/// Speed at full signal, rpm.
const FULL_SPEED_RPM: f64 = 3_000.0;
/// One rpm in rad/s.
const RPM: f64 = TAU / 60.0;
/// What is left of the output while driver or motor are too hot.
const HOT_SHARE: f64 = 0.5;

/// A propeller in water, on 24 V.
const CHARACTERISTICS: Characteristics = Characteristics {
    max_speed_rad_s: FULL_SPEED_RPM * RPM,
    max_current_a: 25.0,
    speed_per_ampere: 20.0,
    mechanical_s: 0.08,
    speed_loop_s: 0.06,
    position_gain: 0.0,
    supply_v: 24.0,
    supply_ohm: 0.05,
    thermal_s: 90.0,
    warming_per_a2: 0.15,
    ambient_c: 18.0,
};

/// Faults that switch the output off (Thruster manual §3).
const OUTPUT_OFF: Faults = Faults::EE_ACCESS
    .union(Faults::EE_DATA)
    .union(Faults::OVER_CURRENT)
    .union(Faults::STALL)
    .union(Faults::ZERO_PROTECTION)
    .union(Faults::TIMEOUT);
/// Faults that stay until they are cleared (Thruster manual §3).
const LATCHED: Faults = Faults::EE_ACCESS
    .union(Faults::EE_DATA)
    .union(Faults::OVER_CURRENT)
    .union(Faults::STALL)
    .union(Faults::ENCODER);

/// The thruster's firmware.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Thruster {
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::thruster_node"))]
    node: Node,
    plant: Plant,
    /// The speed it was told to run at, rad/s.
    wanted_rad_s: f64,
    /// Set by ST; zero = off.
    timeout: Duration,
    watch: Watch,
    /// What it ran at when the timeout struck, rad/s.
    before_timeout_rad_s: f64,
    /// Zero has been commanded since the start or the last timeout.
    zero_seen: bool,
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::thruster_faults"))]
    faults: Faults,
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::thruster_faults"))]
    record: Faults,
    stall: StallGuard,
}

impl Thruster {
    pub(super) fn new(node: Node) -> Self {
        Self {
            node,
            plant: Plant::new(CHARACTERISTICS),
            wanted_rad_s: 0.0,
            timeout: Duration::ZERO,
            watch: Watch::default(),
            before_timeout_rad_s: 0.0,
            zero_seen: false,
            faults: Faults::empty(),
            record: Faults::empty(),
            stall: StallGuard::default(),
        }
    }

    /// The timeout has struck.
    fn stop_running(&mut self) {
        self.before_timeout_rad_s = self.wanted_rad_s;
        self.wanted_rad_s = 0.0;
        self.zero_seen = false;
    }

    /// Any command, a poll too, clears the timeout stop (Thruster manual §2.3).
    fn end_timeout(&mut self, cx: &Context<'_>) {
        if self.watch.hear(cx.now) && cx.injected.resume_after_timeout {
            self.wanted_rad_s = self.before_timeout_rad_s;
            self.zero_seen = true;
        }
    }

    fn update(&mut self, cx: &Context<'_>) {
        let protection = self.faults & Faults::ZERO_PROTECTION;
        self.faults = (self.faults & LATCHED) | protection | Faults::from_bits_retain(cx.injected.fault_bits);
        self.faults.set(Faults::TIMEOUT, self.watch.has_struck() || self.faults.contains(Faults::TIMEOUT));
        if self.stall.has_struck(cx.now, self.plant.is_stalled()) {
            self.faults |= Faults::STALL;
        }
        self.record |= self.faults;
        let share = match self.faults.intersects(Faults::DRIVER_HOT | Faults::MOTOR_HOT) {
            true => HOT_SHARE,
            false => 1.0,
        };
        let rad_s = self.wanted_rad_s * share;
        self.plant.set_drive(if rad_s == 0.0 || self.faults.intersects(OUTPUT_OFF) {
            Drive::Off
        } else {
            Drive::Speed { rad_s, acceleration: f64::INFINITY }
        });
    }

    fn hear(&mut self, cx: &mut Context<'_>, request: &Request) {
        if let Some(name) = name(request) {
            cx.command(name);
        }
        // EF is the one query that still sees the timeout that it ends.
        let faults_before = self.faults;
        self.end_timeout(cx);
        self.update(cx);
        let reply = match *request {
            Request::ReadFaults => Reply::Faults { faults: faults_before },
            _ if cx.injected.refuse && name(request).is_some() => {
                cx.ignored(name(request).unwrap_or_default(), "injected");
                refusal(request)
            }
            _ => self.carry_out(cx, request),
        };
        self.update(cx);
        if let Ok(frame) = thruster::can::reply(self.node, &reply) {
            let delay = cx.random.between(REPLY_MIN, REPLY_MAX);
            cx.send(delay, Wire::Can(frame), false);
        }
    }

    fn carry_out(&mut self, cx: &mut Context<'_>, request: &Request) -> Reply {
        match *request {
            Request::Signal { signal } => {
                let fits = signal.0.unsigned_abs() <= SIGNAL_MAX.unsigned_abs();
                let rad_s = f64::from(signal.0) / f64::from(SIGNAL_MAX) * self.plant.max_speed_rad_s();
                self.run_at(cx, request, fits.then_some(rad_s), Reply::Signal { signal })
            }
            Request::Speed { speed } => {
                let fits = speed.0 == 0 || speed.0.unsigned_abs() >= SPEED_MIN_MAGNITUDE;
                let rad_s = f64::from(speed.0) * RPM;
                self.run_at(cx, request, fits.then_some(rad_s), Reply::Speed { speed })
            }
            Request::EmergencyStop => {
                if self.may_stop(cx, request) {
                    self.wanted_rad_s = 0.0;
                }
                Reply::EmergencyStop
            }
            Request::SetTimeout { timeout } => {
                if timeout.0 != TIMEOUT_OFF && !(TIMEOUT_MIN..=TIMEOUT_MAX).contains(&timeout.0) {
                    return refusal(request);
                }
                self.timeout = Duration::from_millis(u64::from(timeout.0));
                Reply::Timeout { timeout }
            }
            Request::ClearFaults => {
                self.faults -= LATCHED;
                self.stall = StallGuard::default();
                Reply::FaultsCleared
            }
            // No encoder.
            Request::AbsolutePosition { .. }
            | Request::SetAbsoluteZero
            | Request::SetPositionLimits { .. }
            | Request::RelativePosition { .. }
            | Request::SetRelativeZero
            | Request::ClearRelativePosition => refusal(request),
            Request::ReadAbsolutePosition => Reply::MeasuredPosition { position: Decidegrees(0) },
            Request::ReadRelativePosition => Reply::MeasuredRelativePosition { position: Decidegrees(0) },
            Request::ReadPositionLimits => {
                Reply::PositionLimits { reverse: LimitDecidegrees(0), forward: LimitDecidegrees(0) }
            }
            // Taken, and played no further.
            Request::RequestMode => Reply::RequestMode,
            Request::LowSpeedMode => Reply::LowSpeedMode,
            Request::MediumSpeedMode => Reply::MediumSpeedMode,
            Request::SetId { id } => accepted(request, Reply::Id { id }),
            Request::SetBitrate { bitrate } => accepted(request, Reply::Bitrate { bitrate }),
            Request::ConfigureReturn { flags, frames } => {
                accepted(request, Reply::ReturnConfigured { flags, frames })
            }
            Request::ConfigureStream { frames, interval } => {
                accepted(request, Reply::StreamConfigured { frames, interval })
            }
            Request::SetParameter { parameter, data } => Reply::ParameterSet { parameter, data },
            Request::ReadParameter { parameter } => Reply::Parameter { parameter, data: [0; 4] },
            Request::ReadSpeed => Reply::MeasuredSpeed { speed: Rpm(to_i16(self.plant.speed_rad_s() / RPM)) },
            Request::ReadCurrent => {
                Reply::Current { current: Deciamps(to_i16(self.plant.current_a() * 10.0)) }
            }
            Request::ReadVoltage => {
                Reply::Voltage { voltage: Decivolts(to_u16(self.plant.voltage_v() * 10.0)) }
            }
            Request::ReadMotorTemperature => {
                Reply::MotorTemperature { temperature: Celsius(to_i16(self.plant.motor_c())) }
            }
            Request::ReadDriverTemperature => {
                Reply::DriverTemperature { temperature: Celsius(to_i16(self.plant.driver_c())) }
            }
            Request::ReadFaults => Reply::Faults { faults: self.faults },
            Request::ReadFaultRecord => Reply::FaultRecord { faults: self.record },
            Request::Unknown { payload } => Reply::Unknown { payload },
        }
    }

    /// Takes a new speed, or refuses it. `None`: outside the manual's range.
    fn run_at(
        &mut self,
        cx: &mut Context<'_>,
        request: &Request,
        rad_s: Option<f64>,
        accepted: Reply,
    ) -> Reply {
        let Some(rad_s) = rad_s else { return refusal(request) };
        if rad_s == 0.0 {
            if !self.may_stop(cx, request) {
                return accepted;
            }
            self.zero_seen = true;
            self.wanted_rad_s = 0.0;
            self.faults -= Faults::ZERO_PROTECTION;
        } else if !self.zero_seen {
            self.faults |= Faults::ZERO_PROTECTION;
        }
        if self.faults.intersects(OUTPUT_OFF) {
            self.wanted_rad_s = 0.0;
            cx.ignored(name(request).unwrap_or_default(), "fault");
            return refusal(request);
        }
        if rad_s != 0.0 && cx.injected.ignore_motion {
            cx.ignored(name(request).unwrap_or_default(), "injected");
            return accepted;
        }
        self.wanted_rad_s = rad_s;
        accepted
    }

    fn may_stop(&self, cx: &mut Context<'_>, request: &Request) -> bool {
        if cx.injected.ignore_stop {
            let name = name(request).unwrap_or_default();
            cx.ignored(name, "injected");
        }
        !cx.injected.ignore_stop
    }
}

impl Model for Thruster {
    fn hear_frame(&mut self, cx: &mut Context<'_>, frame: &CanFrame) {
        let frame = if cx.injected.lenient { lenient::as_thruster(frame) } else { *frame };
        if let Ok((node, request)) = thruster::can::decode_request(&frame)
            && node == self.node
        {
            self.hear(cx, &request);
        }
    }

    fn next_timer(&self) -> Option<Duration> {
        [self.watch.strikes_at(self.own_timeout()), self.stall.strikes_at()].into_iter().flatten().min()
    }

    fn run(&mut self, cx: &mut Context<'_>) {
        if self.watch.strikes(self.own_timeout(), cx) {
            self.stop_running();
        }
        self.update(cx);
    }

    fn fault_word(&self) -> u16 {
        self.faults.bits()
    }

    fn own_timeout(&self) -> Option<Duration> {
        (!self.timeout.is_zero()).then_some(self.timeout)
    }

    fn power_cycle(&mut self) {
        let Self { node, plant, timeout, .. } = self;
        *self = Self { plant: plant.clone(), timeout: *timeout, ..Self::new(*node) };
    }

    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }
}

/// The reply to a setting that the manual allows, else the refusal.
fn accepted(request: &Request, reply: Reply) -> Reply {
    if request.encode().is_ok() { reply } else { refusal(request) }
}

fn refusal(request: &Request) -> Reply {
    let parameter = match request {
        Request::AbsolutePosition { speed, .. } | Request::RelativePosition { speed, .. } => speed.0,
        Request::SetPositionLimits { .. } => POSITION_LIMITS,
        _ => 0,
    };
    Reply::Refused { command: request.command(), parameter }
}

/// What the log calls a command; nothing for queries.
fn name(request: &Request) -> Option<&'static str> {
    Some(match request {
        Request::Signal { signal: Percent(0) } => "TC 0",
        Request::Signal { .. } => "TC signal",
        Request::Speed { speed: Rpm(0) } => "VC 0",
        Request::Speed { .. } => "VC speed",
        Request::ClearFaults => "CF clear faults",
        Request::SetTimeout { .. } => "ST timeout",
        Request::RequestMode => "MQ request mode",
        Request::LowSpeedMode => "ML low speed mode",
        Request::MediumSpeedMode => "MM medium speed mode",
        Request::SetId { .. } => "CI id",
        Request::SetBitrate { .. } => "CB bitrate",
        Request::ConfigureReturn { .. } => "VM return format",
        Request::ConfigureStream { .. } => "SR stream",
        Request::SetParameter { .. } => "SP parameter",
        Request::AbsolutePosition { .. } => "LA position",
        Request::SetAbsoluteZero => "AZ absolute zero",
        Request::SetPositionLimits { .. } => "SP LA position limits",
        Request::RelativePosition { .. } => "LR relative position",
        Request::SetRelativeZero => "RZ relative zero",
        Request::ClearRelativePosition => "RC clear relative position",
        Request::EmergencyStop => "LS emergency stop",
        Request::Unknown { .. } => "other",
        Request::ReadSpeed
        | Request::ReadCurrent
        | Request::ReadVoltage
        | Request::ReadMotorTemperature
        | Request::ReadDriverTemperature
        | Request::ReadFaults
        | Request::ReadFaultRecord
        | Request::ReadParameter { .. }
        | Request::ReadAbsolutePosition
        | Request::ReadPositionLimits
        | Request::ReadRelativePosition => return None,
    })
}

#[cfg(test)]
#[path = "thruster_tests.rs"]
mod tests;
