//! What a gateway would refuse of a plan whatever else it is configured with, by the rules that it
//! has itself.

use gateway::AxisRules;
use host_protocol::replies::HelloReply;
use host_protocol::{AxisParameter, BusCapability, Error, Value};

use super::{AxisPlan, BusPlan, Plan};
use crate::failure::Failure;

impl Plan {
    /// Refuses a plan that the gateway which said this hello cannot take.
    pub fn check(&self, hello: &HelloReply) -> Result<(), Failure> {
        let place =
            |line: usize, name: String, failure: Failure| match (self.path.as_str(), failure) {
                (path, Failure::Explained { error, text }) => {
                    let text = format!(
                        "{path}{}line {line}, {name}: {text}",
                        if path.is_empty() { "" } else { ": " }
                    );
                    Failure::Explained { error, text }
                }
                (_, failure) => failure,
            };
        for bus in &self.buses {
            check_bus(&bus.what, hello)
                .map_err(Failure::would_be_refused)
                .map_err(|failure| place(bus.line, format!("bus {}", bus.what.bus), failure))?;
        }
        for (index, axis) in self.axes.iter().enumerate() {
            let others = self.axes.iter().take(index).map(|other| &other.what);
            check_axis(&axis.what, hello)
                .and_then(|()| check_address(&axis.what, others))
                .map_err(Failure::would_be_refused)
                .map_err(|failure| place(axis.line, format!("axis {}", axis.what.axis), failure))?;
        }
        Ok(())
    }
}

fn check_bus(plan: &BusPlan, hello: &HelloReply) -> Result<(), Error> {
    let BusCapability { kind, bitrates, .. } = capability(plan.bus, hello)?;
    gateway::check_bus_config(plan.bus, *kind, bitrates, &plan.config())
}

/// What is wrong with an axis by itself. One that lacks its bus or its protocol is completed by
/// what the gateway has already.
fn check_axis(plan: &AxisPlan, hello: &HelloReply) -> Result<(), Error> {
    if plan.axis >= hello.max_axes {
        return Err(Error::UnknownAxis { axis: plan.axis, max_axes: hello.max_axes });
    }
    let (Some(bus), Some(_)) =
        (number(plan, AxisParameter::Bus), number(plan, AxisParameter::Protocol))
    else {
        return Ok(());
    };
    let mut rules = AxisRules::new(plan.axis, capability(bus, hello)?.kind);
    plan.parameters.iter().try_for_each(|(parameter, value)| rules.set(*parameter, *value))?;
    rules.check()?;
    plan.motor_timeout_ms.map_or(Ok(()), |timeout_ms| rules.check_motor_timeout(timeout_ms))
}

/// Two axes cannot have one motor.
fn check_address<'a>(
    plan: &AxisPlan,
    mut others: impl Iterator<Item = &'a AxisPlan>,
) -> Result<(), Error> {
    let address = |plan: &AxisPlan| {
        let [bus, protocol, node] =
            [AxisParameter::Bus, AxisParameter::Protocol, AxisParameter::Node]
                .map(|parameter| number(plan, parameter));
        Some((bus?, protocol?, node?))
    };
    let Some(own) = address(plan) else { return Ok(()) };
    match others.find(|other| address(other) == Some(own)) {
        Some(other) => Err(Error::NodeInUse { axis: other.axis }),
        None => Ok(()),
    }
}

fn number(plan: &AxisPlan, wanted: AxisParameter) -> Option<u8> {
    plan.parameters.iter().find_map(|(parameter, value)| match value {
        Value::Unsigned(number) if *parameter == wanted => u8::try_from(*number).ok(),
        _ => None,
    })
}

fn capability(bus: u8, hello: &HelloReply) -> Result<&BusCapability, Error> {
    let buses = u8::try_from(hello.buses.len()).unwrap_or(u8::MAX);
    hello.buses.get(usize::from(bus)).ok_or(Error::UnknownBus { bus, buses })
}
