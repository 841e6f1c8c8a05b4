//! `mgw scan` on motors as they come from their boxes.

use serde_json::Value;

use crate::support::{Sim, file, mgw};

/// Two RMDs of different dialects with one id, a thruster, two D5 with one id, and an RMD on a line
/// at another rate.
const FROM_THE_BOX: [&str; 16] = [
    "--motor",
    "0:rmd:1:v4_4",
    "--motor",
    "0:rmd:1:v3_6",
    "--motor",
    "0:thruster:11",
    "--motor",
    "0:rmd:7:v3_9",
    "--motor",
    "1:d5:11",
    "--motor",
    "1:d5:11",
    "--motor",
    "2:rmd:1:v4_2@500000",
    "--motor",
    "3:d5:12",
];

/// What one scan finds.
fn scan(sim: &Sim, arguments: &[&str]) -> Vec<Value> {
    let words = [&["--json", "scan", "--listen", "0.1"], arguments].concat();
    let lines = sim.mgw_once_in_command(&words).json_lines();
    lines[0]["scan"].as_array().expect("a list").clone()
}

/// The motors of its first bus.
fn motors(scan: &[Value]) -> Vec<(String, u64, String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or("-").to_owned();
    let motors = scan[0]["motors"].as_array().expect("a list").iter();
    motors
        .map(|motor| {
            let node = motor["node"].as_u64().expect("a number");
            (text(&motor["protocol"]), node, text(&motor["rmd_dialect"]), text(&motor["doubled"]))
        })
        .collect()
}

fn found(protocol: &str, node: u64, dialect: &str, doubled: &str) -> (String, u64, String, String) {
    (protocol.to_owned(), node, dialect.to_owned(), doubled.to_owned())
}

#[test]
fn motors_from_the_box_are_found_and_two_with_one_id_suspected() {
    let mut sim = Sim::with(&FROM_THE_BOX);
    let text = sim.mgw(&["scan"]).success();
    assert!(text.contains("`mgw scan 1@1000000,210526` looks there"), "{text}");

    let bus_0 = ["0@1000000", "--thrusters"];
    let doubled = found("rmd", 1, "unknown", "two_replies");
    let others = [found("rmd", 7, "v3_9", "-"), found("thruster", 11, "-", "-")];
    assert_eq!(motors(&scan(&sim, &bus_0)), [&[doubled], &others[..]].concat());

    // As the guide says: one of them is unplugged.
    sim.typed("motor 1 unplugged");
    let alone = scan(&sim, &bus_0);
    assert_eq!(motors(&alone), [&[found("rmd", 1, "v4_4", "-")], &others[..]].concat());
    assert_eq!(alone[0]["motors"][0]["model"], "RMD-X4-P36-36");
    assert_eq!(alone[0]["motors"][0]["evidence"][1]["answer"], "B50101524D442D58");
    // The thruster is not asked, and was not heard.
    assert_eq!(motors(&scan(&sim, &bus_0[..1])).len(), 2);

    let d5 = scan(&sim, &["1@1000000,210526"]);
    assert_eq!(d5[0]["unacknowledged"], true);
    assert_eq!(motors(&d5[1..]), [found("d5", 11, "-", "two_replies")]);

    let line = scan(&sim, &["2@115200,500000"]);
    assert_eq!(motors(&line), []);
    assert_eq!(motors(&line[2..]), [found("rmd", 1, "unknown", "-")]);
    let possible = serde_json::json!(["v4_2", "v4_3"]);
    assert_eq!(line[2]["motors"][0]["possible_dialects"], possible);

    let line = scan(&sim, &["3@115200"]);
    assert_eq!(motors(&line[1..]), [found("d5", 12, "-", "-")]);
    // Every bus is as it was.
    let buses = &sim.mgw(&["--json", "bus"]).json_lines()[0]["buses"];
    assert!(buses.as_array().unwrap().iter().all(|bus| bus["config"].is_null()), "{buses}");
}

#[test]
fn a_stated_dialect_that_the_motor_contradicts_is_named() {
    let sim = Sim::start();
    sim.mgw_once_in_command(&["config", "axis", "0", "rmd_dialect=v4_4"]).success();
    let motor = scan(&sim, &["0"])[0]["motors"][0].clone();
    assert_eq!((&motor["axis"], &motor["contradicted_dialect"]), (&0.into(), &"v4_4".into()));
    let text = sim.mgw_once_in_command(&["scan", "0", "--listen", "0"]).success();
    assert!(text.contains("contradict rmd_dialect = v4_4 of axis 0"), "{text}");
    sim.mgw_once_in_command(&["config", "axis", "0", "rmd_dialect=v3_6"]).success();
    assert_eq!(scan(&sim, &["0"])[0]["motors"][0]["contradicted_dialect"], Value::Null);
}

#[test]
fn a_bus_of_an_axis_is_scanned_at_its_own_bitrate_only() {
    let sim = Sim::start();
    let text = sim.mgw(&["scan", "0@500000"]).failure(1);
    assert!(text.contains("bus 0 belongs to axis 0"), "{text}");
    sim.mgw(&["scan", "9"]).failure(1);
    sim.mgw(&["scan", "0@"]).failure(2);
    let text = sim.mgw(&["scan", "3@123"]).failure(1);
    assert!(text.contains("123"), "{text}");
    sim.mgw_once_in_command(&["scan", "3@115200", "--listen", "0"]).success();
}

#[test]
fn what_a_scan_finds_becomes_a_configuration_that_turns_the_motors() {
    let mut sim = Sim::with(&FROM_THE_BOX);
    let file = &*file("robot.toml");
    let adopt = |sim: &Sim, more: &[&str]| {
        let words =
            ["adopt", "0@1000000", "1@210526", "2@500000", "--listen", "0.1", "--thrusters"];
        sim.mgw_once_in_command(&[&words, &["--output", file][..], more].concat())
    };
    let told = adopt(&sim, &[]);
    for doubled in ["bus 0, rmd 1 is left out: two motors", "bus 1, d5 0x0B is left out: two"] {
        assert!(told.stderr.contains(doubled), "{told:?}");
    }
    assert!(told.success().contains("robot.toml: 3 axes, 3 of them new"));

    // What a stop does is left open, and a file that is there is not written over.
    let text = sim.mgw(&["config", "check", file]).failure(1);
    assert!(text.contains("axis 0: lacks stop_action; it takes coast, hold, brake"), "{text}");
    let text = adopt(&sim, &["--stop-action", "hold"]).failure(1);
    assert!(text.contains("robot.toml is there already") && text.contains("--force"), "{text}");

    // One of each two is unplugged, as the scan says.
    for motor in ["motor 1 unplugged", "motor 5 unplugged"] {
        sim.typed(motor);
    }
    adopt(&sim, &["--stop-action", "hold", "--force"]).success();
    let written = std::fs::read_to_string(file).unwrap();
    for line in [
        "# rmd 1, RMD-X4-P36-36, firmware 20220206, 48.0 V",
        "rmd_dialect = \"v4_4\"",
        "motor_timeout_ms = 300",
        "protocols = [\"rmd\", \"thruster\"]",
        "stop_action = \"coast\"",
        "name = \"rmd-1\"",
        "name = \"rmd-1-b2\"",
        "name = \"thruster-11\"",
    ] {
        assert!(written.contains(line), "{line}: {written}");
    }
    sim.mgw_once_in_command(&["config", "apply", file]).success();
    for axis in ["0", "1", "3", "rmd-1-b2"] {
        sim.mgw_once_in_command(&["set", axis, "velocity", "3", "--for", "0.2"]).success();
    }
    // What is an axis already is found as such, and not adopted again.
    let words = ["--json", "adopt", "2", "--listen", "0"];
    sim.mgw_once_in_command(&["output-off", "4"]).success();
    let again = sim.mgw_once_in_command(&words).json_lines();
    assert_eq!(again[0]["adopted"], serde_json::json!([]));
}

#[test]
fn a_simulated_motor_that_cannot_be_is_refused() {
    for motor in ["0:rmd", "0:servo:1", "0:rmd:1:v9", "0:d5:1:v4_4", "0:rmd:1:v4_4:x", "0:rmd:1@x"]
    {
        let text = mgw(&["sim", "--listen", "127.0.0.1:0", "--motor", motor]).failure(2);
        assert!(text.contains("BUS:PROTOCOL:NODE[:DIALECT][@RATE]"), "{motor}: {text}");
    }
    for motor in ["9:rmd:1", "0:rmd:33", "2:thruster:1"] {
        mgw(&["sim", "--listen", "127.0.0.1:0", "--motor", motor]).failure(2);
    }
}

#[test]
fn info_says_which_read_told_what_of_the_dialects() {
    let mut sim = Sim::start();
    let text = sim.mgw_once_in_command(&["info"]).success();
    for line in [
        "axis 0: rmd_dialect is v3_6; its motor answers as one of v3_6, v3_7\n",
        "  3001000000000000 is answered 3000551955195519 twice: v3_6, v3_7, v3_9\n",
    ] {
        assert!(text.contains(line), "{text}");
    }
    sim.typed("motor 0 dialect v4_4");
    let info = sim.mgw_once_in_command(&["--json", "info"]).json_lines()[0].clone();
    let axis = &info["rmd_axes"][0];
    assert_eq!(axis["recognised_dialect"], "v4_4");
    assert_eq!(axis["evidence"][1]["answer"], "B50101524D442D58");
    let text = sim.mgw_once_in_command(&["info"]).success();
    assert!(text.contains("v3_6; its motor answers as v4_4 does: it is not armed"), "{text}");
    let text = sim.mgw_once_in_command(&["set", "0", "velocity", "1", "--for", "0.1"]).failure(1);
    assert!(text.contains("its motor answers as one of v4_4"), "{text}");
}

#[test]
fn a_motor_that_sends_alone_ends_no_scan_and_is_found() {
    let mut sim = Sim::with(&["--motor", "0:rmd:1:v4_4"]);
    sim.typed("motor 0 active-replies");
    let scan = sim.mgw_once_in_command(&["scan", "0@1000000"]).success();
    assert!(scan.contains("  0  1000000  rmd 1"), "{scan}");
}
