//! The host dies in mid-motion, without a word.

use serde_json::Value;

use crate::support::{Process, Sim, mgw};

/// Moves an axis with a process of its own, kills that, and returns the state in which the axis
/// ends.
fn kill_while_moving(sim: &Sim, axis: &str, motor: &str, setpoint: &[&str]) -> Value {
    let mut host = Process::start(
        &[&["--port", &sim.port, "--json", "set", axis], setpoint, &["--for", "60"]].concat(),
    );
    host.await_motion();
    host.kill();
    sim.await_stop(motor);
    sim.await_state(axis, |state| state["state"] == "tripped" && state["stop_confirmed"] == true)
}

/// Long enough for a process that this machine holds up, in µs.
const PATIENCE_US: u32 = 10_000_000;
/// What the test waits for, in µs.
const LIMIT_US: u32 = 1_500_000;

#[test]
fn an_axis_stops_when_its_setpoint_expires() {
    let sim = Sim::with_times(LIMIT_US, PATIENCE_US);
    let state = kill_while_moving(&sim, "0", "bus 0  rmd 1", &["velocity", "2"]);
    assert_eq!(state["trip"]["reason"], "setpoint_expired");
    assert!(sim.mgw(&["state", "0"]).success().contains("tripped, stop confirmed"));
    sim.mgw_once_in_command(&["clear", "0"]).success();
    sim.mgw(&["set", "0", "velocity", "1", "--for", "0.3"]).success();
}

#[test]
fn every_kind_of_motor_stops_when_the_link_is_silent() {
    let sim = Sim::with_times(PATIENCE_US, LIMIT_US);
    for (axis, motor, setpoint) in [
        ("0", "bus 0  rmd 1", ["velocity", "2"]),
        ("1", "thruster", ["signal", "0.3"]),
        ("2", "d5", ["velocity", "5"]),
        ("3", "bus 2  rmd 1", ["velocity", "-2"]),
    ] {
        let state = kill_while_moving(&sim, axis, motor, &setpoint);
        assert_eq!(state["trip"]["reason"], "host_silent");
        sim.mgw_once_in_command(&["clear", axis]).success();
    }
}

/// The other way round: what becomes of the motor is said by who no longer hears the gateway.
#[test]
fn a_host_whose_gateway_goes_says_what_becomes_of_the_axis() {
    let mut sim = Sim::patient();
    let port = sim.port.clone();
    let set = std::thread::spawn(move || {
        mgw(&["--port", &port, "set", "0", "velocity", "2", "--for", "60"])
    });
    sim.process.wait_for("motion", |line| line.contains("moving").then_some(()));
    sim.process.kill();
    let outcome = set.join().unwrap();
    // Where a setpoint has found the connection closed before, the stop cannot be sent.
    let (stop, code) = if outcome.stderr.contains("(the connection is not open)") {
        ("the connection to the gateway failed", 1)
    } else {
        ("the stop was sent, not confirmed", 3)
    };
    let text = outcome.failure(code);
    for said in [stop, "axis 0 trips", "`mgw clear AXIS` clears it"] {
        assert!(text.contains(said), "{text}");
    }
}
