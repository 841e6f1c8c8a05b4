//! What the hosts have configured of an axis.

use super::Axis;
use crate::motor::{Protocol, Reading};

/// Axis parameters (PROTOCOL.md, Axis parameters) with their defaults.
mod parameter {
    pub const BUS: u16 = 1;
    pub const PROTOCOL: u16 = 2;
    pub const NODE: u16 = 3;
    pub const DIRECTION: u16 = 4;
    pub const STOP_ACTION: u16 = 5;
    pub const TTL_US: (u16, u32) = (6, 100_000);
    pub const MISSED_REPLIES: (u16, u32) = (10, 3);
    pub const STANDSTILL: (u16, f32) = (11, 0.105);
    pub const STOP_REPEAT_US: (u16, u32) = (13, 500_000);
    pub const VELOCITY_LIMIT: u16 = 14;
    pub const CURRENT_LIMIT: u16 = 15;
    pub const POSITION_MIN: u16 = 16;
    pub const POSITION_MAX: u16 = 17;
    pub const TEMPERATURE_LIMIT: u16 = 19;
    pub const LIMIT_MARGIN: (u16, f64) = (20, 0.1);
    pub const ALLOW_UNKNOWN_TIMEOUT: (u16, u32) = (21, 0);
    pub const D5_ACK_LEVEL: (u16, u32) = (22, 2);
    pub const D5_REQUEST_ID: u16 = 23;
    pub const D5_REPLY_ID: u16 = 24;
    pub const RELEASE_BRAKE: (u16, u32) = (26, 0);
    pub const INFINITE_TTL: u16 = 27;
    pub const TRIP_GROUP: u16 = 34;
    pub const ALLOW_NO_TIMEOUT: (u16, u32) = (35, 0);
}

/// −1 as it comes, zigzag.
const MINUS_ONE: u32 = 1;

/// What a stop does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StopAction {
    Coast,
    Hold,
    Brake,
}

impl Axis {
    pub fn set(&mut self, number: u16, bits: u32) {
        self.parameters.insert(number, bits);
        if matches!(number, parameter::BUS | parameter::PROTOCOL | parameter::NODE) {
            self.motor_timeout_ms = None;
            self.timeout_written = false;
            self.asked.clear();
        }
    }

    fn get(&self, (number, default): (u16, u32)) -> u32 {
        self.parameters.get(&number).copied().unwrap_or(default)
    }

    pub fn bus(&self) -> Option<usize> {
        self.parameters.get(&parameter::BUS).and_then(|bus| usize::try_from(*bus).ok())
    }

    pub fn protocol(&self) -> Option<Protocol> {
        self.parameters.get(&parameter::PROTOCOL).and_then(|number| Protocol::of_number(*number))
    }

    pub fn node(&self) -> Option<u8> {
        self.parameters.get(&parameter::NODE).and_then(|node| u8::try_from(*node).ok())
    }

    pub fn stop_action(&self) -> Option<StopAction> {
        match self.parameters.get(&parameter::STOP_ACTION)? {
            1 => Some(StopAction::Coast),
            2 => Some(StopAction::Hold),
            3 => Some(StopAction::Brake),
            _ => None,
        }
    }

    pub fn ttl_us(&self) -> u64 {
        self.get(parameter::TTL_US).into()
    }

    pub fn missed_replies(&self) -> u64 {
        self.get(parameter::MISSED_REPLIES).into()
    }

    pub fn stop_repeat_us(&self) -> u64 {
        self.get(parameter::STOP_REPEAT_US).into()
    }

    /// Up to this speed the motor counts as standing; the gateway reckons in f32.
    pub fn still(&self) -> f64 {
        let (number, default) = parameter::STANDSTILL;
        f64::from(f32::from_bits(self.get((number, default.to_bits())))) * (1.0 + 1e-3) + 1e-6
    }

    pub fn allows_unknown_timeout(&self) -> bool {
        self.get(parameter::ALLOW_UNKNOWN_TIMEOUT) != 0
    }

    /// Whether it may be armed though no timeout counts: the gateway knows whether it is off or unknown.
    pub fn allows_without_timeout(&self) -> bool {
        self.allows_unknown_timeout() || self.allows_no_timeout()
    }

    pub fn allows_no_timeout(&self) -> bool {
        self.get(parameter::ALLOW_NO_TIMEOUT) != 0
    }

    pub fn releases_brake(&self) -> bool {
        self.get(parameter::RELEASE_BRAKE) != 0
    }

    pub fn d5_ack_level(&self) -> u32 {
        self.get(parameter::D5_ACK_LEVEL)
    }

    pub fn d5_request_id(&self) -> Option<u32> {
        self.parameters.get(&parameter::D5_REQUEST_ID).copied()
    }

    pub fn d5_reply_id(&self) -> Option<u32> {
        self.parameters.get(&parameter::D5_REPLY_ID).copied()
    }

    pub fn is_without_expiry(&self) -> bool {
        self.get((parameter::INFINITE_TTL, 0)) != 0
    }

    pub fn trip_group(&self) -> Option<u32> {
        self.parameters.get(&parameter::TRIP_GROUP).copied()
    }

    /// Bus, protocol and node.
    pub fn wiring(&self) -> [Option<u8>; 3] {
        [parameter::BUS, parameter::PROTOCOL, parameter::NODE]
            .map(|number| self.parameters.get(&number).and_then(|value| u8::try_from(*value).ok()))
    }

    /// Whether a measured value is beyond a limit and its margin (G3; PROTOCOL.md, `limit_margin`). The torque of motion mode is not
    /// looked at. Allowance: the gateway reckons in f32.
    pub fn is_exceeded_by(&self, reading: &Reading) -> bool {
        let float = |number| self.parameters.get(&number).map(|bits| f64::from(f32::from_bits(*bits)));
        let margin = float(parameter::LIMIT_MARGIN.0).unwrap_or(parameter::LIMIT_MARGIN.1);
        let beyond = |value: Option<f64>, limit: Option<f64>, slack: f64| {
            let (Some(value), Some(limit)) = (value, limit) else { return false };
            value > limit + slack + limit.abs() * 1e-5 + 1e-4
        };
        let of = |limit: Option<f64>| limit.map_or(0.0, |limit| limit * margin);
        let [velocity, current, hottest, lowest, highest] = [
            parameter::VELOCITY_LIMIT,
            parameter::CURRENT_LIMIT,
            parameter::TEMPERATURE_LIMIT,
            parameter::POSITION_MIN,
            parameter::POSITION_MAX,
        ]
        .map(float);
        // A position has the margin of 1 rad at least.
        let slack = |limit: Option<f64>| limit.map_or(0.0, |limit| limit.abs().max(1.0) * margin);
        let is_turned_around = self.parameters.get(&parameter::DIRECTION) == Some(&MINUS_ONE);
        let position = reading.position.map(|position| if is_turned_around { -position } else { position });
        beyond(reading.speed, velocity, of(velocity))
            || beyond(reading.current, current, of(current))
            || beyond(reading.temperature, hottest, 0.0)
            || beyond(position, highest, slack(highest))
            || beyond(position.map(|at| -at), lowest.map(|at| -at), slack(lowest))
    }

    /// Whether it has all that makes it an axis.
    pub fn is_complete(&self) -> bool {
        self.bus().is_some()
            && self.protocol().is_some()
            && self.node().is_some()
            && self.stop_action().is_some()
    }
}
