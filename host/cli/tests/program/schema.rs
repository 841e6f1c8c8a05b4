//! Whether lines of JSON are as docs/mgw.schema.json says. `support` checks every line that any
//! test has the program print.

use std::sync::LazyLock;

use serde_json::{Map, Value, json};

use crate::support::{FOUR, Process, Sim, json, mgw, mgw_reading};

static SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    serde_json::from_str(include_str!("../../../../docs/mgw.schema.json")).expect("JSON")
});

/// Asserts that this is a line of output of a program.
pub fn check(line: &Value) {
    if let Err(wrong) = fits(&SCHEMA, line) {
        panic!("docs/mgw.schema.json does not allow this line:\n{line}\n{wrong}");
    }
}

/// Asserts that this is what the schema defines by that name.
pub fn check_as(definition: &str, value: &Value) {
    let schema = json!({ "$ref": format!("#/$defs/{definition}") });
    fits(&schema, value).unwrap_or_else(|wrong| panic!("{value} is no `{definition}`:\n{wrong}"));
}

/// Whether a value fits a schema, of the keywords that docs/mgw.schema.json needs; else what does
/// not.
fn fits(schema: &Value, value: &Value) -> Result<(), String> {
    let (schema, wrong) =
        (schema.as_object().expect("a schema"), |what: &str| Err(format!("{what}: {value}")));
    for (keyword, wanted) in schema {
        match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "properties" | "default" => {}
            // What the parameters' own tests look at.
            "pattern" | "not" | "minItems" => {}
            "minimum" if value.as_f64() >= wanted.as_f64() || !value.is_number() => {}
            "maximum" if value.as_f64() <= wanted.as_f64() || !value.is_number() => {}
            "minimum" | "maximum" => return wrong(&format!("beyond {wanted}")),
            "$ref" => {
                let path = wanted.as_str().and_then(|path| path.strip_prefix('#')).expect("local");
                fits(SCHEMA.pointer(path).expect("defined"), value)?;
            }
            "const" if value == wanted => {}
            "enum" if wanted.as_array().is_some_and(|all| all.contains(value)) => {}
            "const" | "enum" => return wrong(&format!("not {wanted}")),
            "type" => {
                let names = wanted.as_array().map_or(std::slice::from_ref(wanted), Vec::as_slice);
                if !names.iter().any(|name| is_of(name, value)) {
                    return wrong(&format!("not of type {wanted}"));
                }
            }
            "anyOf" => {
                let is_of_another = |one: &&Value| {
                    one.pointer("/properties/event/const").is_some_and(|of| *of != value["event"])
                };
                let all = wanted.as_array().expect("a list").iter();
                let all: Vec<&Value> = all.filter(|one| !is_of_another(one)).collect();
                let refusals: Vec<String> =
                    all.iter().map_while(|one| fits(one, value).err()).collect();
                if refusals.len() == all.len() {
                    return wrong(&format!("no alternative fits ({})", refusals.join("; ")));
                }
            }
            "items" => {
                value.as_array().into_iter().flatten().try_for_each(|it| fits(wanted, it))?
            }
            "required" => {
                let named = wanted.as_array().into_iter().flatten().filter_map(Value::as_str);
                for name in named {
                    if value.is_object() && value.get(name).is_none() {
                        return wrong(&format!("{name} is missing in"));
                    }
                }
            }
            "additionalProperties" => {
                members(schema.get("properties"), wanted, value.as_object())?;
            }
            other => panic!("the checker knows no `{other}`"),
        }
    }
    Ok(())
}

/// The members of an object, each by its own schema or that of all others; names in snake_case.
fn members(
    properties: Option<&Value>,
    others: &Value,
    object: Option<&Map<String, Value>>,
) -> Result<(), String> {
    for (name, member) in object.into_iter().flatten() {
        if !name.chars().all(|letter| matches!(letter, 'a'..='z' | '0'..='9' | '_')) {
            return Err(format!("{name} is not in snake_case"));
        }
        match properties.and_then(|all| all.get(name)) {
            Some(schema) => fits(schema, member).map_err(|wrong| format!("{name}: {wrong}"))?,
            None if others == &json!(false) => return Err(format!("{name} is not allowed")),
            None => fits(others, member).map_err(|wrong| format!("{name}: {wrong}"))?,
        }
    }
    Ok(())
}

fn is_of(name: &Value, value: &Value) -> bool {
    match name.as_str() {
        Some("object") => value.is_object(),
        Some("array") => value.is_array(),
        Some("string") => value.is_string(),
        Some("number") => value.is_number(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("boolean") => value.is_boolean(),
        Some("null") => value.is_null(),
        other => panic!("no type {other:?}"),
    }
}

/// What must be refused, and why: a schema or a checker that allows all says nothing.
#[test]
fn the_checker_finds_planted_faults() {
    let good = json!({
        "event": "stopped", "axis": 0, "state": "tripped", "stop_confirmed": true
    });
    assert_eq!(fits(&SCHEMA, &good), Ok(()));
    for (key, value, said) in [
        ("axis", json!("0"), "axis: not of type"),
        ("state", json!("Tripped"), "state: not "),
        ("stop_confirmed", json!({}), "stop_confirmed: not of type"),
        ("elapsedUs", json!(1), "elapsedUs is not in snake_case"),
        ("elapsed_us", json!(1), "elapsed_us is not allowed"),
        ("event", json!("StopConfirmed"), "no alternative fits ()"),
    ] {
        let mut bad = good.clone();
        bad[key] = value;
        let wrong = fits(&SCHEMA, &bad).expect_err(key);
        assert!(wrong.contains(said), "{key}: {wrong}");
    }
    let mut short = good.clone();
    short.as_object_mut().unwrap().remove("axis");
    assert!(fits(&SCHEMA, &short).unwrap_err().contains("axis is missing"));
}

/// The schema for editors is that of the examples, and of what is dumped.
#[test]
fn files_are_as_the_schema_of_their_keys_says() {
    let schema: Value = serde_json::from_str(&mgw(&["config", "schema"]).success()).unwrap();
    let sim = Sim::start();
    let d5 = std::fs::read_to_string(FOUR.replace("four-motors", "d5-on-rs485")).unwrap();
    for text in [std::fs::read_to_string(FOUR).unwrap(), d5, sim.mgw(&["config", "dump"]).success()]
    {
        let file: toml::Value = toml::from_str(&text).unwrap();
        assert_eq!(fits(&schema, &json!(file)), Ok(()), "{text}");
        let other = text.replacen("node = ", "nodes = ", 1);
        let file: toml::Value = toml::from_str(&other).unwrap();
        assert!(fits(&schema, &json!(file)).is_err(), "{other}");
    }
}

#[test]
fn each_command_prints_what_the_schema_says_of_it() {
    let sim = Sim::patient();
    for (words, definition) in [
        ("info", "info"),
        ("trips", "trips"),
        ("axes", "axes"),
        ("state", "states"),
        ("state 1", "states"),
        ("bus", "buses"),
        ("scan --listen 0 --thrusters", "scan"),
        ("adopt 0 --listen 0", "adopted"),
        ("doctor", "doctor"),
        ("config show 0", "parameters"),
        ("config timeout 0 200", "timeout"),
        ("config axis 0 velocity_limit_rad_s=5", "done"),
        ("config dump", "dump"),
        ("config schema", "schema"),
        ("update --confirm", "event"),
        ("config apply FOUR", "configured"),
        ("config check FOUR", "checked"),
        ("config diff FOUR", "differences"),
        ("plan FOUR", "planned"),
        ("raw 0 send 141#9A00000000000000", "event"),
        ("arm 1 --for 0.1", "event"),
        ("set 0 velocity 1 --for 0.1", "event"),
        ("move 0 0.1 --speed-limit 2 --tolerance 1", "event"),
        ("native 0 9C00000000000000", "event"),
        ("watch --count 2 --period 10", "event"),
        ("bench --yes --rounds 10", "benched"),
        ("output-off 0", "done"),
        ("stop", "stops"),
        ("estop", "stops"),
        ("clear gateway", "done"),
        ("--version", "version"),
        ("explain", "pages"),
        ("explain E-bus-off", "page"),
        ("encode --protocol rmd --node 1 stop", "encoded"),
        ("encode --protocol d5 --list", "commands"),
        ("demo", "event"),
    ] {
        let words = words.split(' ').map(|word| if word == "FOUR" { FOUR } else { word });
        let words: Vec<&str> = ["--json"].into_iter().chain(words).collect();
        let lines = sim.mgw_once_in_command(&words).json_lines();
        assert!(!lines.is_empty(), "{words:?}");
        lines.iter().for_each(|line| check_as(definition, line));
    }
    let lines = mgw_reading(&["decode", "--json"], "141#9A00000000000000\nnonsense\n");
    lines.stdout.lines().for_each(|line| check_as("event", &json(line)));
    let wrong = mgw(&["--json", "set", "0"]).failure(2);
    check_as("error", &json(&wrong));
    let other = Process::start(&["sim", "--json", "--listen", "0.0.0.0:0"]);
    for event in ["listening", "warning"] {
        other.wait_for(event, |line| (json(line)["event"] == event).then_some(()));
    }
}
