//! `mgw encode` with literal frames, and what it refuses.

use serde_json::{Value, json};

use crate::support::{self, mgw};

/// The words of a command line.
fn encode(words: &str) -> crate::support::Outcome {
    mgw(&[&["encode"], words.split_whitespace().collect::<Vec<_>>().as_slice()].concat())
}

/// The rows of a section of encode.txt: the words, and what they are answered with.
fn rows(section: &str) -> Vec<(&'static str, Vec<&'static str>)> {
    let heading = format!("## {section}:");
    let lines = include_str!("encode.txt").lines().skip_while(|line| !line.starts_with(&heading));
    let lines = lines.skip(1).take_while(|line| !line.is_empty());
    let rows = lines.filter(|line| !line.starts_with('#')).map(|line| {
        let mut cells = line.split(" | ");
        (cells.next().unwrap(), cells.collect())
    });
    let rows: Vec<_> = rows.collect();
    assert!(!rows.is_empty(), "{section}");
    rows
}

#[test]
fn every_protocol_and_bus() {
    for (words, frame) in rows("frames") {
        assert_eq!(encode(words).success(), format!("{}\n", frame[0]), "{words}");
    }
    let line = encode("--protocol rmd --node 1 stop --json").json_lines().remove(0);
    let expected =
        json!({ "frame": "141#8100000000000000", "protocol": "rmd", "node": 1, "command": "stop" });
    assert_eq!(line, expected);
}

#[test]
fn values_outside_their_range_are_refused_by_name_with_the_range() {
    for (words, expected) in rows("ranges") {
        let (field, range) = expected.split_first().unwrap();
        let text = encode(words).failure(1);
        assert!(text.starts_with(&format!("mgw: {field} ")), "{words}: {text}");
        let text = encode(&format!("{words} --json")).failure(1);
        let error = support::json(&text)["error"].clone();
        assert_eq!(error["field"], *field, "{words}: {error}");
        match *range {
            [min, max] => {
                let number = |text: &str| Value::from(text.parse::<f64>().unwrap());
                let told = (&error["name"], &error["min"], &error["max"]);
                assert_eq!(told, (&"out_of_range".into(), &number(min), &number(max)), "{words}");
            }
            _ => {
                assert!(
                    error["name"] == "forbidden" || error["name"] == "not_an_integer",
                    "{error}"
                )
            }
        }
    }
}

#[test]
fn slips_are_answered_with_what_there_is() {
    for (words, said) in rows("slips") {
        let text = encode(words).failure(2);
        for part in said {
            assert!(text.contains(part), "{words}: {text}");
        }
    }
}

#[test]
fn the_list_has_every_command_with_fields_units_and_ranges() {
    let text = encode("--protocol rmd --list").success();
    for line in [
        "torque_current  0xA1  RMD V3.6 §2.17",
        "    --current_a             -327.68..=327.67 A, step 0.01",
        "    reply: temperature_c, current_a, speed_dps, angle_deg",
    ] {
        assert!(text.lines().any(|listed| listed == line), "{line}\n{text}");
    }
    assert!(
        encode("--protocol thruster --list")
            .success()
            .contains("--timeout_ms            0..=60000 ms")
    );
    assert!(
        encode("--list --protocol d5").success().contains("   0x20  speed              speed_dps")
    );
    for (protocol, commands) in [
        ("rmd", rmd::COMMANDS.len()),
        ("thruster", thruster::COMMANDS.len()),
        ("d5", d5::COMMANDS.len() + d5::REGISTERS.len()),
    ] {
        let list = encode(&format!("--protocol {protocol} --list --json")).json_lines().remove(0);
        let count = |key: &str| list[key].as_array().map_or(0, Vec::len);
        assert_eq!(count("commands") + count("registers"), commands, "{protocol}");
    }
}

#[test]
fn refusals_name_what_is_allowed() {
    for (words, expected) in rows("refusals") {
        let text = encode(words).failure(expected[0].parse().unwrap());
        assert!(text.contains(expected[1]), "{words}: {text}");
    }
}
