//! `mgw adopt`

use std::collections::BTreeMap;

use gateway::AxisRules;
use host_protocol::{AxisParameter, BusKind, Protocol, StopAction, Subject, Text, Value};
use serde_json::json;

use super::scan;
use crate::args::AdoptArgs;
use crate::config::{self, Configuration, NEW_BUS};
use crate::failure::Failure;
use crate::parameters;
use crate::scan::{Found, Scanned};
use crate::session::Session;
use crate::words;
use crate::written;

/// What the file says of itself.
const HEADING: &str = "\
# The configuration of a motor gateway, as `mgw adopt` proposes it from the motors that it found.
# Read it, name the axes, choose each stop_action that is missing, and set limits: no manual gives them
# by model. Then `mgw config check FILE` and `mgw config apply FILE`, which writes each motor_timeout_ms
# into its motor. What is not in it has its default.
";
/// The time after which a motor that hears nothing stops by itself, ms. The gateway sends a
/// setpoint again three times within it.
const MOTOR_TIMEOUT_MS: u32 = 300;
/// The acknowledge level of a D5 as it comes from its box.
const FACTORY_ACK_LEVEL: u8 = 2;

/// A configuration, and what is to be said of its axes.
struct Proposal {
    wanted: Configuration,
    comments: BTreeMap<u8, Vec<String>>,
    /// Axes that are new.
    adopted: Vec<u8>,
    /// Motors that were found and are no axis.
    left_out: Vec<String>,
    max_axes: u8,
}

/// Scans, and writes what it found as a configuration.
pub fn run(session: &mut Session, arguments: &AdoptArgs) -> Result<(), Failure> {
    // Before anything is asked: a scan takes its time.
    if let Some(path) = arguments.output.as_deref().filter(|path| path.exists() && !arguments.force)
    {
        return Err(written::unwritten(path, std::io::ErrorKind::AlreadyExists.into()));
    }
    let mut proposal = Proposal {
        wanted: config::read(&mut session.client)?,
        comments: BTreeMap::new(),
        adopted: Vec::new(),
        left_out: Vec::new(),
        max_axes: session.client.hello().max_axes,
    };
    let wanted = scan::wanted(session, &arguments.scan, arguments.force_scan)?;
    crate::scan::scan(session, &wanted, |session, scanned| {
        for line in scan::bus_notes(&scanned) {
            session.out.aside(line);
        }
        proposal.take(&scanned, arguments.stop_action);
        Ok(())
    })?;
    let Proposal { wanted, comments, adopted, left_out, .. } = proposal;
    for motor in &left_out {
        session.out.aside(motor);
    }
    if adopted.is_empty() {
        session.out.aside("no motor was found that is not an axis already");
    }
    let text = config::dump_with(&wanted, HEADING, &comments, false);
    let path = arguments.output.as_deref();
    let fields = json!({
        "adopted": adopted, "left_out": left_out,
        "file": path.map(|path| path.display().to_string()), "configuration": text,
    });
    let Some(path) = path else {
        session.out.object(&fields)?;
        return text.lines().try_for_each(|line| session.out.text(line));
    };
    written::write(path, &text, arguments.force)?;
    session.out.object(&fields)?;
    session.out.text(format!(
        "{}: {}, {} of them new. Read it, then `mgw config check {0}`",
        path.display(),
        words::count(wanted.axes.len(), "axis", "axes"),
        adopted.len()
    ))
}

impl Proposal {
    /// Adds the motors of a bus that are no axes.
    fn take(&mut self, scanned: &Scanned, chosen: Option<StopAction>) {
        let Some(bitrate) = scanned.bitrate else { return };
        for motor in scanned.motors.iter().filter(|motor| motor.axis.is_none()) {
            let name = format!("bus {}, {}", scanned.bus, scan::name(motor));
            if motor.doubled.is_some() {
                let why = "two motors seem to have this id. Unplug one, and give the other another";
                self.left_out.push(format!("{name} is left out: {why} id"));
                continue;
            }
            let free = (0..self.max_axes).find(|axis| !self.wanted.axes.contains_key(axis));
            let Some(axis) = free else {
                self.left_out.push(format!("{name} is left out: there are no more axes"));
                continue;
            };
            let bus = self.wanted.buses.entry(scanned.bus).or_insert(NEW_BUS);
            bus.bitrate = bitrate;
            bus.protocols = bus.protocols.with(motor.protocol);
            self.add(axis, scanned, motor, chosen);
        }
    }

    /// Names an axis after its motor, as in `rmd-1`, and after its bus too where that is taken.
    fn name(&mut self, axis: u8, bus: u8, motor: &Found) {
        let of_motor = format!("{}-{}", motor.protocol, motor.node);
        let of_both = format!("{of_motor}-b{bus}");
        let is_taken = |name: &str| self.wanted.names.values().any(|of| of.as_str() == name);
        let free = [of_motor, of_both].into_iter().find(|name| !is_taken(name));
        if let Some(name) = free.and_then(|name| Text::try_from(name.as_str()).ok()) {
            self.wanted.names.insert(Subject::Axis(axis), name);
        }
    }

    fn add(&mut self, axis: u8, scanned: &Scanned, motor: &Found, chosen: Option<StopAction>) {
        let actions = stop_actions(scanned.kind, motor);
        let action = match actions.as_slice() {
            [only] => Some(*only),
            several => chosen.filter(|chosen| several.contains(chosen)),
        };
        let mut values = required(scanned.bus, motor);
        if let Some(action) = action {
            values.insert(AxisParameter::StopAction, Value::Unsigned(action.into()));
        }
        if let Some(recognised) = motor.recognised {
            let number = parameters::dialect_number(recognised.dialect());
            values.insert(AxisParameter::RmdDialect, Value::Unsigned(number));
        }
        if let Some(level) = motor.ack_level.filter(|level| *level != FACTORY_ACK_LEVEL) {
            values.insert(AxisParameter::D5AckLevel, Value::Unsigned(level.into()));
        }
        // The time of a D5 is its own, and it comes with its timeout on.
        match (motor.protocol, motor.timeout_on) {
            (Protocol::D5, Some(true) | None) => {}
            (Protocol::D5, Some(false)) => drop(self.wanted.motor_timeouts.insert(axis, 1)),
            (Protocol::Rmd | Protocol::Thruster, _) => {
                self.wanted.motor_timeouts.insert(axis, MOTOR_TIMEOUT_MS);
            }
        }
        self.wanted.axes.insert(axis, values);
        self.name(axis, scanned.bus, motor);
        self.adopted.push(axis);
        let mut comments = vec![described(motor)];
        comments.extend(scan::notes(scanned, motor));
        if action.is_none() {
            let names: Vec<&str> = actions.iter().copied().map(StopAction::name).collect();
            comments.push(format!("Choose what a stop does: stop_action = {}", in_quotes(&names)));
            comments.push(
                "coast lets go, hold stops and keeps holding, brake locks the motor's brake"
                    .to_owned(),
            );
        }
        self.comments.insert(axis, comments);
    }
}

fn in_quotes(names: &[&str]) -> String {
    names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(" or ")
}

fn required(bus: u8, motor: &Found) -> BTreeMap<AxisParameter, Value> {
    BTreeMap::from([
        (AxisParameter::Bus, Value::Unsigned(bus.into())),
        (AxisParameter::Protocol, Value::Unsigned(motor.protocol.into())),
        (AxisParameter::Node, Value::Unsigned(motor.node.into())),
    ])
}

/// What its motor can do as a stop, by the rules of the gateway.
fn stop_actions(kind: BusKind, motor: &Found) -> Vec<StopAction> {
    let allowed = |action: &StopAction| {
        let mut rules = AxisRules::new(0, kind);
        let action = [(AxisParameter::StopAction, Value::Unsigned((*action).into()))];
        for (parameter, value) in required(0, motor).into_iter().chain(action) {
            // They are values that a gateway has.
            let _ = rules.set(parameter, value);
        }
        rules.check().is_ok()
    };
    StopAction::ALL.iter().copied().filter(allowed).collect()
}

/// What the motor said of itself.
fn described(motor: &Found) -> String {
    let parts = [
        Some(scan::name(motor)),
        motor.model.clone(),
        motor.firmware.as_ref().map(|firmware| format!("firmware {firmware}")),
        motor.voltage_v.map(|volts| format!("{volts:.1} V")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}
