//! The JSON schema of a configuration file, for editors: made of the tables of the parameters.

use host_protocol::{
    AxisParameter, GatewayParameter, ParameterInfo, ParameterText, Protocol, REPLY_WINDOW_US,
    StopAction, Value, ValueKind,
};
use serde_json::{Value as Json, json};

use super::{DEFAULT_REPLY_WINDOW_US, INCOMPLETE, MOTOR_TIMEOUT, NAME};
use crate::json::extend;
use crate::output::number;
use crate::parameters::to_json;

/// What a name looks like.
const A_NAME: &str = "^[A-Za-z][A-Za-z0-9_-]{0,15}$";

/// The schema.
pub fn schema() -> Json {
    let protocols: Vec<&str> = Protocol::ALL.iter().map(|protocol| protocol.name()).collect();
    let (min, max) = REPLY_WINDOW_US;
    let name = |of: &str| {
        json!({ "type": "string", "pattern": A_NAME,
            "not": { "enum": ["all", "gateway"] },
            "description": format!("Name of the {of}, for use instead of its number.") })
    };
    let mut gateway: Json = GatewayParameter::ALL
        .iter()
        .map(|parameter| (parameter.text().name, key(parameter.info(), parameter.text())))
        .collect();
    extend(&mut gateway, json!({ (NAME): name("gateway") }));
    let bus = json!({
        "bus": { "type": ["integer", "string"], "minimum": 0, "maximum": 7, "pattern": A_NAME,
            "description": "Number of the bus; with --merge also its name." },
        (NAME): name("bus"),
        "bitrate": { "type": "integer", "minimum": 1, "description": "bit/s." },
        "protocols": { "type": "array", "items": { "enum": protocols },
            "description": "What the motors on it speak; nothing where only raw frames are sent." },
        "exclusive": { "type": "boolean", "default": false,
            "description": "Every node on it belongs to this gateway." },
        "reply_window_us": { "type": "integer", "minimum": min, "maximum": max,
            "default": DEFAULT_REPLY_WINDOW_US, "description": "How long a reply is awaited, µs." },
    });
    let mut axis: Json = AxisParameter::ALL
        .iter()
        .map(|parameter| (parameter.text().name, key(parameter.info(), parameter.text())))
        .collect();
    let more = json!({
        "axis": { "type": ["integer", "string"], "minimum": 0, "maximum": 31, "pattern": A_NAME,
            "description": "Number of the axis; with --merge also its name." },
        (NAME): name("axis"),
        (MOTOR_TIMEOUT): { "type": "integer", "minimum": 0,
            "description": "The motor's own timeout, ms; it is written to the motor. 0 is off." },
        (INCOMPLETE): { "type": "boolean", "default": false,
            "description": "What it needs may be missing; until it is there it cannot be armed." },
    });
    extend(&mut axis, more);
    let required = AxisParameter::ALL.iter().filter(|parameter| parameter.info().required);
    let required: Vec<&str> = required.map(|parameter| parameter.text().name).collect();
    let section = |keys: Json, required: &[&str]| {
        json!({ "type": "object", "additionalProperties": false, "required": required,
            "properties": keys })
    };
    let mut axis = section(axis, &["axis"]);
    extend(
        &mut axis,
        json!({
            "anyOf": [
                { "required": required },
                { "properties": { (INCOMPLETE): { "const": true } }, "required": [INCOMPLETE] },
            ],
        }),
    );
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Configuration of a motor gateway",
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "gateway": section(gateway, &[]),
            "bus": { "type": "array", "items": section(bus, &["bus", "bitrate", "protocols"]) },
            "axis": { "type": "array", "items": axis },
        },
    })
}

/// The schema of one key.
fn key(info: &ParameterInfo, text: &ParameterText) -> Json {
    let mut key = match info.kind {
        _ if info.number == AxisParameter::Bus.number() => {
            json!({ "type": ["integer", "string"], "minimum": plain(info.min),
                "maximum": plain(info.max), "pattern": A_NAME })
        }
        _ if info.is_can_id() => json!({ "type": ["integer", "string"] }),
        _ if info.number == AxisParameter::Protocol.number() => {
            names(Protocol::ALL.iter().map(|protocol| protocol.name()))
        }
        _ if info.number == AxisParameter::StopAction.number() => {
            names(StopAction::ALL.iter().map(|action| action.name()))
        }
        _ if info.number == AxisParameter::RmdDialect.number() => {
            names(rmd::Dialect::ALL.iter().map(|dialect| dialect.name()))
        }
        ValueKind::Bool => json!({ "type": "boolean" }),
        // The only signed parameter is a direction: one of two values.
        ValueKind::Signed => json!({ "enum": [plain(info.min), plain(info.max)] }),
        ValueKind::Unsigned => {
            json!({ "type": "integer", "minimum": plain(info.min), "maximum": plain(info.max) })
        }
        ValueKind::Float => {
            json!({ "type": "number", "minimum": plain(info.min), "maximum": plain(info.max) })
        }
    };
    if let Some(fields) = key.as_object_mut() {
        let unit = if text.unit.is_empty() { String::new() } else { format!(" [{}]", text.unit) };
        fields.insert("description".to_owned(), json!(format!("{}{unit}", text.doc)));
        if let Some(default) = info.default {
            fields.insert("default".to_owned(), to_json(info, default));
        }
    }
    key
}

fn names<'a>(names: impl Iterator<Item = &'a str>) -> Json {
    json!({ "enum": names.collect::<Vec<_>>() })
}

fn plain(value: Value) -> Json {
    match value {
        Value::Bool(value) => json!(value),
        Value::Unsigned(value) => json!(value),
        Value::Signed(value) => json!(value),
        Value::Float(value) => number(value),
    }
}
