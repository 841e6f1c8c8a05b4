//! A configuration as a file holds it: buses, axes, motor timeouts, in TOML. Everything that can be
//! known to be wrong with it is told before a gateway hears of it.

mod check;
mod file;

use host_protocol::{
    AxisParameter, BusConfig, Error, GatewayParameter, MotorTimeout, Protocol, ProtocolSet,
    Quantity, REPLY_WINDOW_US, Value,
};
use mgw_client::{Client, ClientError, Transport};
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
    pub exclusive: bool,
    pub reply_window_us: u32,
}

/// One axis: its parameters in the order in which they are sent, and the motor's own timeout.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisPlan {
    pub axis: u8,
    pub parameters: Vec<(AxisParameter, Value)>,
    pub motor_timeout_ms: Option<u32>,
}

/// Something of a file, and its line there.
#[derive(Debug, Clone, PartialEq)]
struct At<T> {
    line: usize,
    what: T,
}

/// Everything a file configures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// What it is called in a failure.
    path: String,
    gateway: Vec<(GatewayParameter, Value)>,
    buses: Vec<At<BusPlan>>,
    axes: Vec<At<AxisPlan>>,
}

impl Plan {
    /// Reads a file, or says what is wrong with it.
    pub fn read(path: &str) -> Result<Self, String> {
        let text = file::text(path)?;
        let shown = |failure: Failure| {
            let text = failure.to_string();
            text.lines().map(printable).collect::<Vec<_>>().join("\n")
        };
        let plan = Self::parse(&text).map_err(shown)?;
        Ok(Self { path: printable(path).into_owned(), ..plan })
    }

    /// Reads a file's text.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        file::parse(text)
    }

    /// Sends it to a gateway: gateway, buses, axes, then motor timeouts. Nothing is sent of one
    /// that this gateway cannot take.
    pub fn apply<T: Transport>(&self, client: &mut Client<T>) -> Result<(), Failure> {
        self.check(client.hello())?;
        for (parameter, value) in &self.gateway {
            client.configure_gateway(*parameter, *value)?;
        }
        for bus in self.buses() {
            bus.apply(client)?;
        }
        for AxisPlan { axis, parameters, .. } in self.axes() {
            for (parameter, value) in parameters {
                client.configure_axis(*axis, *parameter, *value)?;
            }
        }
        for AxisPlan { axis, motor_timeout_ms, .. } in self.axes() {
            if let Some(timeout_ms) = motor_timeout_ms {
                provision(client, *axis, *timeout_ms)?;
            }
        }
        Ok(())
    }

    pub fn buses(&self) -> impl Iterator<Item = &BusPlan> {
        self.buses.iter().map(|bus| &bus.what)
    }

    pub fn axes(&self) -> impl Iterator<Item = &AxisPlan> {
        self.axes.iter().map(|axis| &axis.what)
    }
}

/// Writes a motor's own timeout, unless the gateway knows that the motor has it: an RMD keeps it in
/// ROM, which wears (RMD V3.6 §2.30).
fn provision<T: Transport>(
    client: &mut Client<T>,
    axis: u8,
    timeout_ms: u32,
) -> Result<(), Failure> {
    let is_known = match client.read_state_when_free(axis).map(|report| report.motor_timeout) {
        Ok(MotorTimeout::Written { timeout_ms: written }) => written == timeout_ms,
        // The switch of a D5.
        Ok(MotorTimeout::Verified) => timeout_ms != 0,
        _ => false,
    };
    if !is_known {
        client.provision_motor_timeout(axis, timeout_ms)?;
    }
    Ok(())
}

impl BusPlan {
    /// Reads `NAME=VALUE` pairs.
    pub fn parse(bus: u8, assignments: &[String]) -> Result<Self, Failure> {
        const NAMES: [&str; 4] = ["bitrate", "protocols", "exclusive", "reply_window_us"];
        let wrong = |name: &str, text: &str| {
            Failure::Usage(format!("`{text}` is no value for {name} of a bus"))
        };
        let (mut bitrate, mut set) = (None, None);
        let (mut exclusive, mut reply_window_us) = (false, DEFAULT_REPLY_WINDOW_US);
        for assignment in assignments {
            let (name, text) = parameters::split(assignment)?;
            match name {
                "bitrate" => {
                    bitrate = Some(parameters::unsigned(text).ok_or_else(|| wrong(name, text))?)
                }
                "protocols" => set = Some(protocols(text.split(','))?),
                "exclusive" => exclusive = text.parse().map_err(|_| wrong(name, text))?,
                "reply_window_us" => {
                    reply_window_us = parameters::unsigned(text).ok_or_else(|| wrong(name, text))?
                }
                _ => return Err(parameters::unknown("a bus", name, NAMES.into_iter())),
            }
        }
        match (bitrate, set) {
            (Some(bitrate), Some(protocols)) => {
                let plan = Self { bus, bitrate, protocols, exclusive, reply_window_us };
                plan.check().map_err(Failure::would_be_refused)?;
                Ok(plan)
            }
            _ => Err(Failure::Usage(
                "a bus needs bitrate= and protocols=, for example bitrate=1000000 \
                    protocols=rmd,thruster"
                    .to_owned(),
            )),
        }
    }

    fn config(&self) -> BusConfig {
        let Self { bitrate, protocols, exclusive, reply_window_us, .. } = *self;
        BusConfig { bitrate, protocols, exclusive, reply_window_us }
    }

    /// Refuses what no gateway takes, whatever its board.
    fn check(&self) -> Result<(), Error> {
        AxisParameter::Bus.check(Value::Unsigned(self.bus.into()))?;
        let (min, max) = REPLY_WINDOW_US;
        if (min..=max).contains(&self.reply_window_us) {
            return Ok(());
        }
        let [value, min, max] = [self.reply_window_us, min, max].map(approximate);
        Err(Error::OutOfRange { quantity: Quantity::ReplyWindow, value, min, max })
    }

    /// Sends it to a gateway.
    pub fn apply<T: Transport>(&self, client: &mut Client<T>) -> Result<(), ClientError> {
        let window = Duration::from_micros(self.reply_window_us.into());
        client.configure_bus(self.bus, self.bitrate, self.protocols, self.exclusive, window)
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

/// A number as errors state it.
#[expect(clippy::cast_precision_loss, reason = "for people to read")]
fn approximate(number: u32) -> f32 {
    number as f32
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
            exclusive: false,
            reply_window_us: 5_000,
        };
        assert_eq!(plan.buses().collect::<Vec<_>>(), [&bus]);
        let parameters = vec![
            (AxisParameter::Bus, Value::Unsigned(1)),
            (AxisParameter::Protocol, Value::Unsigned(3)),
            (AxisParameter::Node, Value::Unsigned(11)),
            (AxisParameter::StopAction, Value::Unsigned(2)),
            (AxisParameter::VelocityLimitRadS, Value::Float(12.0)),
        ];
        let axis = AxisPlan { axis: 2, parameters, motor_timeout_ms: Some(300) };
        assert_eq!(plan.axes().collect::<Vec<_>>(), [&axis]);
    }

    #[test]
    fn a_misspelt_name_is_refused_with_those_that_exist() {
        let wrong = |text: &str| Plan::parse(text).unwrap_err().to_string();
        assert!(
            wrong("[[axis]]\naxis = 0\nstop = \"hold\"\n")
                .contains("no parameter `stop`. There are: bus")
        );
        assert!(
            wrong("[[bus]]\nbus = 0\nbitrate = 1\nprotocols = [\"can\"]\n")
                .contains("rmd, thruster, d5")
        );
        assert!(wrong("[[bus]]\nbus = 0\nrate = 1\n").contains("rate"));
        assert!(wrong("[axes]\n").contains("axes"));
        assert!(wrong("[[axis]]\naxis = 0\nnode = [1]\n").contains("node takes a single value"));
    }

    #[test]
    fn a_bus_on_the_command_line() {
        let assignments =
            |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let bus = BusPlan::parse(0, &assignments(&["bitrate=1_000_000", "protocols=rmd,thruster"]))
            .unwrap();
        assert_eq!(
            (bus.bitrate, bus.protocols.bits(), bus.reply_window_us),
            (1_000_000, 0b011, 5_000)
        );
        assert!(BusPlan::parse(0, &assignments(&["bitrate=1000000"])).is_err());
        let error = BusPlan::parse(0, &assignments(&["speed=5"])).unwrap_err().to_string();
        assert!(error.contains("There are: bitrate, protocols"), "{error}");
    }

    #[test]
    fn a_value_out_of_its_range_is_refused_with_its_line_and_what_is_allowed() {
        let wrong = |text: &str| Plan::parse(text).unwrap_err().to_string();
        let text = wrong("[[axis]]\naxis = 3\nbus = 0\n\nttl_us = 1\n");
        assert_eq!(
            text,
            "line 5, axis 3: ttl_us 1 µs is out of range; allowed are 5000 µs to 60000000 µs"
        );
        let text = wrong("[[axis]]\naxis = 3\ndirection = 0\n");
        assert_eq!(text, "line 3, axis 3: direction 0 is out of range; allowed are -1 or 1");
        let text = wrong("[[axis]]\naxis = 3\nstop_action = \"halt\"\n");
        assert_eq!(
            text,
            "line 3, axis 3: `halt` is no value for stop_action. It takes coast, hold, brake"
        );
        let text = wrong("[gateway]\nlink_silence_us = 49999\n");
        assert!(
            text.starts_with("line 2, gateway: link_silence_us 49999 µs is out of range"),
            "{text}"
        );
        let bus = "[[bus]]\nbus = 9\nbitrate = 1\nprotocols = [\"rmd\"]\n";
        assert_eq!(wrong(bus), "line 2, bus 9: bus 9 is out of range; allowed are 0 to 7");
        let bus = "[[bus]]\nbus = 0\nbitrate = 1\nprotocols = [\"rmd\"]\nreply_window_us = 99\n";
        assert!(wrong(bus).ends_with("allowed are 100 µs to 200000 µs"), "{}", wrong(bus));
        assert_eq!(wrong("[[bus]]\nbus = -1\n"), "line 2, bus: takes a number from 0 on");
        assert_eq!(wrong("[[axis]]\nnode = 1\n"), "line 1, axis: lacks its number: axis = 0");
        assert!(wrong("[[bus]]\nbus = 0\nbitrate = 1\n").contains("needs bitrate and protocols"));
        let text = wrong("[[axis]]\naxis = 0\nmotor_timeout_ms = -1\n");
        assert_eq!(text, "line 3, axis 0: motor_timeout_ms takes a whole number from 0 on");
        let text = wrong("[[axis]]\naxis = 0\n[[axis]]\naxis = 0\n");
        assert_eq!(text, "line 4, axis 0: is there already, in line 2");
    }
}
