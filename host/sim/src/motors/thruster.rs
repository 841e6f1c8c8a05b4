//! A simulated thruster, or a device with an encoder (Thruster manual), on CAN.

mod commands;
mod names;
mod positions;
mod returns;

use std::f64::consts::TAU;
use std::time::Duration;

use host_protocol::CanFrame;
use thruster::{Celsius, Deciamps, Decivolts, Faults, Node, Reply, Request, Rpm};

use self::commands::refusal;
use self::names::name;
use self::positions::Positions;
use self::returns::Returns;
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

/// A propeller in water, or a rudder that a device with an encoder turns, on 24 V.
const CHARACTERISTICS: Characteristics = Characteristics {
    max_speed_rad_s: FULL_SPEED_RPM * RPM,
    max_current_a: 25.0,
    speed_per_ampere: 20.0,
    mechanical_s: 0.08,
    speed_loop_s: 0.06,
    position_gain: 8.0,
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
    returns: Returns,
    positions: Positions,
    stored: Stored,
}

/// What it keeps without power.
#[derive(Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
struct Stored {
    /// Set by CI; it has it from the next start on (Thruster manual §2.2).
    next_node: Option<u8>,
    /// Set by CB, kbit/s; the same.
    next_kilobits: Option<u16>,
    /// What CB had set before the last start, bit/s.
    bitrate: Option<u32>,
    /// System parameters that SP has written (Thruster manual §2.7).
    parameters: Vec<(u16, [u8; 4])>,
}

impl Stored {
    fn set_parameter(&mut self, parameter: u16, data: [u8; 4]) {
        self.parameters.retain(|(other, _)| *other != parameter);
        self.parameters.push((parameter, data));
    }

    fn parameter(&self, parameter: u16) -> [u8; 4] {
        self.parameters
            .iter()
            .find(|(other, _)| *other == parameter)
            .map_or([0; 4], |(_, data)| *data)
    }
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
            returns: Returns::default(),
            positions: Positions::default(),
            stored: Stored::default(),
        }
    }

    /// The timeout has struck.
    fn stop_running(&mut self) {
        self.before_timeout_rad_s = self.wanted_rad_s;
        self.wanted_rad_s = 0.0;
        self.positions.stop();
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
        self.faults =
            (self.faults & LATCHED) | protection | Faults::from_bits_retain(cx.injected.fault_bits);
        self.faults
            .set(Faults::TIMEOUT, self.watch.has_struck() || self.faults.contains(Faults::TIMEOUT));
        if self.stall.has_struck(cx.now, self.plant.is_stalled()) {
            self.faults |= Faults::STALL;
        }
        self.record |= self.faults;
        let share = match self.faults.intersects(Faults::DRIVER_HOT | Faults::MOTOR_HOT) {
            true => HOT_SHARE,
            false => 1.0,
        };
        let rad_s = self.wanted_rad_s * share;
        self.plant.set_drive(match self.positions.target() {
            _ if self.faults.intersects(OUTPUT_OFF) => Drive::Off,
            Some((rad, max_speed)) if !self.faults.contains(Faults::ENCODER) => {
                Drive::Position { rad, max_speed: max_speed * share }
            }
            _ if rad_s == 0.0 => Drive::Off,
            _ => Drive::Speed { rad_s, acceleration: f64::INFINITY },
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
        let delay = cx.random.between(REPLY_MIN, REPLY_MAX);
        self.answer(cx, request, reply, delay);
    }

    /// What it measures, as returned frames tell it.
    fn readings(&self) -> returns::Readings {
        returns::Readings {
            speed: Rpm(to_i16(self.plant.speed_rad_s() / RPM)),
            voltage: Decivolts(to_u16(self.plant.voltage_v() * 10.0)),
            current: Deciamps(to_i16(self.plant.current_a() * 10.0)),
            faults: self.faults,
            motor: Celsius(to_i16(self.plant.motor_c())),
            driver: Celsius(to_i16(self.plant.driver_c())),
            absolute: self.positions.absolute(&self.plant),
            relative: self.positions.relative(&self.plant),
        }
    }

    /// Sends the reply, or what VM has in its place.
    fn answer(&self, cx: &mut Context<'_>, request: &Request, reply: Reply, delay: Duration) {
        for payload in self.returns.in_place_of(request, &reply, &self.readings()) {
            self.send(cx, payload, delay);
        }
    }

    fn send(&self, cx: &mut Context<'_>, payload: thruster::Payload, delay: Duration) {
        let id = thruster::can::reply_id(self.node);
        if let Some(frame) = CanFrame::data_frame(id.into(), payload.as_slice()) {
            cx.send(delay, Wire::Can(frame), false);
        }
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
        let timeout = self.watch.strikes_at(self.own_timeout());
        [timeout, self.stall.strikes_at(), self.returns.due_at()].into_iter().flatten().min()
    }

    fn run(&mut self, cx: &mut Context<'_>) {
        if self.watch.strikes(self.own_timeout(), cx) {
            self.stop_running();
        }
        self.update(cx);
        for payload in self.returns.due(cx.now, &self.readings()) {
            self.send(cx, payload, Duration::ZERO);
        }
    }

    fn fault_word(&self) -> u16 {
        self.faults.bits()
    }

    fn own_timeout(&self) -> Option<Duration> {
        (!self.timeout.is_zero()).then_some(self.timeout)
    }

    fn bitrate(&self) -> Option<u32> {
        self.stored.bitrate
    }

    fn power_cycle(&mut self) {
        let stored = std::mem::take(&mut self.stored);
        let node = stored.next_node.and_then(|node| Node::new(node).ok()).unwrap_or(self.node);
        let next = stored.next_kilobits.and_then(|kilobits| thruster::Kilobits(kilobits).info());
        let bitrate = next.map(|info| info.bits_per_second).or(stored.bitrate);
        let plant = self.plant.clone();
        *self = Self {
            positions: self.positions.after_power_cycle(&plant),
            returns: self.returns.after_power_cycle(),
            timeout: self.timeout,
            stored: Stored { bitrate, ..stored },
            plant,
            ..Self::new(node)
        };
    }

    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }
}
