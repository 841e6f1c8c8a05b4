//! Faults typed into the simulator, and what a user sees of them.

use serde_json::Value;

use crate::support::{Sim, json, mgw};

/// Has axis 0 move, puts a fault into the simulator, and returns the events that were printed, all
/// of which the schema allows, and the error.
fn in_motion(sim: &mut Sim, fault: &str) -> (Vec<String>, String) {
    let port = sim.port.clone();
    let set = std::thread::spawn(move || {
        mgw(&["--json", "--port", &port, "set", "0", "velocity", "2", "--for", "60"])
    });
    sim.process.wait_for("motion", |line| line.contains("bus 0  rmd 1  moving").then_some(()));
    sim.process.type_line(fault);
    let outcome = set.join().expect("it runs");
    let text = |value: &Value| value.as_str().expect("text").to_owned();
    let events = outcome.stdout.lines().map(|line| text(&json(line)["event"])).collect();
    (events, text(&json(&outcome.stderr)["error"]["message"]))
}

#[test]
fn the_e_stop_button_trips_what_moves() {
    let mut sim = Sim::patient();
    let (events, text) = in_motion(&mut sim, "e-stop press");
    for event in ["e_stop_input_changed", "e_stop_latched", "tripped", "stop_confirmed"] {
        assert!(events.iter().any(|told| told == event), "{event}: {events:?}");
    }
    assert!(text.contains("axis 0 tripped: emergency stop"), "{text}");
    assert!(sim.mgw(&["info"]).success().contains("latched, input open"));
    sim.mgw(&["clear", "gateway"]).failure(1);
    sim.typed("e-stop release");
    sim.mgw_once_in_command(&["clear", "gateway"]).success();
    sim.mgw(&["clear", "0"]).success();
    sim.mgw(&["set", "0", "velocity", "1", "--for", "0.1"]).success();
}

#[test]
fn a_fault_of_a_motor_is_called_by_its_name() {
    let mut sim = Sim::patient();
    let (_, text) = in_motion(&mut sim, "motor 0 faults 0x0002");
    assert!(text.contains("axis 0 tripped: the motor reported a fault: stall (0x0002)"), "{text}");
    let axis = sim.await_state("0", |state| state["stop_confirmed"] == true);
    assert_eq!(axis["faults"], serde_json::json!(["stall"]));
    assert_eq!(axis["faults_raw"], 2);
    assert_eq!(axis["trip"]["reason"], "motor_fault");
    assert_eq!(axis["trip"]["faults"], serde_json::json!(["stall"]));
    let text = sim.mgw(&["state", "0"]).success();
    assert!(text.contains("axis 0: stall (0x0002): the motor's light flashes fast"), "{text}");
    assert!(sim.mgw(&["trips"]).success().contains("reported a fault: stall (0x0002)"));
}

#[test]
fn on_a_cut_bus_no_stop_is_confirmed_until_it_is_mended() {
    let mut sim = Sim::patient();
    let (_, text) = in_motion(&mut sim, "bus 0 cut");
    assert!(text.contains("axis 0 has not confirmed its stop"), "{text}");
    sim.process.type_line("bus 0 mend");
    let axis = sim.await_state("0", |state| state["stop_confirmed"] == true);
    assert_eq!(axis["trip"]["reason"], "not_acknowledged");
}

#[test]
fn a_mute_motor_does_not_answer_until_it_speaks_again() {
    let mut sim = Sim::start();
    for (typed, code) in [("motor 0 mute", 1), ("motor 0 mute off", 0)] {
        sim.typed(typed);
        assert_eq!(sim.mgw(&["native", "0", "9A00000000000000"]).code, Some(code), "{typed}");
    }
}

#[test]
fn a_board_that_loses_its_power_forgets_and_one_that_is_reset_does_not() {
    let mut sim = Sim::patient();
    sim.typed("reset");
    let info = &sim.mgw(&["--json", "info"]).json_lines()[0];
    assert_eq!((&info["boot"], &info["status"]["starts"]), (&"pin".into(), &2.into()));
    let (_, text) = in_motion(&mut sim, "power off");
    assert!(text.contains("the stop was sent, not confirmed"), "{text}");
    // The motor has a timeout of its own.
    sim.process.wait_for("its stop", |line| line.contains("rmd 1  stopped").then_some(()));
    sim.typed("power on");
    assert!(sim.mgw(&["axes"]).success().contains("no axis is configured"));
}

#[test]
fn a_thruster_that_refuses_its_stop_for_a_fault_that_it_keeps_has_a_way_out() {
    let mut sim = Sim::patient();
    let port = sim.port.clone();
    let set = std::thread::spawn(move || {
        mgw(&["--port", &port, "set", "1", "signal", "0.3", "--for", "60"])
    });
    sim.process
        .wait_for("motion", |line| line.contains("bus 0  thruster 0x0B  moving").then_some(()));
    sim.typed("motor 1 faults 0x0040");
    set.join().expect("it runs");
    // Its cause is gone; what it keeps is not.
    sim.typed("motor 1 faults 0");
    let state = json(&sim.mgw(&["--json", "state", "1"]).success());
    assert_eq!(state["axes"][0]["trip"]["faults"], serde_json::json!(["stall"]), "{state}");
    let text = sim.mgw_once_in_command(&["clear", "1"]).failure(1);
    let told = "refuses its stop for a fault that it keeps (stall (0x0040))";
    assert!(text.contains(told) && text.contains("`mgw clear 1 --unreachable`"), "{text}");
    let text = sim.mgw_once_in_command(&["motor", "1", "clear-faults", "--yes"]).failure(1);
    assert!(text.contains("has not confirmed its stop"), "{text}");
    let doctor = sim.mgw_once_in_command(&["doctor"]).stdout;
    assert!(doctor.contains("goes on refusing its stop for the fault"), "{doctor}");
    sim.mgw_once_in_command(&["clear", "1", "--unreachable"]).success();
    let text = sim.mgw_once_in_command(&["clear", "1"]).success();
    assert!(text.contains("its motor was told to clear its faults"), "{text}");
    sim.mgw_once_in_command(&["config", "timeout", "1", "500"]).success();
    sim.mgw_once_in_command(&["set", "1", "signal", "0.2", "--for", "0.1"]).success();
}

#[test]
fn what_is_no_fault_is_answered_with_those_that_there_are() {
    let mut sim = Sim::start();
    for (typed, said) in [
        ("help", "motor N FAULT [off]"),
        ("help me", "`help me` is no fault"),
        ("motor 0 tired", "FAULT: mute, unplugged"),
        ("motor 9 mute", "there is no motor 9"),
        ("bus 9 cut", "there is no bus 9"),
        ("bus x cut", "`x` is not the number of a bus"),
    ] {
        sim.process.type_line(typed);
        sim.process.wait_for(said, |line| line.contains(said).then_some(()));
    }
}
