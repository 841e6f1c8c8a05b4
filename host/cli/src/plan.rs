//! A configuration as a file holds it: buses, axes, motor timeouts, in TOML.

use host_protocol::{AxisParameter, GatewayParameter, Protocol, ProtocolSet, Value};
use mgw_client::{Client, ClientError, Transport};
use serde::Deserialize;
use std::fs;
use std::io::Read;
use std::time::Duration;

use crate::failure::Failure;
use crate::parameters;
use crate::printable::printable;

/// How long a reply is awaited where the configuration does not say; the default of the gateway.
pub const DEFAULT_REPLY_WINDOW_US: u32 = 5_000;

/// One bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BusPlan {
    pub bus: u8,
    pub bitrate: u32,
    pub protocols: ProtocolSet,
    pub wholly_ours: bool,
    pub reply_window_us: u32,
}

/// One axis: its parameters in the order of their numbers, and the motor's own timeout.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisPlan {
    pub axis: u8,
    pub parameters: Vec<(AxisParameter, Value)>,
    pub motor_timeout_ms: Option<u32>,
}

/// Everything a file configures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    pub gateway: Vec<(GatewayParameter, Value)>,
    pub buses: Vec<BusPlan>,
    pub axes: Vec<AxisPlan>,
}

/// The file as it is written; parameters are read by the tables of the protocol.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    gateway: toml::Table,
    #[serde(default)]
    bus: Vec<BusEntry>,
    #[serde(default)]
    axis: Vec<AxisEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BusEntry {
    bus: u8,
    bitrate: u32,
    protocols: Vec<String>,
    #[serde(default)]
    wholly_ours: bool,
    reply_window_us: Option<u32>,
}

#[derive(Deserialize)]
struct AxisEntry {
    axis: u8,
    motor_timeout_ms: Option<u32>,
    #[serde(flatten)]
    parameters: toml::Table,
}

/// Bytes that a file may have: many times what every axis with every parameter takes.
const MAX_FILE: u64 = 256 * 1024;

impl Plan {
    /// Reads a file, or says what is wrong with it.
    pub fn read(path: &str) -> Result<Self, String> {
        let mut bytes = Vec::new();
        let file = fs::File::open(path).map_err(|error| error.to_string())?;
        file.take(MAX_FILE + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        if u64::try_from(bytes.len()).is_ok_and(|length| length > MAX_FILE) {
            return Err(format!("it has more than {MAX_FILE} bytes, too many for a configuration"));
        }
        let text = str::from_utf8(&bytes).map_err(|error| format!("it is no text: {error}"))?;
        let shown = |failure: Failure| {
            let text = failure.to_string();
            text.lines().map(printable).collect::<Vec<_>>().join("\n")
        };
        Self::parse(text).map_err(shown)
    }

    /// Reads a file's text.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        let file: File =
            toml::from_str(text).map_err(|error| Failure::Usage(format!("not a configuration: {error}")))?;
        let mut plan = Self::default();
        for (name, entry) in &file.gateway {
            let parameter = parameters::gateway_parameter(name)?;
            plan.gateway.push((parameter, parameters::value(parameter.info(), &scalar(name, entry)?)?));
        }
        for entry in file.bus {
            plan.buses.push(BusPlan {
                bus: entry.bus,
                bitrate: entry.bitrate,
                protocols: protocols(entry.protocols.iter().map(String::as_str))?,
                wholly_ours: entry.wholly_ours,
                reply_window_us: entry.reply_window_us.unwrap_or(DEFAULT_REPLY_WINDOW_US),
            });
        }
        for entry in file.axis {
            let mut axis = AxisPlan {
                axis: entry.axis,
                parameters: Vec::new(),
                motor_timeout_ms: entry.motor_timeout_ms,
            };
            for (name, entry) in &entry.parameters {
                let parameter = parameters::axis_parameter(name)?;
                axis.parameters
                    .push((parameter, parameters::value(parameter.info(), &scalar(name, entry)?)?));
            }
            // Bus, protocol and node first, and whether there is an encoder: what a parameter may be can depend on them.
            let is_address = |parameter| parameter == AxisParameter::PositionDevice;
            axis.parameters.sort_by_key(|(parameter, _)| (!is_address(*parameter), parameter.number()));
            plan.axes.push(axis);
        }
        Ok(plan)
    }

    /// Sends it to a gateway: gateway, buses, axes, then motor timeouts.
    pub fn apply<T: Transport>(&self, client: &mut Client<T>) -> Result<(), ClientError> {
        for (parameter, value) in &self.gateway {
            client.configure_gateway(*parameter, *value)?;
        }
        for bus in &self.buses {
            bus.apply(client)?;
        }
        for axis in &self.axes {
            for (parameter, value) in &axis.parameters {
                client.configure_axis(axis.axis, *parameter, *value)?;
            }
        }
        for axis in &self.axes {
            if let Some(timeout_ms) = axis.motor_timeout_ms {
                client.provision_motor_timeout(axis.axis, timeout_ms)?;
            }
        }
        Ok(())
    }
}

impl BusPlan {
    /// Reads `NAME=VALUE` pairs.
    pub fn parse(bus: u8, assignments: &[String]) -> Result<Self, Failure> {
        const NAMES: [&str; 4] = ["bitrate", "protocols", "wholly_ours", "reply_window_us"];
        let wrong =
            |name: &str, text: &str| Failure::Usage(format!("`{text}` is no value for {name} of a bus"));
        let (mut bitrate, mut set) = (None, None);
        let (mut wholly_ours, mut reply_window_us) = (false, DEFAULT_REPLY_WINDOW_US);
        for assignment in assignments {
            let (name, text) = parameters::split(assignment)?;
            match name {
                "bitrate" => bitrate = Some(parameters::unsigned(text).ok_or_else(|| wrong(name, text))?),
                "protocols" => set = Some(protocols(text.split(','))?),
                "wholly_ours" => wholly_ours = text.parse().map_err(|_| wrong(name, text))?,
                "reply_window_us" => {
                    reply_window_us = parameters::unsigned(text).ok_or_else(|| wrong(name, text))?
                }
                _ => return Err(parameters::unknown("a bus", name, NAMES.into_iter())),
            }
        }
        match (bitrate, set) {
            (Some(bitrate), Some(protocols)) => {
                Ok(Self { bus, bitrate, protocols, wholly_ours, reply_window_us })
            }
            _ => Err(Failure::Usage(
                "a bus needs bitrate= and protocols=, for example bitrate=1000000 protocols=rmd,thruster"
                    .to_owned(),
            )),
        }
    }

    /// Sends it to a gateway.
    pub fn apply<T: Transport>(&self, client: &mut Client<T>) -> Result<(), ClientError> {
        let window = Duration::from_micros(self.reply_window_us.into());
        client.configure_bus(self.bus, self.bitrate, self.protocols, self.wholly_ours, window)
    }
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

/// A single value of a file, as the command line would have it.
fn scalar(name: &str, value: &toml::Value) -> Result<String, Failure> {
    match value {
        toml::Value::String(text) => Ok(text.clone()),
        toml::Value::Integer(number) => Ok(number.to_string()),
        toml::Value::Float(number) => Ok(number.to_string()),
        toml::Value::Boolean(flag) => Ok(flag.to_string()),
        _ => Err(Failure::Usage(format!("{name} takes a single value"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_becomes_a_plan() {
        let plan = Plan::parse(
            "[gateway]\nlink_silence_us = 200000\n\
             [[bus]]\nbus = 1\nbitrate = 210_526\nprotocols = [\"d5\"]\n\
             [[axis]]\naxis = 2\nstop_action = \"hold\"\nbus = 1\nprotocol = \"d5\"\nnode = 0x0B\n\
             velocity_limit_rad_s = 12\nmotor_timeout_ms = 300\n",
        )
        .unwrap();
        assert_eq!(plan.gateway, [(GatewayParameter::LinkSilenceUs, Value::Unsigned(200_000))]);
        let bus = BusPlan {
            bus: 1,
            bitrate: 210_526,
            protocols: ProtocolSet::of(&[Protocol::D5]),
            wholly_ours: false,
            reply_window_us: 5_000,
        };
        assert_eq!(plan.buses, [bus]);
        let parameters = vec![
            (AxisParameter::Bus, Value::Unsigned(1)),
            (AxisParameter::Protocol, Value::Unsigned(3)),
            (AxisParameter::Node, Value::Unsigned(11)),
            (AxisParameter::StopAction, Value::Unsigned(2)),
            (AxisParameter::VelocityLimitRadS, Value::Float(12.0)),
        ];
        assert_eq!(plan.axes, [AxisPlan { axis: 2, parameters, motor_timeout_ms: Some(300) }]);
    }

    #[test]
    fn a_misspelt_name_is_refused_with_those_that_exist() {
        let wrong = |text: &str| Plan::parse(text).unwrap_err().to_string();
        assert!(
            wrong("[[axis]]\naxis = 0\nstop = \"hold\"\n").contains("no parameter `stop`. There are: bus")
        );
        assert!(
            wrong("[[bus]]\nbus = 0\nbitrate = 1\nprotocols = [\"can\"]\n").contains("rmd, thruster, d5")
        );
        assert!(wrong("[[bus]]\nbus = 0\nrate = 1\n").contains("rate"));
        assert!(wrong("[axes]\n").contains("axes"));
        assert!(wrong("[[axis]]\naxis = 0\nnode = [1]\n").contains("node takes a single value"));
    }

    #[test]
    fn a_bus_on_the_command_line() {
        let assignments = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let bus = BusPlan::parse(0, &assignments(&["bitrate=1_000_000", "protocols=rmd,thruster"])).unwrap();
        assert_eq!((bus.bitrate, bus.protocols.bits(), bus.reply_window_us), (1_000_000, 0b011, 5_000));
        assert!(BusPlan::parse(0, &assignments(&["bitrate=1000000"])).is_err());
        let error = BusPlan::parse(0, &assignments(&["speed=5"])).unwrap_err().to_string();
        assert!(error.contains("There are: bitrate, protocols"), "{error}");
    }
}
