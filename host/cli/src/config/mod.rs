//! The configuration of a gateway as one thing: buses, axes, motor timeouts, in TOML. Everything
//! that can be known to be wrong with it is told, all at once, before a gateway hears of it.

mod apply;
mod board;
mod check;
mod dump;
mod file;
mod schema;
mod template;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use gateway::{AxisRules, BusPort};
use host_protocol::{
    AxisParameter, BusConfig, BusKind, Change, Error, GatewayParameter, MAX_NAME, ParameterInfo,
    Protocol, ProtocolSet, Subject, Text, Value, is_name,
};

use crate::args::Typed;
use crate::failure::Failure;
use crate::json;
use crate::parameters;
use crate::words;

pub use self::dump::dump_with;
pub use apply::{make, read, write_timeouts};
pub use board::{BoardPorts, kind_of};
pub use check::{check, check_count, core_of, refuse};
pub use dump::dump;
pub use file::{Source, parse};
pub use schema::schema;
pub use template::dump_like;

/// How long a reply is awaited where the configuration does not say, µs.
const DEFAULT_REPLY_WINDOW_US: u32 = 5_000;

/// Everything that is configured. What is not in it has its default.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Configuration {
    pub gateway: BTreeMap<GatewayParameter, Value>,
    pub buses: BTreeMap<u8, BusConfig>,
    pub axes: BTreeMap<u8, BTreeMap<AxisParameter, Value>>,
    /// The motors' own timeouts, ms, by axis.
    pub motor_timeouts: BTreeMap<u8, u32>,
    pub names: BTreeMap<Subject, Text<MAX_NAME>>,
}

/// A key of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusKey {
    Bitrate(u32),
    Protocols(ProtocolSet),
    Exclusive(bool),
    ReplyWindow(u32),
}

/// A key with its value, as a file or the command line has it.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    Gateway(GatewayParameter, Value),
    Bus(u8, BusKey),
    Axis(u8, AxisParameter, Value),
    MotorTimeout(u8, u32),
    /// Whether an axis may lack what it needs; of a file, and no part of a configuration.
    Incomplete(u8, bool),
    Name(Subject, Text<MAX_NAME>),
}

/// What is wrong with a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Where it stands, where it stands in a file.
    pub line: Option<usize>,
    pub row: Option<Subject>,
    pub key: Option<String>,
    /// The gateway's name for it, where it would be the gateway that refuses it.
    pub name: &'static str,
    pub text: String,
}

/// The keys of a bus beside its number.
pub const BUS_KEYS: [&str; 4] = ["bitrate", "protocols", "exclusive", "reply_window_us"];
/// The key of an axis that is no parameter of the gateway: it is written to the motor.
pub const MOTOR_TIMEOUT: &str = "motor_timeout_ms";
/// The key of an axis that lacks what it needs, as a program may have left it.
pub const INCOMPLETE: &str = "incomplete";

/// The key of a name, which every row can have.
pub const NAME: &str = "name";

/// A bus of which nothing is said.
pub const NEW_BUS: BusConfig = BusConfig {
    bitrate: 0,
    protocols: ProtocolSet::NONE,
    exclusive: false,
    reply_window_us: DEFAULT_REPLY_WINDOW_US,
};

impl Finding {
    /// The finding for programs.
    pub fn to_json(&self) -> serde_json::Value {
        let (bus, axis) = self.row.map_or((None, None), numbers);
        serde_json::json!({
            "line": self.line, "bus": bus, "axis": axis, "key": self.key,
            "name": json::snake(self.name), "message": self.text,
        })
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}, ")?;
        }
        if let Some(row) = self.row {
            write!(f, "{}: ", title(row))?;
        }
        f.write_str(&self.text)
    }
}

/// What a row of the file is called.
pub fn title(row: Subject) -> String {
    match row {
        Subject::Gateway => "gateway".to_owned(),
        Subject::Bus(_) | Subject::Axis(_) => row.to_string(),
    }
}

/// The number of a row, as that of a bus or of an axis.
fn numbers(row: Subject) -> (Option<u8>, Option<u8>) {
    match row {
        Subject::Gateway => (None, None),
        Subject::Bus(bus) => (Some(bus), None),
        Subject::Axis(axis) => (None, Some(axis)),
    }
}

impl Configuration {
    /// Gives one key its value.
    pub fn set(&mut self, entry: &Entry) {
        match *entry {
            Entry::Gateway(parameter, value) => {
                self.gateway.insert(parameter, value);
            }
            Entry::Bus(bus, key) => {
                let bus = self.buses.entry(bus).or_insert(NEW_BUS);
                match key {
                    BusKey::Bitrate(bitrate) => bus.bitrate = bitrate,
                    BusKey::Protocols(protocols) => bus.protocols = protocols,
                    BusKey::Exclusive(exclusive) => bus.exclusive = exclusive,
                    BusKey::ReplyWindow(us) => bus.reply_window_us = us,
                }
            }
            Entry::Axis(axis, parameter, value) => {
                self.axes.entry(axis).or_default().insert(parameter, value);
            }
            Entry::MotorTimeout(axis, timeout_ms) => {
                self.motor_timeouts.insert(axis, timeout_ms);
            }
            Entry::Incomplete(..) => {}
            Entry::Name(row, ref name) => {
                self.names.insert(row, name.clone());
            }
        }
    }

    /// Takes a key away, so that it has its default; otherwise what is wrong with its name.
    pub fn unset(&mut self, row: Subject, key: &str) -> Result<(), Failure> {
        match row {
            row if key == NAME => {
                self.names.remove(&row);
            }
            Subject::Gateway => {
                self.gateway.remove(&parameters::gateway_parameter(key)?);
            }
            Subject::Bus(bus) => {
                let required = format!("bus {bus} needs its {key}; change it instead");
                let config = self.buses.entry(bus).or_insert(NEW_BUS);
                match key {
                    "exclusive" => config.exclusive = NEW_BUS.exclusive,
                    "reply_window_us" => config.reply_window_us = NEW_BUS.reply_window_us,
                    "bitrate" | "protocols" => return Err(Failure::Usage(required)),
                    _ => return Err(no_key_of_a_bus(key)),
                }
            }
            Subject::Axis(axis) => {
                let parameter = parameters::axis_parameter(key)?;
                if let Some(values) = self.axes.get_mut(&axis) {
                    values.remove(&parameter);
                }
            }
        }
        self.axes.retain(|_, values| !values.is_empty());
        Ok(())
    }

    /// What has to change so that this becomes `other`, in the order of the file.
    pub fn changes_to(&self, other: &Self) -> Vec<Change> {
        let mut changes = Vec::new();
        for parameter in GatewayParameter::ALL.iter().copied() {
            let value =
                |of: &Self| of.gateway.get(&parameter).copied().or(parameter.info().default);
            if let Some(value) = value(other).filter(|new| value(self) != Some(*new)) {
                changes.push(Change::Gateway { parameter: parameter.number(), value });
            }
        }
        for bus in keys(&self.buses, &other.buses) {
            let config = other.buses.get(&bus).copied();
            if self.buses.get(&bus) != config.as_ref() {
                changes.push(Change::Bus { bus, config });
            }
        }
        for axis in keys(&self.axes, &other.axes) {
            let none = BTreeMap::new();
            let [before, after] = [self, other].map(|of| of.axes.get(&axis).unwrap_or(&none));
            for parameter in keys(before, after) {
                let value = after.get(&parameter).copied();
                if before.get(&parameter) != value.as_ref() {
                    changes.push(Change::Axis { axis, parameter: parameter.number(), value });
                }
            }
        }
        for row in keys(&self.names, &other.names) {
            // What is removed loses its name by that.
            let name = other.name(row).cloned();
            if self.name(row) != name.as_ref() && (name.is_some() || other.has(row)) {
                changes.push(Change::Name { of: row, name });
            }
        }
        changes
    }

    /// Whether it has such a row.
    pub fn has(&self, row: Subject) -> bool {
        match row {
            Subject::Gateway => true,
            Subject::Bus(bus) => self.buses.contains_key(&bus),
            Subject::Axis(axis) => self.axes.contains_key(&axis),
        }
    }

    /// Refuses a name for a row that there is not.
    pub fn refuse_name_of_nothing(&self, row: Subject) -> Result<(), Failure> {
        let error = match row {
            Subject::Bus(bus) => Error::BusNotConfigured { bus },
            Subject::Axis(axis) => {
                Error::NotConfigured { axis, parameter: AxisParameter::Bus.number() }
            }
            Subject::Gateway => return Ok(()),
        };
        let is_named = self.names.contains_key(&row) && !self.has(row);
        if is_named { Err(Failure::would_be_refused(error)) } else { Ok(()) }
    }

    /// Refuses an axis that lacks what it needs, on a gateway with so many buses: it would be there
    /// and could do nothing.
    pub fn refuse_incomplete(&self, axis: u8, buses: usize) -> Result<(), Failure> {
        let missing = self.missing(axis);
        if let Some(first) = missing.first() {
            let error = Error::NotConfigured { axis, parameter: first.number() };
            let names: Vec<&str> = missing.iter().map(|one| one.text().name).collect();
            let text = format!(
                "axis {axis} lacks {}; give all of it in one command, as in `mgw config axis {axis} \
                    bus=0 protocol=rmd node=1 stop_action=hold`. Nothing was changed",
                names.join(", ")
            );
            return Err(Failure::Explained { error, text });
        }
        if let Some(bus) = self.idle_bus_of(axis).filter(|bus| usize::from(*bus) < buses) {
            let text = format!(
                "bus {bus} of axis {axis} is not configured; do that first, as in `mgw config bus \
                    {bus} bitrate=1000000 protocols=rmd`. Nothing was changed"
            );
            return Err(Failure::Explained { error: Error::BusNotConfigured { bus }, text });
        }
        Ok(())
    }

    /// The name of a row that there is.
    fn name(&self, row: Subject) -> Option<&Text<MAX_NAME>> {
        self.names.get(&row).filter(|_| self.has(row))
    }

    /// A change for people: from what to what.
    pub fn shown(&self, change: &Change) -> String {
        let arrow = |row: Subject, key: &str, before: Option<String>, after: Option<String>| {
            let or_default = |text: Option<String>| text.unwrap_or_else(|| "not set".to_owned());
            format!("{}: {key} {} -> {}", title(row), or_default(before), or_default(after))
        };
        match *change {
            Change::Gateway { parameter, value } => {
                let known = GatewayParameter::from_number(parameter);
                let before = known.and_then(|known| self.gateway.get(&known).copied());
                let show = |value| named_value(parameter, value);
                let name = host_protocol::parameters::name(parameter).unwrap_or_default();
                arrow(Subject::Gateway, name, before.map(show), Some(show(value)))
            }
            Change::Bus { bus, config } => {
                let show = |config: &BusConfig| {
                    format!(
                        "{} bit/s, {}, {}, reply window {} µs",
                        config.bitrate,
                        words::protocols(config.protocols),
                        if config.exclusive { "exclusive" } else { "shared" },
                        config.reply_window_us
                    )
                };
                let before = self.buses.get(&bus).map(show);
                arrow(Subject::Bus(bus), "runs at", before, config.as_ref().map(show))
            }
            Change::Axis { axis, parameter, value } => {
                let known = AxisParameter::from_number(parameter);
                let values = self.axes.get(&axis);
                let before = known.and_then(|known| values?.get(&known).copied());
                let show = |value| named_value(parameter, value);
                let name = host_protocol::parameters::name(parameter).unwrap_or_default();
                arrow(Subject::Axis(axis), name, before.map(show), value.map(show))
            }
            Change::Name { of, ref name } => {
                let show = |name: &Text<MAX_NAME>| name.as_str().to_owned();
                arrow(of, NAME, self.name(of).map(show), name.as_ref().map(show))
            }
        }
    }

    /// What an axis needs and has not.
    pub fn missing(&self, axis: u8) -> Vec<AxisParameter> {
        let is_set = |parameter| self.axes.get(&axis).is_some_and(|of| of.contains_key(parameter));
        let required = AxisParameter::ALL.iter().filter(|parameter| parameter.info().required);
        required.filter(|parameter| !is_set(parameter)).copied().collect()
    }

    /// The bus of an axis, if it has one and that does not run.
    pub fn idle_bus_of(&self, axis: u8) -> Option<u8> {
        self.bus_of(axis).filter(|bus| !self.buses.contains_key(bus))
    }

    /// Refuses the timeout of the motor of an axis where that could not be set to it, whatever else
    /// is on its bus.
    pub fn check_motor_timeout(&self, axis: u8) -> Result<(), Error> {
        let Some(timeout_ms) = self.motor_timeouts.get(&axis) else { return Ok(()) };
        // It does not depend on the kind of the bus.
        let mut rules = AxisRules::new(axis, BusKind::Can);
        for (parameter, value) in self.axes.get(&axis).into_iter().flatten() {
            // Its range was looked at when it was read.
            let _ = rules.set(*parameter, *value);
        }
        rules.check_motor_timeout(*timeout_ms)
    }

    /// The bus of an axis, if it has one.
    pub fn bus_of(&self, axis: u8) -> Option<u8> {
        self.number(axis, AxisParameter::Bus)
    }

    /// What the motor of an axis speaks, if that is configured.
    pub fn protocol_of(&self, axis: u8) -> Option<Protocol> {
        self.number(axis, AxisParameter::Protocol)
    }

    /// The id of the motor of an axis, if it has one.
    pub fn node_of(&self, axis: u8) -> Option<u8> {
        self.number(axis, AxisParameter::Node)
    }

    fn number<T: TryFrom<u32>>(&self, axis: u8, parameter: AxisParameter) -> Option<T> {
        T::try_from(self.axes.get(&axis)?.get(&parameter)?.as_unsigned()?).ok()
    }

    /// The axes on a bus.
    pub fn axes_on(&self, bus: u8) -> Vec<u8> {
        self.axes.keys().copied().filter(|axis| self.bus_of(*axis) == Some(bus)).collect()
    }

    /// The axis that is configured for a motor.
    pub fn axis_of(&self, bus: u8, protocol: Protocol, node: u8) -> Option<u8> {
        self.axes_on(bus).into_iter().find(|axis| {
            self.protocol_of(*axis) == Some(protocol) && self.node_of(*axis) == Some(node)
        })
    }

    /// Whose frames are on a bus.
    pub fn protocols(&self) -> Vec<(u8, ProtocolSet)> {
        self.buses.iter().map(|(bus, config)| (*bus, config.protocols)).collect()
    }
}

/// A value with the name that it has, and its unit.
fn named_value(parameter: u16, value: Value) -> String {
    let unit = host_protocol::parameters::unit(parameter).unwrap_or_default();
    let shown = info(parameter).map_or(value.to_string(), |info| parameters::shown(info, value));
    format!("{shown} {unit}").trim_end().to_owned()
}

fn info(parameter: u16) -> Option<&'static ParameterInfo> {
    let axis = AxisParameter::from_number(parameter).map(AxisParameter::info);
    axis.or_else(|| GatewayParameter::from_number(parameter).map(GatewayParameter::info))
}

fn keys<K: Ord + Copy, V>(one: &BTreeMap<K, V>, other: &BTreeMap<K, V>) -> BTreeSet<K> {
    one.keys().chain(other.keys()).copied().collect()
}

/// Reads `NAME=VALUE` pairs for a row, each name once. `find_bus` says which number the bus has that
/// is named.
pub fn assignments(
    row: Subject,
    texts: &[String],
    mut find_bus: impl FnMut(&Typed) -> Result<u8, Failure>,
) -> Result<Vec<Entry>, Failure> {
    let mut names = BTreeSet::new();
    texts
        .iter()
        .map(|text| {
            let (name, value) = parameters::split(text)?;
            if !names.insert(name) {
                return Err(Failure::Usage(format!("{name} is given twice. Give it once")));
            }
            entry(row, name, value, &mut find_bus)
        })
        .collect()
}

/// Reads the value of a key, in its range.
fn entry(
    row: Subject,
    name: &str,
    text: &str,
    find_bus: impl FnOnce(&Typed) -> Result<u8, Failure>,
) -> Result<Entry, Failure> {
    match row {
        row if name == NAME => Ok(Entry::Name(row, name_of(row, text)?)),
        Subject::Gateway => {
            let parameter = parameters::gateway_parameter(name)?;
            let value = parameters::value(parameter.info(), text)?;
            parameter.check(value).map_err(Failure::would_be_refused)?;
            Ok(Entry::Gateway(parameter, value))
        }
        Subject::Bus(bus) => Ok(Entry::Bus(bus, bus_key(name, text)?)),
        Subject::Axis(axis) => {
            let parameter = parameters::axis_parameter(name)?;
            let value = if parameter == AxisParameter::Bus && is_name(text) {
                Value::Unsigned(find_bus(&Typed::Name(text.to_owned()))?.into())
            } else {
                parameters::value(parameter.info(), text)?
            };
            parameter.check(value).map_err(Failure::would_be_refused)?;
            Ok(Entry::Axis(axis, parameter, value))
        }
    }
}

fn name_of(row: Subject, text: &str) -> Result<Text<MAX_NAME>, Failure> {
    let refused = || {
        let error = Error::NotAName { of: row };
        Failure::Explained { error, text: format!("`{text}`: {error}") }
    };
    is_name(text).then(|| Text::try_from(text).ok()).flatten().ok_or_else(refused)
}

fn bus_key(name: &str, text: &str) -> Result<BusKey, Failure> {
    let wrong = |takes: &str| {
        Failure::Usage(format!("`{text}` is no value for {name} of a bus. It takes {takes}"))
    };
    let number = || parameters::unsigned(text);
    match name {
        "bitrate" => {
            let bitrate = number().filter(|bitrate| *bitrate > 0);
            bitrate.map(BusKey::Bitrate).ok_or_else(|| {
                let [can, rs485] = [true, false].map(usual_bitrates);
                wrong(&format!("bit/s above 0, as a rule {can} on CAN, or {rs485} on RS485"))
            })
        }
        "protocols" => protocols(text.split(',')).map(BusKey::Protocols),
        "exclusive" => text.parse().map(BusKey::Exclusive).map_err(|_| wrong("true or false")),
        "reply_window_us" => {
            let (min, max) = host_protocol::REPLY_WINDOW_US;
            let us = number().filter(|us| (min..=max).contains(us));
            us.map(BusKey::ReplyWindow).ok_or_else(|| wrong(&format!("{min} to {max} µs")))
        }
        _ => Err(no_key_of_a_bus(name)),
    }
}

fn no_key_of_a_bus(name: &str) -> Failure {
    parameters::unknown("a bus", name, BUS_KEYS.into_iter().chain([NAME]))
}

/// The bitrates of CAN buses, or of the others, on the boards that there are.
fn usual_bitrates(of_can: bool) -> String {
    let is_can = |port: &BusPort| port.kind == BusKind::Can;
    let port = mgw_sim::BOARD.buses.iter().find(|port| is_can(port) == of_can);
    let rates = port.map_or(&[][..], |port| port.bitrates);
    rates.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

fn protocols<'a>(names: impl Iterator<Item = &'a str>) -> Result<ProtocolSet, Failure> {
    let mut set = ProtocolSet::NONE;
    for name in names {
        let protocol = Protocol::from_name(name.trim()).ok_or_else(|| {
            let all: Vec<&str> = Protocol::ALL.iter().map(|protocol| protocol.name()).collect();
            Failure::Usage(format!("`{name}` is no protocol. There are: {}", all.join(", ")))
        })?;
        set = set.with(protocol);
    }
    Ok(set)
}

/// A change for programs.
pub fn change_to_json(change: &Change) -> serde_json::Value {
    let number = |parameter, value| match info(parameter) {
        Some(info) => parameters::to_json(info, value),
        None => serde_json::Value::Null,
    };
    let name = |parameter| host_protocol::parameters::name(parameter);
    match *change {
        Change::Gateway { parameter, value } => {
            serde_json::json!({ "parameter": name(parameter), "value": number(parameter, value) })
        }
        Change::Bus { bus, config } => serde_json::json!({
            "bus": bus, "config": config.as_ref().map(json::gateway::bus_config),
        }),
        Change::Axis { axis, parameter, value } => serde_json::json!({
            "axis": axis, "parameter": name(parameter), "value": value.map(|value| number(parameter, value)),
        }),
        Change::Name { of, ref name } => {
            let (bus, axis) = numbers(of);
            let mut change = serde_json::json!({ "parameter": NAME, "value": name.as_deref() });
            for (key, number) in [("bus", bus), ("axis", axis)] {
                if let Some(number) = number {
                    change[key] = number.into();
                }
            }
            change
        }
    }
}

#[cfg(test)]
mod round_trip;
#[cfg(test)]
mod tests;
