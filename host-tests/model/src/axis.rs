//! One axis: what the hosts have configured and the gateway has told, and what follows for what may be sent.

use crate::checks::Arming;
use crate::motor::Protocol;
use crate::wire::Told;
use std::collections::BTreeMap;

/// A request that gave permission to move.
#[derive(Debug, Clone)]
pub(crate) struct Permit {
    /// Whose request it was.
    pub link: u8,
    pub sequence: u16,
    /// `None` only where the axis is configured so.
    pub expires_us: Option<u64>,
    /// Accepted and carried out: its expiry stops the axis. What is not in force yet may only let motion through.
    pub in_force: bool,
    /// A relative move: its target is known when its result is.
    pub is_relative: bool,
    /// The native command that it must be.
    pub native: Option<Vec<u8>>,
    /// The bytes that were sent for it first, and must be sent again.
    pub data: Option<Vec<u8>>,
    /// To be sent once.
    pub once: bool,
    /// Sent.
    pub sent: bool,
}

/// Why a stop is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cause {
    /// A host asked.
    Asked,
    /// An e-stop.
    EStop,
    /// The setpoint expired.
    Expired,
    /// The host in command fell silent or gave its authority back.
    Host,
    /// The motor told of a fault.
    Fault,
    /// The motor refused a motion.
    Refused,
    /// The motor answers nothing.
    Silent,
    /// A motion frame was not acknowledged.
    NotAcknowledged,
    /// The bus went off.
    BusOff,
    /// Another axis of the trip group tripped.
    Group,
    /// The gateway was reset.
    Reset,
    /// The gateway said so.
    Told,
}

/// A stop that the gateway owes.
#[derive(Debug)]
pub(crate) struct Duty {
    pub cause: Cause,
    pub since_us: u64,
    /// Time of others when it began.
    pub outside_us: u64,
    /// How many stops on this bus may go before it, and it.
    pub k: u64,
    /// An unreachable motor is left alone for a while: its first stop is not due at once.
    pub rests: bool,
    /// Stop frames that have left since.
    pub left: u32,
    /// Those of the confirmed stop that it goes on with.
    pub left_before: u32,
    /// When the latest of them had, and the time of others then.
    pub last: Option<(u64, u64)>,
    pub acknowledged_us: Option<u64>,
    /// Readings of standstill in a row, requested after the acknowledgement.
    pub still: u32,
    /// The brake: locked, seen to be locked, output off.
    pub locking: bool,
    pub locked: bool,
    pub output_off: bool,
    pub confirmed: bool,
}

impl Duty {
    /// Nothing of it has left, and something should.
    pub fn is_first_due(&self) -> bool {
        self.left == 0 && !self.rests
    }
}

/// A request that has left and that the motor may answer.
#[derive(Debug)]
pub(crate) struct Asked {
    pub data: Vec<u8>,
    pub handed_us: u64,
    pub left_us: u64,
}

/// One axis.
#[derive(Debug, Default)]
pub(crate) struct Axis {
    /// Parameters that were set: number and bits.
    parameters: BTreeMap<u16, u32>,
    pub told: Told,
    pub armed: bool,
    pub armed_us: u64,
    pub epoch: Option<u32>,
    pub permits: Vec<Permit>,
    /// Why and when permission to move ended last.
    pub revoked: Option<(Cause, u64)>,
    pub duty: Option<Duty>,
    pub unreachable: bool,
    /// Programmed by provisioning.
    pub motor_timeout_ms: Option<u32>,
    /// The motor has acknowledged a timeout of its own, and nothing has touched it since.
    pub timeout_written: bool,
    pub arming: Option<Arming>,
    pub asked: Vec<Asked>,
    /// When its motor was last heard, and the time of others then.
    pub heard: (u64, u64),
    /// Requests to clear it that are under way, and when one had its result.
    pub clearing: u32,
    pub cleared_us: Option<u64>,
    /// A native stop that was asked for while it was idle.
    pub native_stop: Option<Vec<u8>>,
}

/// Axis parameters (PROTOCOL.md, Axis parameters) with their defaults.
mod parameter {
    pub const BUS: u16 = 1;
    pub const PROTOCOL: u16 = 2;
    pub const NODE: u16 = 3;
    pub const STOP_ACTION: u16 = 5;
    pub const TTL_US: (u16, u32) = (6, 100_000);
    pub const MISSED_REPLIES: (u16, u32) = (10, 3);
    pub const STANDSTILL: (u16, f32) = (11, 0.1);
    pub const STOP_REPEAT_US: (u16, u32) = (13, 500_000);
    pub const ALLOW_UNKNOWN_TIMEOUT: (u16, u32) = (21, 0);
    pub const D5_ACK_LEVEL: (u16, u32) = (22, 2);
    pub const D5_REQUEST_ID: u16 = 23;
    pub const D5_REPLY_ID: u16 = 24;
    pub const RELEASE_BRAKE: (u16, u32) = (26, 0);
    pub const INFINITE_TTL: u16 = 27;
    pub const TRIP_GROUP: u16 = 34;
}

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

    /// Whether it has all that makes it an axis.
    pub fn is_complete(&self) -> bool {
        self.bus().is_some()
            && self.protocol().is_some()
            && self.node().is_some()
            && self.stop_action().is_some()
    }

    /// Whether the gateway says that it may move or is about to.
    pub fn is_busy(&self) -> bool {
        matches!(self.told, Told::Armed | Told::Active | Told::Stopping)
    }

    /// What a reset leaves of it: the parameters.
    pub fn restarted(&mut self) -> Self {
        Self { parameters: std::mem::take(&mut self.parameters), ..Self::default() }
    }
}
