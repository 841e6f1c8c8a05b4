//! `mgw cycle`.

use serde_json::Value;

use crate::support::{Process, Sim, json};

fn of<'a>(lines: &'a [Value], event: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["event"] == event).collect()
}

#[test]
fn axes_of_three_protocols_are_driven_in_one_period_and_stopped() {
    let sim = Sim::patient();
    let words = ["0", "velocity", "2", "1", "signal", "-0.1", "2", "velocity", "-2"];
    let cycle = [&["--json", "cycle"], &words[..], &["--rate", "50", "--for", "1.5"]].concat();
    let lines = sim.mgw(&cycle).json_lines();
    let periods = of(&lines, "period");
    assert!(periods.len() >= 3, "{lines:?}");
    for (place, wanted) in [(0, 2.0), (2, -2.0)] {
        let axis = &periods.last().unwrap()["axes"][place];
        assert_eq!((&axis["axis"], &axis["state"]), (&place.into(), &"active".into()));
        let speed = axis["velocity_rad_s"].as_f64().unwrap();
        assert!((speed - wanted).abs() < 0.2, "{axis}");
    }
    let ends = of(&lines, "cycle_ended");
    let [end] = ends[..] else { panic!("{lines:?}") };
    // How many a busy machine can tell of is its business.
    let told = end["told"].as_u64().unwrap();
    assert!(told >= 3 && end["period"].as_u64().unwrap() + 1 >= told, "{end}");
    assert!(end["overruns"]["gateway"].is_u64() && end["latest_us"].is_u64(), "{end}");
    let stopped: Vec<&Value> = of(&lines, "stopped").iter().map(|line| &line["axis"]).collect();
    assert_eq!(stopped, [0, 1, 2]);
}

/// Of voltage, temperatures and faults a period tells one axis; each has been told by and by.
#[test]
fn fields_that_are_told_in_turns_are_shown_of_every_axis() {
    let sim = Sim::patient();
    let words = ["cycle", "0", "velocity", "2", "1", "signal", "0.1", "--rate", "50"];
    let words = [&words[..], &["--for", "1.5", "--fields", "velocity,voltage,faults"]].concat();
    let lines = sim.mgw(&[&["--json"], &words[..]].concat()).json_lines();
    let last = *of(&lines, "period").last().unwrap();
    let slow = last["slow"].as_array().unwrap();
    assert_eq!(slow.iter().map(|slow| &slow["axis"]).collect::<Vec<_>>(), [0, 1]);
    for slow in slow {
        assert!(slow["voltage_v"]["value"].is_f64() && slow["faults_raw"] == 0, "{slow}");
        assert!(slow["motor_temperature_c"].is_null(), "{slow}");
    }
    let text = sim.mgw_once_at_rest(&words).success();
    let heading = text.lines().find(|line| line.contains("period")).unwrap();
    let fields: Vec<&str> = heading.split("  ").map(str::trim).filter(|s| !s.is_empty()).collect();
    assert_eq!(fields[4..], ["velocity rad/s", "voltage V", "faults"], "{text}");
    let mut rows = text.lines().filter(|line| line.contains(" active "));
    let last: Vec<&str> = rows.next_back().unwrap().split_whitespace().collect();
    assert_eq!((last.len(), last[6]), (7, "none"), "{text}");
    assert!(last[5].parse::<f32>().is_ok_and(|volts| volts > 1.0), "{text}");
}

/// Events come faster than the shortest wait of the operating system.
#[test]
fn a_fast_cycle_ends_when_its_time_is_over() {
    let sim = Sim::patient();
    let lines = sim
        .mgw(&["--json", "cycle", "0", "velocity", "2", "--rate", "1000", "--for", "1"])
        .json_lines();
    assert!(!of(&lines, "period").is_empty() && of(&lines, "stopped").len() == 1, "{lines:?}");
}

#[test]
fn an_interrupt_stops_the_motors_and_tells_how_it_went() {
    let sim = Sim::patient();
    let arguments = ["--port", &sim.port, "cycle", "0", "velocity", "2", "--rate", "100"];
    let mut process = Process::start(&arguments);
    process.wait_for("a period", |line| (line.contains(" active ")).then_some(()));
    assert_eq!(process.interrupt(), Some(0));
    let state = sim.await_state("0", |state| state["state"] != "active");
    assert!(["idle", "holding", "stopping"].contains(&state["state"].as_str().unwrap()), "{state}");
}

#[test]
fn what_cannot_be_driven_so_is_refused_with_the_reason() {
    let sim = Sim::patient();
    for (words, wanted) in [
        (&["0", "velocity", "2", "--rate", "0"][..], "--rate takes a number of Hz above 0"),
        (&["0", "velocity", "--rate", "9"], "is not complete"),
        (&["0", "position", "1", "--rate", "9"], "none of signal, current and velocity"),
        (&["0", "velocity", "1", "0", "velocity", "1", "--rate", "9"], "named twice"),
    ] {
        let told = sim.mgw(&[&["cycle"], words].concat()).failure(2);
        assert!(told.contains(wanted), "{told}");
    }
    for (words, name) in [
        // 0.25 to 20 ms.
        (&["0", "velocity", "2", "--rate", "5000"][..], "out_of_range"),
        (&["0", "velocity", "2", "--rate", "1e-20"], "out_of_range"),
        (&["0", "velocity", "2", "--rate", "10"], "out_of_range"),
        (&["2", "current", "1", "--rate", "100"], "unsupported"),
        (&["0", "velocity", "nan", "--rate", "100"], "not_a_number"),
    ] {
        let outcome = sim.mgw_once_in_command(&[&["--json", "cycle"], words].concat());
        let error = json(&outcome.failure(1));
        assert_eq!(error["error"]["name"], name, "{words:?}: {error}");
        sim.await_state("0", |state| state["state"] != "active" && state["state"] != "armed");
    }
    // No motor is armed for a period that no gateway takes.
    let words = ["cycle", "0", "velocity", "2", "--rate", "5000"];
    let told = sim.mgw_once_in_command(&words);
    assert!(!told.stdout.contains("armed") && !told.stderr.contains("armed"), "{told:?}");
}
