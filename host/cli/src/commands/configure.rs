//! `mgw configure`

use host_protocol::AxisParameter;
use serde_json::json;

use crate::args::{ConfigureArgs, ConfigureTarget};
use crate::failure::Failure;
use crate::json;
use crate::parameters;
use crate::plan::BusPlan;
use crate::session::Session;
use crate::table::Table;
use crate::words::{self, NOTHING};

/// Configures what the arguments say.
pub fn run(session: &mut Session, arguments: &ConfigureArgs) -> Result<(), Failure> {
    if let Some(plan) = &arguments.file {
        plan.apply(&mut session.client)?;
        return done(
            session,
            format!("configured {} buses and {} axes", plan.buses().count(), plan.axes().count()),
        );
    }
    match &arguments.target {
        None => Err(Failure::Usage(
            "configure what? Name a bus, an axis, the gateway, or --file FILE".to_owned(),
        )),
        Some(ConfigureTarget::Bus { bus, assignments }) => {
            BusPlan::parse(*bus, assignments)?.apply(&mut session.client)?;
            done(session, format!("bus {bus} configured"))
        }
        Some(ConfigureTarget::Axis { axis, assignments }) => {
            axis_parameters(session, *axis, assignments)
        }
        Some(ConfigureTarget::Gateway { assignments }) => gateway_parameters(session, assignments),
        Some(ConfigureTarget::Timeout { axis, milliseconds }) => {
            let timeout = session.client.provision_motor_timeout(*axis, *milliseconds)?;
            let line = format!(
                "axis {axis}: the motor's own timeout is {}",
                words::motor_timeout(timeout)
            );
            session.out.either(line, &{
                let mut fields = json!({ "axis": axis });
                json::extend(&mut fields, json::axis::motor_timeout(timeout));
                fields
            })
        }
        Some(ConfigureTarget::Show { axis }) => show(session, *axis),
        Some(ConfigureTarget::Remove { axis }) => {
            session.refuse_unconfigured(&[*axis], "there is nothing to remove")?;
            session.client.remove_axis(*axis)?;
            done(session, format!("axis {axis} removed"))
        }
    }
}

fn done(session: &Session, line: String) -> Result<(), Failure> {
    session.out.either(line, &json!({ "done": true }))
}

fn axis_parameters(session: &mut Session, axis: u8, assignments: &[String]) -> Result<(), Failure> {
    // All are read and checked before any is sent: a slip of the pen must not leave half a
    // configuration.
    let mut values = Vec::new();
    for assignment in assignments {
        let (name, text) = parameters::split(assignment)?;
        let parameter = parameters::axis_parameter(name)?;
        let value = parameters::value(parameter.info(), text)?;
        parameter.check(value).map_err(Failure::would_be_refused)?;
        values.push((parameter, value));
    }
    for (parameter, value) in values {
        session.client.configure_axis(axis, parameter, value)?;
    }
    done(session, format!("axis {axis} configured"))
}

fn gateway_parameters(session: &mut Session, assignments: &[String]) -> Result<(), Failure> {
    let mut values = Vec::new();
    for assignment in assignments {
        let (name, text) = parameters::split(assignment)?;
        let parameter = parameters::gateway_parameter(name)?;
        let value = parameters::value(parameter.info(), text)?;
        parameter.check(value).map_err(Failure::would_be_refused)?;
        values.push((parameter, value));
    }
    for (parameter, value) in values {
        session.client.configure_gateway(parameter, value)?;
    }
    done(session, "gateway configured".to_owned())
}

fn show(session: &mut Session, axis: u8) -> Result<(), Failure> {
    let mut table = Table::new(&["parameter", ">value", "allowed", "meaning"]);
    let mut object = serde_json::Map::new();
    for parameter in AxisParameter::ALL {
        let (info, text) = (parameter.info(), parameter.text());
        let value = session.client.read_axis_parameter(axis, *parameter)?;
        let shown = value.map(|value| parameters::shown(info, value));
        object.insert(
            text.name.to_owned(),
            match value {
                None => serde_json::Value::Null,
                // As people write it: by name, where the number has one.
                Some(value) if shown.as_deref() != Some(&value.to_string()) => json!(shown),
                Some(host_protocol::Value::Bool(value)) => json!(value),
                Some(host_protocol::Value::Unsigned(value)) => json!(value),
                Some(host_protocol::Value::Signed(value)) => json!(value),
                Some(host_protocol::Value::Float(value)) => crate::output::number(value),
            },
        );
        let nothing = if info.required { "missing" } else { NOTHING };
        table.row([
            text.name.to_owned(),
            shown.unwrap_or_else(|| nothing.to_owned()),
            parameters::allowed(info),
            text.doc.to_owned(),
        ]);
    }
    session.out.table(&table)?;
    session.out.object(&json!({ "axis": axis, "parameters": object }))
}
