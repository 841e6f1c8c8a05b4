//! The schemas of a recording: those of `mgw --json`, as far as readers of MCAP take them. Foxglove
//! wants one type for each field, and no references.

use std::sync::LazyLock;

use host_protocol::EVENTS;
use serde_json::{Map, Value, json};

use crate::json::snake;

static PRINTED: LazyLock<Value> = LazyLock::new(|| {
    serde_json::from_str(include_str!("../../../../docs/mgw.schema.json")).unwrap_or_default()
});

/// Of which kind a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Schema {
    /// A sample of an axis.
    Sample,
    /// Any other event.
    Event,
    /// A period of a free-running cycle.
    Cycle,
    /// What the gateway was asked.
    Request,
    /// What it answered.
    Reply,
    /// A raw frame of a bus.
    Frame,
    /// What the recording says of itself.
    Recording,
}

impl Schema {
    /// Its name in a file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sample => "mgw.sample",
            Self::Event => "mgw.event",
            Self::Cycle => "mgw.cycle",
            Self::Request => "mgw.request",
            Self::Reply => "mgw.reply",
            Self::Frame => "mgw.frame",
            Self::Recording => "mgw.recording",
        }
    }

    /// The schema, as JSON.
    pub fn json(self) -> Value {
        let properties = match self {
            Self::Sample => {
                let mut sample = event("sample");
                sample.remove("name");
                sample
            }
            Self::Event => {
                let names = EVENTS.iter().map(|info| snake(info.name)).filter(|of| of != "sample");
                let mut all = fields(&[("text", "string")]);
                names.chain(["unknown".to_owned()]).for_each(|name| all.extend(event(&name)));
                all
            }
            Self::Cycle => {
                let mut cycle = event("period");
                let times = fields(&[("time_us", INTEGER), ("due_us", INTEGER)]);
                cycle.extend(times.into_iter().chain(fields(&[("dropped", INTEGER)])));
                let mut slow = event("sample");
                slow.retain(|name, _| {
                    !["event", "time_us", "name", "dropped", "state", "stop_confirmed"]
                        .contains(&name.as_str())
                });
                cycle.insert("slow".to_owned(), object(slow));
                cycle
            }
            Self::Request => asked(&[("watches", "boolean")]),
            Self::Reply => {
                asked(&[("error", "string"), ("error_number", INTEGER), ("message", "string")])
            }
            Self::Frame => fields(&[
                ("event", "string"),
                ("time_us", INTEGER),
                ("bus", INTEGER),
                ("frame", "string"),
                ("kind", "string"),
                ("direction", "string"),
            ]),
            Self::Recording => fields(&[
                ("event", "string"),
                ("time_us", INTEGER),
                ("lost_by_gateway", INTEGER),
                ("lost_on_the_way", INTEGER),
                ("lost_unwritten", INTEGER),
            ]),
        };
        object(properties)
    }
}

const INTEGER: &str = "integer";

fn object(properties: Map<String, Value>) -> Value {
    json!({ "type": "object", "properties": properties })
}

fn fields(fields: &[(&str, &str)]) -> Map<String, Value> {
    fields.iter().map(|(name, of)| ((*name).to_owned(), json!({ "type": of }))).collect()
}

fn asked(more: &[(&str, &str)]) -> Map<String, Value> {
    let mut all = fields(&[
        ("event", "string"),
        ("time_us", INTEGER),
        ("program", INTEGER),
        ("by_server", "boolean"),
        ("sequence", INTEGER),
        ("request", "string"),
    ]);
    all.extend(fields(more));
    all.insert("body".to_owned(), object(Map::new()));
    all
}

/// The fields of a printed event.
fn event(name: &str) -> Map<String, Value> {
    let all = PRINTED["$defs"]["event"]["anyOf"].as_array();
    let mut named = all
        .into_iter()
        .flatten()
        .filter(|one| one["properties"]["event"]["const"].as_str() == Some(name));
    let whole = named.next().map(plain);
    match whole {
        Some(Value::Object(mut whole)) => match whole.remove("properties") {
            Some(Value::Object(properties)) => properties,
            _ => Map::new(),
        },
        _ => Map::new(),
    }
}

/// A schema without references, alternatives and null.
fn plain(schema: &Value) -> Value {
    if let Some(path) = schema["$ref"].as_str() {
        let found = path.strip_prefix('#').and_then(|path| PRINTED.pointer(path));
        return found.map_or(Value::Null, plain);
    }
    if let Some(all) = schema["anyOf"].as_array() {
        let other = all.iter().find(|one| one["type"] != "null");
        return other.map_or(Value::Null, plain);
    }
    if schema.get("const").is_some() || schema.get("enum").is_some() {
        return json!({ "type": "string" });
    }
    let types =
        schema["type"].as_array().map_or(std::slice::from_ref(&schema["type"]), Vec::as_slice);
    let of = types.iter().find(|of| **of != "null").unwrap_or(&Value::Null);
    match of.as_str() {
        Some("object") => {
            let properties = schema["properties"].as_object().into_iter().flatten();
            object(properties.map(|(name, field)| (name.clone(), plain(field))).collect())
        }
        Some("array") => json!({ "type": "array", "items": plain(&schema["items"]) }),
        _ => json!({ "type": of }),
    }
}
