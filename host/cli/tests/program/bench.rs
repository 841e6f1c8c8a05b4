//! `mgw bench` against a simulated gateway. Nothing here depends on how fast it is.

use std::fs;

use serde_json::{Value, json};

use crate::support::{FOUR, Sim, file, mgw};

fn state(sim: &Sim, axis: usize) -> Value {
    sim.mgw(&["--json", "state"]).json_lines()[0]["axes"][axis]["state"].clone()
}

#[test]
fn every_count_of_axes_is_measured_and_planned_and_all_are_stopped_again() {
    let sim = Sim::patient();
    let lines = sim.mgw(&["--json", "bench", "--yes", "--rounds", "20"]).json_lines();
    let bench = &lines[0]["bench"];
    let cycles = bench["cycles"].as_array().expect("cycles");
    let axes: Vec<&Value> = cycles.iter().map(|cycles| &cycles["axes"]).collect();
    assert_eq!(axes, [&json!([0]), &json!([0, 1]), &json!([0, 1, 2, 3])]);
    let spreads = cycles.iter().map(|cycles| &cycles["measured"]);
    for spread in spreads.chain([&bench["ping"], &bench["read_state"]]) {
        let at = |name: &str| spread[name].as_u64().expect(name);
        assert_eq!(at("rounds"), 20);
        assert!(at("p50_us") <= at("p99_us") && at("p99_us") <= at("p99_9_us"), "{spread}");
        assert!(at("p99_9_us") <= at("max_us") && spread["rate_hz"].as_f64() > Some(0.0));
    }
    for cycles in cycles {
        // What is planned is what `mgw plan` says of these axes: no cycle is faster than its wire.
        let wire = cycles["planned"]["buses"][0]["wire_us"].as_u64();
        assert!(cycles["measured"]["p50_us"].as_u64() >= wire, "{cycles}");
        assert_eq!(cycles["unanswered"], 0);
    }
    let words = ["--json", "plan", FOUR, "--host", "usb", "--no-positions"];
    let planned = mgw(&words).json_lines();
    assert_eq!(cycles[2]["planned"], planned[0]["plan"]);
    for (axis, rest) in ["holding", "idle", "idle", "holding"].into_iter().enumerate() {
        let state = state(&sim, axis);
        assert!(state == rest || state == "idle" || state == "holding", "{axis}: {state}");
    }
}

#[test]
fn delays_are_kept_for_a_plan_and_the_picture_is_svg() {
    let sim = Sim::patient();
    let (delays, svg) = (&file("delays.toml"), &file("rates.svg"));
    let words = ["bench", "0", "--yes", "--rounds", "10", "--delays", delays, "--svg", svg];
    let said = sim.mgw(&words).success();
    assert!(said.contains("Cycle of 1") && said.contains("(estimated)"), "{said}");
    let planned = mgw(&["--json", "plan", FOUR, "--delays", delays]).json_lines();
    let axes = &planned[0]["plan"]["buses"][0]["axes"];
    let stated = |axis: usize| &axes[axis]["reply_delay_stated"];
    assert_eq!((stated(0), stated(1)), (&json!(true), &json!(false)));
    let picture = fs::read_to_string(svg).unwrap();
    assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"));
    assert!(picture.contains("measured") && picture.contains("planned"));
}

#[test]
fn nothing_is_armed_without_a_yes_or_on_bad_input() {
    let sim = Sim::patient();
    for (arguments, code, said) in [
        (&["bench"][..], 2, "Add --yes"),
        (&["--json", "bench"], 2, "Add --yes"),
        (&["bench", "9", "--yes"], 1, "axis 9 is not configured"),
        (&["bench", "0", "0", "--yes"], 2, "axis 0 is named twice"),
        (&["bench", "--yes", "--rounds", "1"], 2, "10..=1000000"),
        (&["bench", "--yes", "--velocity", "inf"], 2, "--velocity takes a number"),
        (&["bench", "--yes", "--host", "9"], 2, "1200 to 20000000"),
        (
            &["bench", "0", "--yes", "--rounds", "10", "--velocity", "1000"],
            1,
            "are -30 rad/s to 30",
        ),
        (&["bench", "0", "--yes", "--rounds", "10", "--svg", "/nowhere/x"], 1, "/nowhere/x"),
    ] {
        let error = sim.mgw_once_in_command(arguments).failure(code);
        assert!(error.contains(said), "{arguments:?}: {error}");
        let state = state(&sim, 0);
        assert!(state == "idle" || state == "holding", "{arguments:?}: {state}");
    }
}

#[test]
fn a_motor_that_falls_silent_ends_it_with_its_trip() {
    let mut sim = Sim::patient();
    sim.process.type_line("motor 0 mute");
    let error = sim.mgw(&["bench", "0", "--yes", "--rounds", "10"]).failure(1);
    assert!(error.contains("axis 0"), "{error}");
}
