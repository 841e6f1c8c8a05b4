//! The first part: what the gateway is, its configuration, arming.

use host_protocol::AxisParameter;
use host_protocol::replies::AxisReport;
use mgw_client::{Client, Transport};
use serde_json::json;

use crate::commands::{ArmedAxis, tell_armed};
use crate::config::Configuration;
use crate::failure::Failure;
use crate::four_motors;
use crate::json;
use crate::output::Output;
use crate::parameters;
use crate::table::Table;
use crate::words::{self, or_nothing};

/// A heading of the demonstration.
pub fn heading(out: Output, text: &str) -> Result<(), Failure> {
    out.text("")?;
    out.text(text)?;
    out.text("-".repeat(text.chars().count()))
}

/// What the gateway said of itself.
pub fn introduce<T: Transport>(client: &Client<T>, out: Output) -> Result<(), Failure> {
    let hello = client.hello();
    heading(out, "1. The gateway")?;
    let kinds: Vec<String> = hello.buses.iter().map(|bus| bus.kind.to_string()).collect();
    out.text(format!(
        "board {}, firmware {}, protocol {}.{}, up to {} axes, buses: {}",
        hello.board,
        hello.firmware,
        hello.protocol_major,
        hello.protocol_minor,
        hello.max_axes,
        kinds.join(", ")
    ))
}

/// Sends the configuration and shows it.
pub fn configure<T: Transport>(
    client: &mut Client<T>,
    configuration: &Configuration,
    out: Output,
) -> Result<(), Failure> {
    four_motors::configure(client, configuration)?;
    heading(out, "2. Configuration (host/cli/examples: four-motors.toml, d5-on-rs485.toml)")?;
    for (bus, config) in &configuration.buses {
        let (bitrate, protocols) = (config.bitrate, config.protocols);
        out.event(
            "bus_configured",
            format!("bus {bus}: {bitrate} bit/s, {}", words::protocols(protocols)),
            json!({
                "bus": bus, "bitrate_bit_s": bitrate, "protocols": json::protocols(protocols)
            }),
        )?;
    }
    let columns = [
        AxisParameter::Bus,
        AxisParameter::Protocol,
        AxisParameter::Node,
        AxisParameter::StopAction,
        AxisParameter::TtlUs,
    ];
    let mut table = Table::new(&[
        ">axis",
        ">bus",
        "protocol",
        ">node",
        "stop action",
        ">setpoint lives µs",
        "motor's own timeout",
    ]);
    for axis in configuration.axes.keys().copied() {
        let mut cells = vec![axis.to_string()];
        for parameter in columns {
            let value = client.read_axis_parameter(axis, parameter)?;
            cells.push(or_nothing(value.map(|value| parameters::shown(parameter.info(), value))));
        }
        let report: AxisReport = client.read_state(axis)?;
        cells.push(words::motor_timeout(report.motor_timeout));
        table.row(cells);
    }
    out.table(&table)
}

/// Arms every axis.
pub fn arm<T: Transport>(
    client: &mut Client<T>,
    axes: &[u8],
    out: Output,
) -> Result<Vec<ArmedAxis>, Failure> {
    heading(out, "3. Arming: only an armed axis may move")?;
    let mut all = Vec::new();
    for axis in axes {
        let armed = client.arm(*axis)?;
        tell_armed(out, *axis, &armed)?;
        let ttl = client.axis_ttl(*axis)?;
        all.push(ArmedAxis { axis: *axis, epoch: armed.epoch, ttl });
    }
    Ok(all)
}
