//! Which motor is meant, and the axis that it has for as long as the command lasts.

use std::time::Duration;

use ::rmd::{Dialect, Recognised};
use host_protocol::{
    AxisParameter, BusConfig, BusKind, Error, Protocol, ProtocolSet, StopAction, Value,
};
use mgw_client::ClientError;

use super::{Motor, Run, Unfinished, failed, unfinished_text};
use crate::args::{Bitrates, MotorTarget, ScanTarget};
use crate::config::{self, Configuration, NEW_BUS};
use crate::failure::Failure;
use crate::parameters;
use crate::scan::{Found, Scanned, Wanted, looked_for, may_be_asked, scan};
use crate::session::Session;

/// The level at which a D5 answers nothing, not even a scan.
const MUTE: u8 = 0;

/// What is asked of a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// What it has.
    Read,
    /// A change.
    Write,
    /// A change of its id: who else is on the bus has to be known, thrusters too.
    WriteId,
    /// That it answers at all (D5).
    WriteAckLevel,
}

/// Finds a motor, and has `act` deal with it.
pub fn on_motor(
    session: &mut Session,
    target: MotorTarget,
    yes: bool,
    asked: Asked,
    act: impl FnOnce(&mut Run<'_>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let base = config::read(&mut session.client)?;
    let unfinished = Unfinished::new();
    if let Some(before) = unfinished.before(&base) {
        session.out.aside(unfinished_text(&before));
    }
    let place = Place::of(session, &base, target)?;
    let mut run = Run {
        motor: Motor {
            axis: place.axis.unwrap_or(u8::MAX),
            is_own: place.axis.is_some(),
            bus: place.bus,
            kind: place.kind,
            bitrate: place.config.bitrate,
            protocol: place.protocol.unwrap_or(Protocol::Rmd),
            node: place.node,
            dialects: Vec::new(),
            found: None,
            others: Vec::new(),
        },
        session,
        yes,
        writes: false,
        now: base.clone(),
        after: base,
        unfinished,
    };
    let done = run.prepare(&place, asked).and_then(|()| act(&mut run));
    let is_reconfigured = done.is_err() && run.is_reconfigured();
    // A refusal too: the gateway may have started again in between, or its e-stop was pressed.
    let is_cut_off = matches!(&done, Err(Failure::Client(_) | Failure::Explained { .. }));
    if run.writes && (is_cut_off || is_reconfigured) {
        run.session.out.aside(format!(
            "{}: it ended halfway, and the motor may have been changed. `mgw scan {}` finds it, under \
                its old or its new id, and reading the setting shows what it has",
            run.motor.name(),
            run.motor.bus
        ));
    }
    let left = match &done {
        Err(_) if is_reconfigured => {
            run.unfinished.end();
            return done;
        }
        _ => run.leave(),
    };
    let Err(cause) = left else { return done };
    match (done, run.not_left(&cause)) {
        (Ok(()), Some(text)) => Err(failed("NotTakenBack", text)),
        (Ok(()), None) => Err(cause),
        (Err(failure), Some(text)) => Err(failed("NotTakenBack", format!("{failure}\n{text}"))),
        (Err(failure), None) => Err(failure),
    }
}

/// Where a motor is to be found.
struct Place {
    axis: Option<u8>,
    bus: u8,
    kind: BusKind,
    /// As the bus has to run.
    config: BusConfig,
    protocol: Option<Protocol>,
    node: u8,
}

impl Place {
    fn of(
        session: &mut Session,
        base: &Configuration,
        target: MotorTarget,
    ) -> Result<Self, Failure> {
        match target {
            MotorTarget::Axis(axis) => {
                session.refuse_unconfigured(&[axis], "it has no motor")?;
                let missing = |parameter| move || Failure::lacks(axis, parameter);
                let bus = base.bus_of(axis).ok_or_else(missing(AxisParameter::Bus))?;
                let node = base.node_of(axis).ok_or_else(missing(AxisParameter::Node))?;
                let protocol = base.protocol_of(axis);
                let protocol = protocol.ok_or_else(missing(AxisParameter::Protocol))?;
                let config = base.buses.get(&bus).copied();
                let config = config.ok_or(ClientError::Gateway(Error::BusNotConfigured { bus }))?;
                let kind = config::kind_of(session.client.hello(), bus);
                Ok(Self { axis: Some(axis), bus, kind, config, protocol: Some(protocol), node })
            }
            MotorTarget::Place { bus, protocol, node, bitrate } => {
                // The gateway says which buses there are.
                let there = session.client.bus_status(bus)?.config;
                let kind = config::kind_of(session.client.hello(), bus);
                let config = bus_config(base, bus, kind, there, protocol, bitrate)?;
                // Which axis it is of is known with its protocol only.
                let axis = protocol.and_then(|protocol| base.axis_of(bus, protocol, node));
                Ok(Self { axis, bus, kind, config, protocol, node })
            }
        }
    }
}

/// How the bus has to run so that the motor is reached.
fn bus_config(
    base: &Configuration,
    bus: u8,
    kind: BusKind,
    there: Option<BusConfig>,
    protocol: Option<Protocol>,
    bitrate: Option<u32>,
) -> Result<BusConfig, Failure> {
    let bitrate = match (there, bitrate) {
        (None, None) => {
            return Err(Failure::Usage(format!(
                "bus {bus} is not configured: name the motor's bitrate too, as in {bus}:1@1000000"
            )));
        }
        (Some(config), None) => return Ok(config),
        (Some(config), Some(bitrate)) if config.bitrate == bitrate => return Ok(config),
        (_, Some(bitrate)) => bitrate,
    };
    if let Some(axis) = base.axes_on(bus).first().copied() {
        return Err(Failure::Explained {
            error: Error::AxisOnBus { bus, axis },
            text: format!(
                "bus {bus} belongs to axis {axis}: its motors are reached at its own bitrate only"
            ),
        });
    }
    let protocols = match (kind, protocol) {
        (BusKind::Can, _) => looked_for(kind, bitrate),
        (BusKind::Rs485, Some(protocol)) => ProtocolSet::of(&[protocol]),
        (BusKind::Rs485, None) => {
            return Err(Failure::Usage(format!(
                "bus {bus} is a line for one protocol: name it, as in {bus}:rmd:1@{bitrate}"
            )));
        }
    };
    Ok(BusConfig { bitrate, protocols, ..NEW_BUS })
}

impl Run<'_> {
    /// Looks for the motor, and gives it an axis where it has none.
    fn prepare(&mut self, place: &Place, asked: Asked) -> Result<(), Failure> {
        let mut wanted = self.now.clone();
        let before = wanted.buses.insert(place.bus, place.config);
        let is_known = before.is_some_and(|before| before.bitrate == place.config.bitrate);
        if place.kind == BusKind::Can && !is_known {
            self.refuse_other_bitrate(place)?;
        }
        self.configure(wanted)?;
        // A thruster is asked as seldom as can be: any command may end its timeout.
        let is_thruster = place.protocol == Some(Protocol::Thruster);
        if is_thruster && !self.motor.is_own {
            let what = "any command may end the timeout that keeps a thruster at rest";
            self.session.out.aside(what);
        }
        if !is_thruster || asked == Asked::WriteId {
            let scanned = self.look(place.protocol)?;
            self.take(place, asked, scanned)?;
        }
        self.refuse_doubt(asked)?;
        self.lend_axis(asked)
    }

    /// A controller at a wrong bitrate destroys the frames of others.
    fn refuse_other_bitrate(&mut self, place: &Place) -> Result<(), Failure> {
        let (bus, bitrate) = (place.bus, place.config.bitrate);
        if may_be_asked(self.session, bus, bitrate)? {
            return Ok(());
        }
        Err(failed(
            "OtherBitrate",
            format!(
                "bus {bus}: something sends there, and not at {bitrate} bit/s. Nothing is sent; \
                    `mgw scan {bus}@all` finds the bitrate"
            ),
        ))
    }

    /// What is on the bus.
    pub(super) fn look(&mut self, protocol: Option<Protocol>) -> Result<Scanned, Failure> {
        let target = ScanTarget { bus: self.motor.bus, bitrates: Bitrates::Configured };
        let thrusters = protocol == Some(Protocol::Thruster);
        let wanted =
            Wanted { targets: vec![target], listen: Duration::ZERO, thrusters, force: false };
        let mut all = Vec::new();
        scan(self.session, &wanted, |_, scanned| {
            all.push(scanned);
            Ok(())
        })?;
        all.pop().ok_or_else(|| failed("NotFound", format!("{}: not found", self.motor.name())))
    }

    fn take(&mut self, place: &Place, asked: Asked, scanned: Scanned) -> Result<(), Failure> {
        let is_it = |motor: &Found| {
            motor.node == place.node
                && place.protocol.is_none_or(|protocol| motor.protocol == protocol)
        };
        let (meant, others): (Vec<Found>, Vec<Found>) = scanned.motors.into_iter().partition(is_it);
        self.motor.others = others;
        let mute = asked == Asked::WriteAckLevel && place.protocol == Some(Protocol::D5);
        match meant.as_slice() {
            [one] => {
                self.motor.protocol = one.protocol;
                self.motor.found = Some(one.clone());
                if !self.motor.is_own {
                    // Only now it is known which protocol it is.
                    let (bus, node) = (place.bus, place.node);
                    let axis = self.now.axis_of(bus, one.protocol, node);
                    self.motor.is_own = axis.is_some();
                    self.motor.axis = axis.unwrap_or(self.motor.axis);
                }
                Ok(())
            }
            [] if mute => Ok(()),
            [] => Err(failed("NotFound", self.not_found(scanned.unacknowledged))),
            several => {
                let names: Vec<String> =
                    several.iter().map(|motor| self.of(motor).target(motor.node)).collect();
                Err(failed("Ambiguous", format!("which of them: {}?", names.join(", "))))
            }
        }
    }

    fn of(&self, found: &Found) -> Motor {
        Motor { protocol: found.protocol, ..self.motor.clone() }
    }

    fn not_found(&self, unacknowledged: bool) -> String {
        let Motor { bus, node, bitrate, .. } = self.motor;
        let why = if unacknowledged { ", where nobody acknowledges" } else { "" };
        let there: Vec<String> =
            self.motor.others.iter().map(|other| self.of(other).at(other.node)).collect();
        let there = match there.as_slice() {
            [] => String::new(),
            some => format!("; there are: {}", some.join(", ")),
        };
        format!(
            "bus {bus} at {bitrate} bit/s{why}: no motor {node} answers{there}. Thrusters are \
                asked only where they are named, as in {bus}:thruster:{node}"
        )
    }

    /// Refuses to change a motor of which two seem to be there, or that is not what its axis says.
    fn refuse_doubt(&self, asked: Asked) -> Result<(), Failure> {
        let Some(found) = &self.motor.found else { return Ok(()) };
        let name = self.motor.name();
        if found.doubled.is_some() && asked != Asked::Read {
            return Err(failed(
                "TwoMotors",
                format!("{name}: two motors seem to have this id. Unplug one first"),
            ));
        }
        // The axes of the bus may be away for a moment, and could not be stopped.
        let turning = std::iter::once(found)
            .chain(&self.motor.others)
            .filter(|_| asked != Asked::Read)
            .find_map(|motor| Some((self.of(motor).at(motor.node), motor.turns()?)));
        if let Some((motor, velocity)) = turning {
            return Err(failed(
                "Turns",
                format!(
                    "{name}: {motor} turns, at {velocity:.2} rad/s, so nothing is changed on its \
                        bus. An axis that is configured for it stops it: `mgw stop AXIS`"
                ),
            ));
        }
        if let Some(stated) = found.contradicted {
            return Err(failed(
                "DialectContradicted",
                format!(
                    "{name}: its answers contradict rmd_dialect = {} of axis {}. State the right \
                        one first; `mgw scan {}` has the answers",
                    stated.name(),
                    self.motor.axis,
                    self.motor.bus
                ),
            ));
        }
        Ok(())
    }

    fn lend_axis(&mut self, asked: Asked) -> Result<(), Failure> {
        let mut wanted = self.now.clone();
        if !self.motor.is_own {
            let max_axes = self.session.client.hello().max_axes;
            let free = (0..max_axes).find(|axis| !wanted.axes.contains_key(axis));
            self.motor.axis = free.ok_or_else(|| {
                failed("NoAxis", "every axis is configured: remove one, then try again".to_owned())
            })?;
            let bus = wanted.buses.entry(self.motor.bus).or_insert(NEW_BUS);
            bus.protocols = bus.protocols.with(self.motor.protocol);
        }
        let Motor { axis, is_own, bus, protocol, node, .. } = self.motor;
        let values = wanted.axes.entry(axis).or_default();
        let stop = values.get(&AxisParameter::StopAction).and_then(|action| action.as_unsigned());
        let mut set = |parameter, number: u32| values.insert(parameter, Value::Unsigned(number));
        if !is_own {
            let stop = if protocol == Protocol::D5 { StopAction::Hold } else { StopAction::Coast };
            set(AxisParameter::Bus, bus.into());
            set(AxisParameter::Protocol, protocol.into());
            set(AxisParameter::Node, node.into());
            set(AxisParameter::StopAction, stop.into());
        }
        if protocol == Protocol::Rmd {
            let stated = if is_own && self.motor.found.is_some() {
                self.session.stated_dialect(axis)?
            } else {
                None
            };
            let recognised = self.motor.found.as_ref().and_then(|found| found.recognised);
            self.motor.dialects = match stated.filter(|stated| *stated != Dialect::Unknown) {
                Some(stated) => vec![stated],
                None => possible(recognised),
            };
            let dialect = self.motor.dialect();
            if stated != Some(dialect) {
                set(AxisParameter::RmdDialect, parameters::dialect_number(dialect));
            }
            // From V4.4 on nothing is stored while the output is on, as it is on one that holds.
            let holds = stop == Some(StopAction::Hold.into());
            if is_own && holds && asked != Asked::Read && dialect == Dialect::V4_4 {
                set(AxisParameter::StopAction, StopAction::Coast.into());
            }
        }
        let level = self.motor.found.as_ref().map_or(Some(MUTE), |found| found.ack_level);
        if protocol == Protocol::D5
            && let Some(level) = level.filter(|level| *level != 2 || is_own)
            && asked != Asked::Read
        {
            set(AxisParameter::D5AckLevel, level.into());
        }
        self.configure(wanted)
    }
}

/// What a motor may speak.
fn possible(recognised: Option<Recognised>) -> Vec<Dialect> {
    let known = |dialect: &Dialect| *dialect != Dialect::Unknown;
    match recognised {
        Some(Recognised::As(dialect)) => vec![dialect],
        Some(Recognised::OneOf(some)) => some.iter().filter(known).collect(),
        Some(Recognised::Contradicted) | None => vec![Dialect::Unknown],
    }
}
