//! Which motors are on the buses: by reads that mean the same to every motor, sent as raw frames.

mod d5;
mod open_bus;
mod rmd;
mod thruster;

use std::time::Duration;

use ::rmd::{Dialect, Recognised};
use host_protocol::{
    AxisParameter, AxisSummary, BusConfig, BusKind, Change, Error, Protocol, ProtocolSet, RawFrame,
    Value,
};

use crate::args::{Bitrates, ScanTarget};
use crate::config::NEW_BUS;
use crate::failure::Failure;
use crate::session::Session;
use open_bus::{Hear, OpenBus};

/// What is looked for, and how.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// The buses, and at which bitrates; all that are configured where there is none.
    pub targets: Vec<ScanTarget>,
    /// So long what motors send by themselves is listened to before any is asked.
    pub listen: Duration,
    /// Thrusters are asked too.
    pub thrusters: bool,
}

/// A bus that was scanned at one bitrate, or was not.
#[derive(Debug)]
pub struct Scanned {
    pub bus: u8,
    pub kind: BusKind,
    /// Nothing: it is not configured, and no bitrate was named.
    pub bitrate: Option<u32>,
    /// What was looked for.
    pub protocols: ProtocolSet,
    /// Nobody acknowledged what was sent.
    pub unacknowledged: bool,
    /// Frames that came faster than they were fetched.
    pub lost: u32,
    /// By how much the bus's counters of what could not be read have grown.
    pub unreadable: u32,
    pub motors: Vec<Found>,
}

/// A motor that was found.
#[derive(Debug, Clone)]
pub struct Found {
    pub protocol: Protocol,
    pub node: u8,
    /// It has answered; else it was heard only.
    pub asked: bool,
    /// The axis that is configured for it.
    pub axis: Option<u8>,
    pub model: Option<String>,
    /// RMD: the date of the firmware as the motor tells it. D5: its version.
    pub firmware: Option<String>,
    pub voltage_v: Option<f32>,
    pub temperature_c: Option<i16>,
    /// Its fault word.
    pub faults: Option<u16>,
    /// RMD: what its answers say of its dialect, and which they are.
    pub recognised: Option<Recognised>,
    pub evidence: Vec<Evidence>,
    /// RMD: the dialect that its axis states, where its answers contradict that.
    pub contradicted: Option<Dialect>,
    /// D5: whether its own timeout is on.
    pub timeout_on: Option<bool>,
    /// D5: its acknowledge level.
    pub ack_level: Option<u8>,
    /// RMD: its own timeout has struck, which it says every second.
    pub timed_out: bool,
    /// RMD: the commands whose replies it sends by itself, in hexadecimal.
    pub unasked: Vec<String>,
    /// Why two motors may have this id.
    pub doubled: Option<Doubled>,
}

/// Why two motors may have one id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Doubled {
    /// Two replies to one read.
    TwoReplies,
    /// What is the same in a motor for ever was answered in two ways.
    DifferentAnswers,
}

/// An answer that tells of a dialect.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// Data bytes of what was asked.
    pub request: [u8; 8],
    /// Data bytes of the answer.
    pub answer: [u8; 8],
    /// The dialects whose motors answer so.
    pub dialects: Vec<Dialect>,
}

impl Found {
    fn new(protocol: Protocol, node: u8) -> Self {
        Self {
            protocol,
            node,
            asked: false,
            axis: None,
            model: None,
            firmware: None,
            voltage_v: None,
            temperature_c: None,
            faults: None,
            recognised: None,
            evidence: Vec::new(),
            contradicted: None,
            timeout_on: None,
            ack_level: None,
            timed_out: false,
            unasked: Vec::new(),
            doubled: None,
        }
    }
}

/// Everything that is heard on a bus at one bitrate.
struct Motors {
    rmd: rmd::Motors,
    thruster: thruster::Motors,
    d5: d5::Motors,
    protocols: ProtocolSet,
}

impl Hear for Motors {
    fn hear(&mut self, frame: &RawFrame) {
        if self.protocols.contains(Protocol::Rmd) {
            self.rmd.hear(frame);
        }
        if self.protocols.contains(Protocol::Thruster) {
            self.thruster.hear(frame);
        }
        if self.protocols.contains(Protocol::D5) {
            self.d5.hear(frame);
        }
    }
}

/// Scans what is wanted, one bus at one bitrate after the other, and tells each when it is done.
pub fn scan(
    session: &mut Session,
    wanted: &Wanted,
    mut done: impl FnMut(&mut Session, Scanned) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let axes = session.client.list_axes()?;
    let buses = session.client.hello().buses.clone();
    let targets = match wanted.targets.as_slice() {
        [] => (0u8..)
            .zip(&buses)
            .map(|(bus, _)| ScanTarget { bus, bitrates: Bitrates::Configured })
            .collect(),
        named => named.to_vec(),
    };
    for ScanTarget { bus, bitrates } in targets {
        // The gateway says which buses there are.
        let config = session.client.bus_status(bus)?.config;
        let Some(capability) = buses.get(usize::from(bus)) else { continue };
        let kind = capability.kind;
        let bitrates = match bitrates {
            Bitrates::Configured => {
                let scanned = match config {
                    Some(config) => at_its_own(session, wanted, (bus, kind), &config, &axes)?,
                    None => Scanned::not_configured(bus, kind),
                };
                done(session, scanned)?;
                continue;
            }
            Bitrates::Named(bitrates) => bitrates,
            Bitrates::All => capability.bitrates.to_vec(),
        };
        if let Some(axis) = axes.iter().find(|axis| axis.bus == Some(bus)) {
            return Err(Failure::Explained {
                error: Error::AxisOnBus { bus, axis: axis.axis },
                text: format!(
                    "bus {bus} belongs to axis {}: it is scanned at its own bitrate only. Write \
                        `{bus}` alone, or remove the axis",
                    axis.axis
                ),
            });
        }
        let result = at_other_bitrates(session, wanted, (bus, kind), &bitrates, &axes, &mut done);
        // As it was, whatever came of it.
        let restored = configure(session, bus, config);
        result.and(restored)?;
    }
    Ok(())
}

/// Scans a bus as it is configured.
fn at_its_own(
    session: &mut Session,
    wanted: &Wanted,
    (bus, kind): (u8, BusKind),
    config: &BusConfig,
    axes: &[AxisSummary],
) -> Result<Scanned, Failure> {
    let protocols = match kind {
        BusKind::Can => looked_for(kind, config.bitrate),
        // Its motors understand one form of frames.
        BusKind::Rs485 => config.protocols,
    };
    one(session, wanted, (bus, kind), config.bitrate, protocols, axes)
}

/// Runs the bus at each bitrate that was named; on CAN until motors are found, which another one
/// would only disturb.
fn at_other_bitrates(
    session: &mut Session,
    wanted: &Wanted,
    (bus, kind): (u8, BusKind),
    bitrates: &[u32],
    axes: &[AxisSummary],
    done: &mut impl FnMut(&mut Session, Scanned) -> Result<(), Failure>,
) -> Result<(), Failure> {
    for bitrate in bitrates {
        for protocols in runs(kind, *bitrate) {
            let config = BusConfig { bitrate: *bitrate, protocols, ..NEW_BUS };
            configure(session, bus, Some(config))?;
            let scanned = one(session, wanted, (bus, kind), *bitrate, protocols, axes)?;
            let is_found = kind == BusKind::Can && !scanned.motors.is_empty();
            done(session, scanned)?;
            if is_found {
                return Ok(());
            }
        }
    }
    Ok(())
}

fn configure(session: &mut Session, bus: u8, config: Option<BusConfig>) -> Result<(), Failure> {
    session.client.begin_changes()?;
    session.client.add_changes(&[Change::Bus { bus, config }])?;
    Ok(session.client.apply_changes()?)
}

/// What motors there may be at a bitrate: D5 motors share a bus with no other.
pub fn looked_for(kind: BusKind, bitrate: u32) -> ProtocolSet {
    let (least, most) = ::d5::can::BITRATES;
    match kind {
        BusKind::Can if (least..=most).contains(&bitrate) => ProtocolSet::of(&[Protocol::D5]),
        BusKind::Can => ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]),
        BusKind::Rs485 => ProtocolSet::of(&[Protocol::Rmd, Protocol::D5]),
    }
}

/// The same as a bus can be configured: a line carries one protocol.
fn runs(kind: BusKind, bitrate: u32) -> Vec<ProtocolSet> {
    let all = looked_for(kind, bitrate);
    match kind {
        BusKind::Can => vec![all],
        BusKind::Rs485 => all.iter().map(|protocol| ProtocolSet::of(&[protocol])).collect(),
    }
}

/// Scans a bus that runs.
fn one(
    session: &mut Session,
    wanted: &Wanted,
    (bus, kind): (u8, BusKind),
    bitrate: u32,
    protocols: ProtocolSet,
    axes: &[AxisSummary],
) -> Result<Scanned, Failure> {
    let names: Vec<&str> = protocols.iter().map(Protocol::name).collect();
    session.out.aside(format!("bus {bus} at {bitrate} bit/s: {}", names.join(", ")));
    let before = session.client.bus_status(bus)?;
    let window_us = before.config.map_or(0, |config| config.reply_window_us);
    let window = Duration::from_micros(window_us.into());
    let mut open = OpenBus::open(session, bus, window)?;
    let mut motors = Motors {
        rmd: rmd::Motors::new(kind),
        thruster: thruster::Motors::default(),
        d5: d5::Motors::new(kind),
        protocols,
    };
    let acknowledged = ask(&mut open, wanted, &mut motors);
    let lost = open.lost;
    let closed = open.close();
    let (acknowledged, ()) = (acknowledged?, closed?);
    let after = session.client.bus_status(bus)?;
    let mut found = [motors.rmd.found(), motors.thruster.found(), motors.d5.found()].concat();
    for motor in &mut found {
        name_axis(session, bus, motor, axes)?;
    }
    let grown =
        |of: fn(&host_protocol::replies::BusReport) -> u32| of(&after).saturating_sub(of(&before));
    Ok(Scanned {
        bus,
        kind,
        bitrate: Some(bitrate),
        protocols,
        unacknowledged: !acknowledged,
        lost,
        unreadable: grown(|report| report.counters.rejected)
            .saturating_add(grown(|report| report.receive_errors.into())),
        motors: found,
    })
}

fn ask(bus: &mut OpenBus<'_>, wanted: &Wanted, motors: &mut Motors) -> Result<bool, Failure> {
    bus.listen(wanted.listen, motors)?;
    let looks_for = |protocol| motors.protocols.contains(protocol);
    let (rmd, d5) = (looks_for(Protocol::Rmd), looks_for(Protocol::D5));
    let thruster = looks_for(Protocol::Thruster) && wanted.thrusters;
    let acknowledged = !rmd || motors.rmd.find(bus)?;
    let acknowledged = acknowledged && (!d5 || motors.d5.find(bus)?);
    Ok(acknowledged && (!thruster || motors.thruster.find(bus)?))
}

/// Names the axis of a motor, and compares what that axis states of it with what it answered.
fn name_axis(
    session: &mut Session,
    bus: u8,
    motor: &mut Found,
    axes: &[AxisSummary],
) -> Result<(), Failure> {
    let is_of = |axis: &&AxisSummary| {
        axis.bus == Some(bus)
            && axis.protocol == Some(motor.protocol)
            && axis.node == Some(motor.node)
    };
    let Some(axis) = axes.iter().find(is_of).map(|axis| axis.axis) else { return Ok(()) };
    motor.axis = Some(axis);
    let Some(recognised) = motor.recognised else { return Ok(()) };
    let stated = session.client.read_axis_parameter(axis, AxisParameter::RmdDialect)?;
    let stated = match stated {
        Some(Value::Unsigned(number)) => Dialect::from_number(number),
        _ => None,
    };
    motor.contradicted = stated.filter(|stated| !recognised.allows(*stated));
    Ok(())
}

impl Scanned {
    fn not_configured(bus: u8, kind: BusKind) -> Self {
        Self {
            bus,
            kind,
            bitrate: None,
            protocols: ProtocolSet::NONE,
            unacknowledged: false,
            lost: 0,
            unreadable: 0,
            motors: Vec::new(),
        }
    }
}
