//! Every request of the golden vectors, decoded to names and encoded from these names again.

use serde_json::Value;

use crate::support::{mgw, mgw_reading};

const RMD: &str = include_str!("../../../../host-tests/vectors/rmd.txt");
const THRUSTER: &str = include_str!("../../../../host-tests/vectors/thruster.txt");
const D5: &str = include_str!("../../../../host-tests/vectors/d5.txt");

/// A line of a vector file: label, direction, transport, frame, meaning and source.
struct Vector<'a> {
    label: &'a str,
    direction: &'a str,
    transport: &'a str,
    frame: &'a str,
    source: &'a str,
}

fn vectors(file: &str) -> Vec<Vector<'_>> {
    let lines = file.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    let vector = |line| {
        let columns: Vec<&str> = str::split(line, " | ").collect();
        let [label, direction, transport, frame, .., source] = columns.as_slice() else {
            panic!("{line}")
        };
        Vector { label, direction, transport, frame, source }
    };
    lines.map(vector).collect()
}

/// The request fields of each command, by the list that `mgw encode` prints.
fn listed(protocol: &str) -> Vec<(String, Vec<String>)> {
    let list = mgw(&["encode", "--protocol", protocol, "--list", "--json"]).json_lines().remove(0);
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let commands = list["commands"].as_array().unwrap().iter();
    commands
        .map(|line| {
            let fields = line["request"].as_array().unwrap();
            (text(&line["command"]), fields.iter().map(|field| text(&field["name"])).collect())
        })
        .collect()
}

/// The words for `mgw encode` that say what a decoded line says.
fn words(protocol: &str, transport: &str, line: &Value, fields: &[String]) -> Vec<String> {
    let node = line["node"].as_u64().map_or("all".to_owned(), |node| node.to_string());
    let start = ["encode", "--protocol", protocol, "--node", &node, "--bus", transport];
    let mut words: Vec<String> = start.map(str::to_owned).into();
    words.push(line["command"].as_str().unwrap().to_owned());
    for field in fields {
        let (name, value) = match &line[field] {
            Value::Array(_) => (field.as_str(), &line[format!("{field}_raw")]),
            Value::Null => register_value(line),
            value => (field.as_str(), value),
        };
        words.extend([format!("--{name}"), value.to_string()]);
    }
    words
}

/// D5: what is written stands under the name of the register's own field, flags as a number.
fn register_value(line: &Value) -> (&str, &Value) {
    const OTHERS: [&str; 8] =
        ["event", "frame", "direction", "protocol", "node", "command", "register", "register_name"];
    let mut fields = line.as_object().unwrap().iter();
    let (name, value) =
        fields.rfind(|(name, _)| !OTHERS.contains(&name.as_str())).expect("a value");
    (name.strip_suffix("_raw").unwrap_or(name), value)
}

/// Decodes and encodes every request of a file; returns how many came back as they were.
fn round_trip(protocol: &str, file: &str) -> usize {
    let vectors = vectors(file);
    let requests: Vec<&Vector> =
        vectors.iter().filter(|vector| vector.direction == "request").collect();
    let input: String = requests.iter().map(|vector| format!("{}\n", vector.frame)).collect();
    let decoded =
        mgw_reading(&["--json", "decode", "--protocol", protocol, "--direction", "request"], input)
            .decoded();
    assert_eq!(decoded.len(), requests.len());
    let commands = listed(protocol);
    let mut same = 0;
    for (vector, line) in requests.iter().zip(&decoded) {
        let label = vector.label;
        assert_eq!(line["frame"], vector.frame, "{label}");
        if !line["error"].is_null() {
            let is_known_for_it = vector.source.contains("frame format")
                || vector.source.contains("not in RMD")
                || ["another command", "a signal without data", "reply where a request is due"]
                    .contains(&label)
                || label.starts_with("self test with a wrong checksum");
            assert!(is_known_for_it, "{label}: {line}");
            continue;
        }
        if line["direction"] != "request" {
            // D5: the first byte says so, whatever was asked for.
            assert_eq!(label, "reply where a request is due");
            continue;
        }
        let command = line["command"].as_str().unwrap();
        if command == "motion_mode" {
            // The manual reads and writes these words by different divisors: a decoded value is
            // never encoded again.
            continue;
        }
        let (_, fields) = commands.iter().find(|(name, _)| name == command).unwrap();
        let words = words(protocol, vector.transport, line, fields);
        let outcome = mgw(&words.iter().map(String::as_str).collect::<Vec<_>>());
        let is_same = outcome.code == Some(0) && outcome.stdout.trim_end() == vector.frame;
        let is_sent = !vector.source.contains("decode only")
            && !vector.source.contains("encoding refused")
            // Its sign says nothing: 0 is sent without.
            && label != "speed −0, written"
            // `write` names one register.
            && label != "acceleration and deceleration 72";
        assert_eq!(is_same, is_sent, "{label}: {line}\n{words:?}\n{outcome:?}");
        same += usize::from(is_same);
    }
    same
}

#[test]
fn rmd_requests_come_back_from_their_names() {
    assert!(round_trip("rmd", RMD) >= 119);
}

#[test]
fn thruster_requests_come_back_from_their_names() {
    assert!(round_trip("thruster", THRUSTER) >= 44);
}

#[test]
fn d5_requests_come_back_from_their_names() {
    assert!(round_trip("d5", D5) >= 35);
}

/// In the order of the files requests stand before their replies, so that directions can be told.
#[test]
fn every_vector_has_its_direction() {
    for (protocol, file) in [("rmd", RMD), ("thruster", THRUSTER), ("d5", D5)] {
        let vectors = vectors(file);
        let input: String = vectors.iter().map(|vector| format!("{}\n", vector.frame)).collect();
        for choice in [protocol, "auto"] {
            let lines =
                mgw_reading(&["--json", "decode", "--protocol", choice], input.clone()).decoded();
            assert_eq!(lines.len(), vectors.len());
            for (vector, line) in vectors.iter().zip(&lines) {
                let label = vector.label;
                assert_eq!(line["frame"], vector.frame, "{label}");
                assert_eq!(line["protocol"], protocol, "{label}");
                let is_undecodable = !line["error"].is_null() && line["command"].is_null();
                // Two replies of which the first has answered; and frames that D5 motors send
                // unasked or not alike.
                let cannot_be_told = label == "communication timeout 1000 ms reply"
                    && vector.transport == "rs485"
                    || protocol == "d5"
                        && (vector.direction == "event" || label == "reply where a request is due");
                let told = line["direction"] == vector.direction;
                assert!(told || is_undecodable || cannot_be_told, "{label}: {line}");
            }
        }
    }
}
