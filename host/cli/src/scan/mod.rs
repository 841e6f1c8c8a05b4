//! Which motors are on the buses: by reads that mean the same to every motor, sent as raw frames.

mod d5;
mod open_bus;
mod rmd;
mod thruster;

pub use open_bus::fetch;

use std::time::Duration;

use ::rmd::{Dialect, Recognised};
use host_protocol::{
    AxisParameter, AxisSummary, BusConfig, BusKind, BusMode, Error, Protocol, ProtocolSet,
    RawFrame, Value,
};

use crate::args::{Bitrates, ScanTarget};
use crate::config::NEW_BUS;
use crate::failure::Failure;
use crate::session::Session;
use open_bus::{Hear, OpenBus};

/// What motors send by themselves comes once a second.
pub const LISTEN: Duration = Duration::from_millis(1_200);

/// What is looked for, and how.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// The buses, and at which bitrates; all that are configured where there is none.
    pub targets: Vec<ScanTarget>,
    /// So long what motors send by themselves is listened to before any is asked.
    pub listen: Duration,
    /// Thrusters are asked too.
    pub thrusters: bool,
    /// A CAN bus whose bitrate is not known is asked although it is not known to be silent.
    pub force: bool,
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
    /// Nothing was sent: its bitrate is not known, and it is not known to be silent.
    pub not_asked: Option<NotAsked>,
    /// Bitrates that were named and are not tried, as motors were found before.
    pub left_out: Vec<u32>,
    /// Frames that came faster than they were fetched.
    pub lost: u32,
    /// By how much the bus's counters of what could not be read have grown.
    pub unreadable: u32,
    pub motors: Vec<Found>,
}

/// Why nothing is sent on a bus whose bitrate is not known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotAsked {
    /// Something sends there, at none of the bitrates that were named.
    Busy,
    /// Nobody has listened.
    NotListened,
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
    /// How fast its shaft turned when it was asked.
    pub velocity_rad_s: Option<f32>,
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
            velocity_rad_s: None,
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

    /// How fast it turns, where that is more than a motor at rest shows; rad/s.
    pub fn turns(&self) -> Option<f32> {
        self.velocity_rad_s.filter(|velocity| velocity.abs() > standstill())
    }
}

/// What a motor at rest may show, unless its axis says otherwise; rad/s.
pub fn standstill() -> f32 {
    match AxisParameter::StandstillRadS.info().default {
        Some(Value::Float(rad_s)) => rad_s,
        _ => 0.0,
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
        at_other_bitrates(session, wanted, (bus, kind), &bitrates, &mut done)?;
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
    let config = BusConfig { protocols, ..*config };
    one(session, wanted, (bus, kind), &config, None, axes)
}

/// Runs a bus without axes at the bitrates that were named; on CAN until motors are found, which
/// another one would only disturb. There the right one may be heard, and on a bus that is not
/// silent nothing is sent at another: a controller at a wrong bitrate destroys the frames of
/// others.
fn at_other_bitrates(
    session: &mut Session,
    wanted: &Wanted,
    (bus, kind): (u8, BusKind),
    bitrates: &[u32],
    done: &mut impl FnMut(&mut Session, Scanned) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let listen_for = wanted.listen;
    let heard = match kind {
        BusKind::Can => listen(session, listen_for, bus, bitrates)?,
        BusKind::Rs485 => Heard::Nothing,
    };
    let bitrates = match heard {
        Heard::At(bitrate) => vec![bitrate],
        Heard::Unreadable if !wanted.force => {
            return done(session, Scanned::not_asked(bus, kind, NotAsked::Busy));
        }
        Heard::Unasked if !wanted.force => {
            return done(session, Scanned::not_asked(bus, kind, NotAsked::NotListened));
        }
        _ => bitrates.to_vec(),
    };
    // What was listened to on a CAN bus is not listened to again, nor a line for each protocol.
    let mut wanted = wanted.clone();
    for (place, bitrate) in bitrates.iter().copied().enumerate() {
        for protocols in runs(kind, bitrate) {
            let config = BusConfig { bitrate, protocols, ..NEW_BUS };
            let mode = Some(BusMode::OneShot);
            let mut scanned = one(session, &wanted, (bus, kind), &config, mode, &[])?;
            let is_found = !scanned.motors.is_empty();
            let is_last = is_found && kind == BusKind::Can;
            if is_last {
                scanned.left_out = bitrates.get(place + 1..).unwrap_or_default().to_vec();
            }
            done(session, scanned)?;
            if is_last {
                return Ok(());
            }
            wanted.listen = Duration::ZERO;
            // The motors of a line understand one form of frames.
            if is_found {
                break;
            }
        }
        wanted.listen = listen_for;
    }
    Ok(())
}

/// What was heard on a CAN bus whose bitrate is not known.
enum Heard {
    /// Frames, at this bitrate.
    At(u32),
    /// Something that none of the bitrates reads.
    Unreadable,
    Nothing,
    /// Nobody has listened.
    Unasked,
}

/// Any frame counts.
struct Ears(bool);

impl Hear for Ears {
    fn hear(&mut self, _: &RawFrame) {
        self.0 = true;
    }
}

/// Whether a CAN bus can be asked at a bitrate that is not known to be its own: it is silent, or
/// what is heard can be read.
pub fn may_be_asked(session: &mut Session, bus: u8, bitrate: u32) -> Result<bool, Failure> {
    Ok(!matches!(listen(session, LISTEN, bus, &[bitrate])?, Heard::Unreadable))
}

/// Listens, acknowledging nothing. A bus that is silent at one bitrate is so at all: what is sent
/// at another is heard as errors.
fn listen(
    session: &mut Session,
    listen_for: Duration,
    bus: u8,
    bitrates: &[u32],
) -> Result<Heard, Failure> {
    if listen_for.is_zero() {
        return Ok(Heard::Unasked);
    }
    for bitrate in bitrates {
        session.out.aside(format!("bus {bus} at {bitrate} bit/s: listens only"));
        let protocols = looked_for(BusKind::Can, *bitrate);
        let config = BusConfig { bitrate: *bitrate, protocols, ..NEW_BUS };
        let mut open = OpenBus::open_at(session, bus, &config, BusMode::ListenOnly)?;
        let mut ears = Ears(false);
        let result =
            open.listen_until(listen_for, &mut ears, |ears| ears.0).and_then(|()| open.status());
        let closed = open.close();
        let (status, ()) = (result?, closed?);
        match (ears.0, status.receive_errors) {
            (true, _) => return Ok(Heard::At(*bitrate)),
            (false, 0) => return Ok(Heard::Nothing),
            (false, _) => {}
        }
    }
    Ok(Heard::Unreadable)
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

/// Scans a bus: as it runs, or as it is to run meanwhile.
fn one(
    session: &mut Session,
    wanted: &Wanted,
    (bus, kind): (u8, BusKind),
    config: &BusConfig,
    otherwise: Option<BusMode>,
    axes: &[AxisSummary],
) -> Result<Scanned, Failure> {
    let BusConfig { bitrate, protocols, reply_window_us, .. } = *config;
    let names: Vec<&str> = protocols.iter().map(Protocol::name).collect();
    session.out.aside(format!("bus {bus} at {bitrate} bit/s: {}", names.join(", ")));
    let window = Duration::from_micros(reply_window_us.into());
    let mut open = match otherwise {
        None => OpenBus::open(session, bus, window)?,
        Some(mode) => OpenBus::open_at(session, bus, config, mode)?,
    };
    let before = open.status();
    let mut motors = Motors {
        rmd: rmd::Motors::new(kind),
        thruster: thruster::Motors::default(),
        d5: d5::Motors::new(kind),
        protocols,
    };
    let is_known = otherwise.is_none() || kind == BusKind::Rs485;
    let acknowledged = ask(&mut open, wanted, is_known, &mut motors);
    let lost = open.lost;
    let after = open.status();
    let closed = open.close();
    let (before, acknowledged, after, ()) = (before?, acknowledged?, after?, closed?);
    let mut found = [motors.rmd.found(), motors.thruster.found(), motors.d5.found()].concat();
    for motor in &mut found {
        name_axis(session, bus, motor, axes)?;
    }
    let grown =
        |of: fn(&host_protocol::replies::BusReport) -> u32| of(&after).saturating_sub(of(&before));
    Ok(Scanned {
        bitrate: Some(bitrate),
        protocols,
        unacknowledged: !acknowledged,
        lost,
        unreadable: grown(|report| report.counters.rejected)
            .saturating_add(grown(|report| report.receive_errors.into())),
        motors: found,
        ..Scanned::not_configured(bus, kind)
    })
}

/// Asks the motors; `false` where nobody acknowledges. On a CAN bus whose bitrate is not known, to
/// which has been listened already, nothing more is sent then.
fn ask(
    bus: &mut OpenBus<'_>,
    wanted: &Wanted,
    is_known: bool,
    motors: &mut Motors,
) -> Result<bool, Failure> {
    if is_known {
        bus.listen(wanted.listen, motors)?;
    } else {
        let d5 = motors.protocols.contains(Protocol::D5);
        let read = if d5 { d5::Motors::first_read() } else { rmd::Motors::first_read() };
        let Some(read) = read else { return Ok(false) };
        motors.rmd.asks_first();
        if !bus.is_acknowledged(&read, motors)? {
            return Ok(false);
        }
    }
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
    motor.contradicted = session.stated_dialect(axis)?.filter(|stated| !recognised.allows(*stated));
    Ok(())
}

impl Scanned {
    fn not_asked(bus: u8, kind: BusKind, why: NotAsked) -> Self {
        Self { not_asked: Some(why), ..Self::not_configured(bus, kind) }
    }

    fn not_configured(bus: u8, kind: BusKind) -> Self {
        Self {
            bus,
            kind,
            bitrate: None,
            protocols: ProtocolSet::NONE,
            unacknowledged: false,
            not_asked: None,
            left_out: Vec::new(),
            lost: 0,
            unreadable: 0,
            motors: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests;
