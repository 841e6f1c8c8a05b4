//! A configuration as the file that makes it.

use std::collections::BTreeMap;
use std::fmt::Write;

use host_protocol::{ParameterInfo, Subject, Value};

use super::{Configuration, INCOMPLETE, MOTOR_TIMEOUT, NAME};
use crate::parameters;

/// What the file says of itself.
const HEADING: &str = "\
# The configuration of a motor gateway, as `mgw config dump` writes it. `mgw config apply FILE` makes
# it again; what is not in it has its default.
";

/// The text of the file. Read again it is the same configuration.
pub fn dump(configuration: &Configuration) -> String {
    dump_with(configuration, HEADING, &BTreeMap::new(), true)
}

/// The same with another heading, and comments before the axes. With `as_it_is` an axis that lacks
/// what it needs says so, and the file can be applied; without it that is still to be written.
pub fn dump_with(
    configuration: &Configuration,
    heading: &str,
    comments: &BTreeMap<u8, Vec<String>>,
    as_it_is: bool,
) -> String {
    let mut text = heading.to_owned();
    let name = |text: &mut String, row| {
        if let Some(name) = configuration.names.get(&row) {
            key(text, NAME, &format!("{:?}", name.as_str()));
        }
    };
    section(&mut text, "[gateway]");
    name(&mut text, Subject::Gateway);
    for (parameter, value) in &configuration.gateway {
        key(&mut text, parameter.text().name, &written(parameter.info(), *value));
    }
    for (bus, config) in &configuration.buses {
        section(&mut text, "[[bus]]");
        key(&mut text, "bus", bus);
        name(&mut text, Subject::Bus(*bus));
        key(&mut text, "bitrate", &config.bitrate);
        let names: Vec<String> =
            config.protocols.iter().map(|protocol| format!("{:?}", protocol.name())).collect();
        key(&mut text, "protocols", &format!("[{}]", names.join(", ")));
        key(&mut text, "exclusive", &config.exclusive);
        key(&mut text, "reply_window_us", &config.reply_window_us);
    }
    for (axis, values) in &configuration.axes {
        let comments = comments.get(axis).into_iter().flatten();
        let comments: String = comments.map(|line| format!("# {line}\n")).collect();
        section(&mut text, &format!("{comments}[[axis]]"));
        key(&mut text, "axis", axis);
        name(&mut text, Subject::Axis(*axis));
        let lacks = !configuration.missing(*axis).is_empty();
        if as_it_is && (lacks || configuration.idle_bus_of(*axis).is_some()) {
            key(&mut text, INCOMPLETE, &true);
        }
        for (parameter, value) in values {
            key(&mut text, parameter.text().name, &written(parameter.info(), *value));
        }
        if let Some(timeout_ms) = configuration.motor_timeouts.get(axis) {
            // It was written before a brake was configured, for example.
            let is_refused = configuration.check_motor_timeout(*axis).is_err();
            let refused = "# In the motor, and refused as it is configured: ";
            let mark = if is_refused { refused } else { "" };
            key(&mut text, &format!("{mark}{MOTOR_TIMEOUT}"), timeout_ms);
        }
    }
    text
}

fn section(text: &mut String, heading: &str) {
    // Writing to a string does not fail.
    let _ = writeln!(text, "\n{heading}");
}

fn key(text: &mut String, name: &str, value: &dyn std::fmt::Display) {
    let _ = writeln!(text, "{name} = {value}");
}

/// A value as TOML has it: by name where it has one, a float with its point.
fn written(info: &ParameterInfo, value: Value) -> String {
    match value {
        Value::Float(value) => format!("{value:?}"),
        value => {
            let shown = parameters::shown(info, value);
            if shown == value.to_string() { shown } else { format!("{shown:?}") }
        }
    }
}
