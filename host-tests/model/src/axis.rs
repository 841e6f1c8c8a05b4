//! One axis: what the hosts have configured and the gateway has told, and what follows for what may
//! be sent.

mod parameters;

pub(crate) use parameters::StopAction;

use crate::checks::Arming;
use crate::motor::{Protocol, Timeout};
use crate::wire::Told;
use std::collections::BTreeMap;

/// A request that gave permission to move.
#[derive(Debug, Clone)]
pub(crate) struct Permit {
    /// Whose request it was.
    pub link: u8,
    pub sequence: u16,
    /// The arming that it was given for.
    pub epoch: u32,
    /// `None` only where the axis is configured so.
    pub expires_us: Option<u64>,
    /// Accepted and carried out: its expiry stops the axis. What is not in force yet may only let
    /// motion through.
    pub in_force: bool,
    /// A relative move: its target is known when its result is.
    pub is_relative: bool,
    /// Of a cycle: its report says whether the axis took it.
    pub of_cycle: bool,
    /// The native command that it must be.
    pub native: Option<Vec<u8>>,
    /// The bytes that were sent for it first, and must be sent again.
    pub data: Option<Vec<u8>>,
    /// To be sent once.
    pub once: bool,
    /// Sent.
    pub sent: bool,
    /// A start of several motors.
    pub start: Option<Start>,
}

impl Permit {
    /// It lets nothing through but what prepares a start.
    pub fn is_of_a_start_to_come(&self) -> bool {
        self.start.as_ref().is_some_and(|start| !start.has_started)
    }
}

/// What an axis is in a start of several (PROTOCOL.md, Started together).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    /// A bit for each axis that is named.
    pub members: u32,
    pub asked_us: u64,
    /// The speed that its motor was told to have wait.
    pub told: Option<[u8; 2]>,
    pub told_us: u64,
    /// The motor has said that something waits, asked behind that.
    pub waits: bool,
    pub has_started: bool,
}

/// What waits in a D5 motor to be started (D5 manual, quick start 3, 4), as far as its answers
/// tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Waiting {
    /// Nobody knows.
    #[default]
    Unknown,
    /// Nothing: it was asked at this time.
    Nothing(u64),
    /// A speed of 0, which starts nothing: it was told that at this time.
    Rest(u64),
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
    /// A measured value was beyond a limit of the axis.
    Limit,
    /// The motor refused a motion.
    Refused,
    /// The motor answers nothing.
    Silent,
    /// A motion frame was not acknowledged.
    NotAcknowledged,
    /// The bus went off.
    BusOff,
    /// Nobody had set it in motion, and it turned.
    Uncommanded,
    /// Another axis of the trip group tripped.
    Group,
    /// The gateway was reset.
    Reset,
    /// The gateway said so.
    Told,
}

/// A stop that the gateway owes.
#[derive(Debug, Clone)]
pub(crate) struct Duty {
    pub cause: Cause,
    pub since_us: u64,
    /// The axis was at rest.
    pub from_rest: bool,
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
    /// There have been two such readings in a row.
    pub stood: bool,
    /// The brake: locked, seen to be locked, output off.
    pub locking: bool,
    pub locked: bool,
    pub output_off: bool,
    pub confirmed: bool,
    /// D5: nothing waits in it that would start, by its own words since.
    pub nothing_waits: bool,
    /// That it has not left was missed once.
    pub unsent_seen: bool,
}

impl Duty {
    /// Nothing of it has left, and something should.
    pub fn is_first_due(&self) -> bool {
        self.left == 0 && !self.rests
    }
}

/// A request that has left and that the motor may answer.
#[derive(Debug, Clone)]
pub(crate) struct Asked {
    pub data: Vec<u8>,
    pub handed_us: u64,
    pub left_us: u64,
}

/// Where an axis is configured to find its motor, and what to expect there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Place {
    /// Bus, protocol and node.
    pub wiring: [Option<u8>; 3],
    /// D5: the ids of requests and replies that were set.
    pub d5_ids: [Option<u32>; 2],
    /// Thruster: bytes 6 and 7 of its VM.
    pub return_mode: u32,
    /// How long replies are awaited on its bus.
    pub window_us: u64,
}

/// One axis.
#[derive(Debug, Clone, Default)]
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
    /// It was at rest before its latest state.
    pub came_from_rest: bool,
    /// Programmed by provisioning.
    pub motor_timeout_ms: Option<u32>,
    /// What provisionings may have programmed whose result nobody has read.
    pub motor_timeouts_asked: Vec<u32>,
    /// What is known of its motor's own timeout.
    pub timeout: Timeout,
    pub arming: Option<Arming>,
    pub asked: Vec<Asked>,
    /// When its motor was last heard, and the time of others then.
    pub heard: (u64, u64),
    /// Time on the bus of frames of others that go before its requests, and before those of motion
    /// mode.
    pub outranked_us: u64,
    /// Since when a setpoint that was accepted has not been sent, and the time of others then.
    pub undelivered: Option<(u64, u64)>,
    /// When its faults were asked for last, and the time of others then.
    pub faults_asked: (u64, u64),
    /// Armed and without a setpoint, it was first seen to turn at this time.
    pub turns_since: Option<u64>,
    /// Requests to clear it that are under way, and when one had its result.
    pub clearing: u32,
    pub cleared_us: Option<u64>,
    /// Native stops that were asked for while it was idle or arming; one that was refused stands
    /// here too, and so does the one under way.
    pub native_stops: Vec<Vec<u8>>,
    /// A host has asked, since it was armed last, for something to be told to its motor.
    pub is_to_be_told: bool,
    /// A host has asked, while it held, that its motor's output be switched off.
    pub output_off_asked: bool,
    pub waiting: Waiting,
    /// D5: its motor answers requests to others (D5 manual, table row 5).
    pub objects: bool,
}

impl Axis {
    /// Whether it is not at rest, or is polled to go on holding, as an RMD is.
    pub fn needs_its_bus(&self) -> bool {
        match self.told {
            Told::Unconfigured | Told::Idle => false,
            Told::Holding => self.protocol() == Some(Protocol::Rmd),
            _ => true,
        }
    }

    /// Whether its motor may hold, and so must hear something, an RMD's by its own timeout.
    pub fn may_be_fed(&self) -> bool {
        match self.told {
            Told::Holding => true,
            Told::Arming | Told::Armed => self.protocol() == Some(Protocol::Rmd),
            _ => false,
        }
    }

    /// Which arming it is, once a host is told: what was offered for another one is void.
    pub fn is_of_epoch(&mut self, epoch: Option<u32>) {
        self.epoch = epoch;
        self.permits.retain(|permit| epoch.is_none_or(|epoch| permit.epoch == epoch));
    }

    /// Whether the gateway says that it may move or is about to.
    pub fn is_busy(&self) -> bool {
        matches!(self.told, Told::Armed | Told::Active | Told::Stopping)
    }

    /// Its configuration alone.
    pub fn configured(&self) -> Self {
        Self { parameters: self.parameters.clone(), ..Self::default() }
    }

    /// What a reset leaves of it: the parameters, whether it is unreachable, and what an RMD motor
    /// keeps of its own timeout.
    pub fn restarted(&mut self) -> Self {
        let parameters = std::mem::take(&mut self.parameters);
        let motor_timeouts_asked = std::mem::take(&mut self.motor_timeouts_asked);
        let Self { unreachable, motor_timeout_ms, timeout, heard, .. } = *self;
        let kept = Self { parameters, unreachable, motor_timeout_ms, heard, ..Self::default() };
        let mut restarted = Self { motor_timeouts_asked, ..kept };
        if restarted.protocol() == Some(Protocol::Rmd) && timeout == Timeout::On {
            restarted.timeout = timeout;
        }
        restarted
    }
}
