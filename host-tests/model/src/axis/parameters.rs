//! What the hosts have configured of an axis.

use super::{Axis, Place, Waiting};
use crate::can_id::is_extended;
use crate::motor::{Goal, Protocol, Reading, Returns, Timeout};

/// Axis parameters (PROTOCOL.md, Axis parameters) with their defaults.
mod parameter {
    pub const BUS: u16 = 1;
    pub const PROTOCOL: u16 = 2;
    pub const NODE: u16 = 3;
    pub const DIRECTION: u16 = 4;
    pub const STOP_ACTION: u16 = 5;
    pub const TTL_US: (u16, u32) = (6, 100_000);
    pub const REFRESH_US: (u16, u32) = (7, 20_000);
    pub const FAULT_POLL_US: (u16, u32) = (8, 100_000);
    pub const STATE_POLL_US: (u16, u32) = (9, 50_000);
    pub const MISSED_REPLIES: (u16, u32) = (10, 3);
    pub const STANDSTILL: (u16, f32) = (11, 0.105);
    pub const STOP_REPEAT_US: (u16, u32) = (13, 500_000);
    pub const VELOCITY_LIMIT: u16 = 14;
    pub const CURRENT_LIMIT: u16 = 15;
    pub const POSITION_MIN: u16 = 16;
    pub const POSITION_MAX: u16 = 17;
    pub const SIGNAL_LIMIT: u16 = 18;
    pub const TEMPERATURE_LIMIT: u16 = 19;
    pub const LIMIT_MARGIN: (u16, f64) = (20, 0.1);
    pub const ALLOW_UNKNOWN_TIMEOUT: (u16, u32) = (21, 0);
    pub const D5_ACK_LEVEL: (u16, u32) = (22, 2);
    pub const D5_REQUEST_ID: u16 = 23;
    pub const D5_REPLY_ID: u16 = 24;
    pub const POSITION_DEVICE: (u16, u32) = (25, 0);
    pub const RELEASE_BRAKE: (u16, u32) = (26, 0);
    pub const INFINITE_TTL: u16 = 27;
    pub const TORQUE_LIMIT: u16 = 28;
    pub const TRIP_GROUP: u16 = 34;
    pub const ALLOW_NO_TIMEOUT: (u16, u32) = (35, 0);
    pub const UNCOMMANDED: u16 = 36;
    pub const ALLOW_UNCOMMANDED: (u16, u32) = (37, 0);
    pub const ALLOW_UNVERIFIED_BRAKE: (u16, u32) = (38, 0);
    pub const WARNINGS_ARE_FAULTS: (u16, u32) = (44, 0);
    pub const RETURN_MODE: (u16, u32) = (45, 0);
    pub const RMD_DIALECT: (u16, u32) = (46, 1);
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
    /// Sets a parameter, or unsets it; whether it is another motor from now on, which is reached by
    /// other frames.
    pub fn set(&mut self, number: u16, bits: Option<u32>) -> bool {
        let before = match bits {
            Some(bits) => self.parameters.insert(number, bits),
            None => self.parameters.remove(&number),
        };
        let moved = Self::is_address(number) && before != bits;
        if moved {
            self.motor_timeout_ms = None;
            self.motor_timeouts_asked.clear();
            self.timeout = Timeout::Unknown;
            self.asked.clear();
            // It is another motor, which owes nothing.
            self.duty = None;
            self.waiting = Waiting::Unknown;
            self.objects = false;
        }
        moved
    }

    /// Whether nothing is set.
    pub fn is_blank(&self) -> bool {
        self.parameters.is_empty()
    }

    /// Whether a parameter says which motor it is.
    fn is_address(number: u16) -> bool {
        use parameter::{BUS, D5_REPLY_ID, D5_REQUEST_ID, NODE, PROTOCOL};
        matches!(number, BUS | PROTOCOL | NODE | D5_REQUEST_ID | D5_REPLY_ID)
    }

    fn float(&self, number: u16) -> Option<f64> {
        self.parameters.get(&number).map(|bits| f64::from(f32::from_bits(*bits)))
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

    /// How often a setpoint is sent again at least (G2): as configured, 20 ms where the motor's
    /// timeout is not known, a third of it where it is.
    pub fn refresh_us(&self) -> u64 {
        let known = |ms| u64::from(ms) * 1_000 / 3;
        let asked = self.motor_timeouts_asked.iter().copied().map(known);
        let third = asked.fold(self.motor_timeout_ms.map_or(20_000, known), u64::max);
        u64::from(self.get(parameter::REFRESH_US)).min(third)
    }

    /// What its motor's own timeout may have been programmed to, ms.
    pub fn timeouts_ms(&self) -> impl Iterator<Item = u32> {
        self.motor_timeout_ms.into_iter().chain(self.motor_timeouts_asked.iter().copied())
    }

    /// A provisioning was refused, and its host has read that.
    pub fn is_not_provisioned(&mut self, timeout_ms: u32) {
        let place = self.motor_timeouts_asked.iter().rposition(|asked| *asked == timeout_ms);
        place.map(|place| self.motor_timeouts_asked.remove(place));
    }

    pub fn fault_poll_us(&self) -> u64 {
        self.get(parameter::FAULT_POLL_US).into()
    }

    pub fn state_poll_us(&self) -> u64 {
        self.get(parameter::STATE_POLL_US).into()
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

    /// A threshold of standstill that is less than the motor can tell (G1). Allowance: it is an
    /// f32.
    pub fn blind_standstill(&self) -> Option<f64> {
        let (number, default) = parameter::STANDSTILL;
        let threshold = self.float(number).unwrap_or(default.into());
        (threshold * (1.0 + 1e-6) < self.protocol()?.speed_unit_rad_s()).then_some(threshold)
    }

    /// Above this speed, rad/s, a motor turns that nobody has set in motion (G1).
    pub fn uncommanded(&self) -> Option<f64> {
        let (number, default) = parameter::STANDSTILL;
        let still = self.float(number).unwrap_or(default.into());
        let threshold = self.float(parameter::UNCOMMANDED).unwrap_or(5.0 * still);
        (self.get(parameter::ALLOW_UNCOMMANDED) == 0).then_some(threshold * (1.0 + 1e-3) + 1e-6)
    }

    /// Bits of the fault word that a thruster only reports (Thruster manual §3): over- and
    /// under-voltage, and its sensors of the temperature where nothing limits that.
    pub fn warning_bits(&self) -> u16 {
        let are_faults = self.get(parameter::WARNINGS_ARE_FAULTS) != 0;
        match self.protocol() {
            Some(Protocol::Thruster) if !are_faults => {
                if self.parameters.contains_key(&parameter::TEMPERATURE_LIMIT) {
                    0x0018
                } else {
                    0x3018
                }
            }
            _ => 0,
        }
    }

    /// Whether the axis may be armed with a motor whose own timeout is this.
    pub fn allows(&self, timeout: Timeout) -> bool {
        match timeout {
            Timeout::On => true,
            Timeout::Unknown => self.get(parameter::ALLOW_UNKNOWN_TIMEOUT) != 0,
            Timeout::Off => self.get(parameter::ALLOW_NO_TIMEOUT) != 0,
        }
    }

    /// A limit that nothing can measure there (G2): its parameter.
    pub fn unmeasurable_limit(&self) -> Option<u16> {
        let torque = self.protocol()? != Protocol::Rmd;
        let current = self.protocol()? == Protocol::D5;
        let position =
            self.protocol()? == Protocol::Thruster && self.get(parameter::POSITION_DEVICE) == 0;
        [
            (parameter::CURRENT_LIMIT, current),
            (parameter::POSITION_MIN, position),
            (parameter::POSITION_MAX, position),
            (parameter::TORQUE_LIMIT, torque),
        ]
        .into_iter()
        .find_map(|(number, blind)| {
            (blind && self.parameters.contains_key(&number)).then_some(number)
        })
    }

    /// The limit that what is sent exceeds (G2). Allowance: limits are f32.
    pub fn limit_exceeded_by(&self, goal: &Goal) -> Option<u16> {
        let sign =
            if self.parameters.get(&parameter::DIRECTION) == Some(&MINUS_ONE) { -1.0 } else { 1.0 };
        let position = goal.position.map(|position| position * sign);
        let lowest = self.float(parameter::POSITION_MIN).map(|limit| -limit);
        [
            (parameter::VELOCITY_LIMIT, goal.speed, self.float(parameter::VELOCITY_LIMIT)),
            (parameter::CURRENT_LIMIT, goal.current, self.float(parameter::CURRENT_LIMIT)),
            (parameter::SIGNAL_LIMIT, goal.signal, self.float(parameter::SIGNAL_LIMIT)),
            (parameter::POSITION_MAX, position, self.float(parameter::POSITION_MAX)),
            (parameter::POSITION_MIN, position.map(|position| -position), lowest),
        ]
        .into_iter()
        .find_map(|(number, value, limit)| {
            let (value, limit) = (value?, limit?);
            (value > limit + limit.abs() * 1e-6 + 1e-9).then_some(number)
        })
    }

    pub fn releases_brake(&self) -> bool {
        self.get(parameter::RELEASE_BRAKE) != 0
    }

    /// The dialect that the axis states, by its number.
    pub fn dialect(&self) -> u32 {
        self.get(parameter::RMD_DIALECT)
    }

    /// Whether the axis says that its motor has a brake.
    pub fn has_brake(&self) -> bool {
        self.stop_action() == Some(StopAction::Brake) || self.releases_brake()
    }

    pub fn allows_unverified_brake(&self) -> bool {
        self.get(parameter::ALLOW_UNVERIFIED_BRAKE) != 0
    }

    /// What its thruster returns for TC and VC: bytes 6 and 7 of its VM.
    pub fn return_mode(&self) -> Returns {
        Returns::of(self.get(parameter::RETURN_MODE))
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

    /// The CAN id of requests to its motor.
    pub fn request_id(&self) -> Option<u32> {
        let node = u32::from(self.node()?);
        Some(match self.protocol()? {
            Protocol::Rmd => 0x140 + node,
            Protocol::Thruster => 0x300 + node,
            Protocol::D5 => self.d5_request_id().unwrap_or(node),
        })
    }

    /// Whether its motor is asked, or answers, with ids of 29 bits.
    pub fn has_extended_ids(&self) -> bool {
        let ids = [self.d5_request_id(), self.d5_reply_id()];
        self.protocol() == Some(Protocol::D5) && ids.into_iter().flatten().any(is_extended)
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

    pub fn place(&self) -> Place {
        let d5_ids = [self.d5_request_id(), self.d5_reply_id()];
        let return_mode = self.get(parameter::RETURN_MODE);
        Place { wiring: self.wiring(), d5_ids, return_mode, window_us: 0 }
    }

    /// Whether a measured value is beyond a limit and its margin (G3; PROTOCOL.md, `limit_margin`).
    /// The torque of motion mode is not looked at. Allowance: the gateway reckons in f32.
    pub fn is_exceeded_by(&self, reading: &Reading) -> bool {
        let float = |number| self.float(number);
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
        let position =
            reading.position.map(|position| if is_turned_around { -position } else { position });
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
