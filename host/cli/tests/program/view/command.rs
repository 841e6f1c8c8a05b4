//! What a page may do, and what becomes of the axes of a page that goes.

use serde_json::{Value, json};

use super::{View, motor_is_stopped};
use crate::support::{Process, Sim};

#[test]
fn a_stop_of_the_page_is_on_the_bus_whoever_commands() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    assert_eq!(page.event("welcome")["grant"], "command");
    let socket = format!("unix:{}", view.server.socket.display());
    let mut host =
        Process::start(&["--port", &socket, "--json", "set", "0", "velocity", "2", "--for", "60"]);
    page.await_motion(0);
    page.say(json!({ "ask": "take" }));
    let refused = page.event("command");
    assert_eq!(refused["state"], "lost", "{refused}");
    assert!(refused["message"].as_str().unwrap().contains("is in command"), "{refused}");
    page.say(json!({ "ask": "stop" }));
    let phase = |phase: &'static str| {
        move |message: &Value| {
            let is_it = message["event"] == "stop" && message["phase"] == phase;
            is_it.then(|| message.clone())
        }
    };
    page.wait_for("that it was taken", phase("taken"));
    motor_is_stopped(&sim);
    let report = page.wait_for("the report", phase("report"));
    let axes = report["axes"].as_array().unwrap();
    assert_eq!(axes.len(), 4, "{report}");
    assert!(axes.iter().all(|axis| axis["stop"] == "confirmed"), "{report}");
    assert_ne!(host.wait(), Some(0), "somebody else has stopped it");
}

#[test]
fn a_page_moves_only_what_it_has_armed_in_command() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.event("welcome");
    let jog = json!({ "ask": "jog", "axis": 0, "mode": "velocity", "value": 1.0 });
    page.say(jog.clone());
    assert!(page.refusal().contains("take command first"));
    page.take_command();
    page.say(jog.clone());
    assert!(page.refusal().contains("arm it first"));
    page.say(json!({ "ask": "arm", "axis": 99 }));
    assert!(page.refusal().contains("axis 99"));
    page.say(json!({ "ask": "fly" }));
    assert!(page.refusal().contains("fly"));
    page.arm(0);
    // Beyond the limit of the axis.
    page.say(json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": 1000.0 }));
    assert!(page.refusal().contains("velocity"));
    assert_eq!(page.event("disarmed")["axis"], 0, "what was refused ends what was armed");
}

#[test]
fn a_message_that_is_refused_or_cannot_be_read_stops_what_its_page_has_armed() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.take_command();
    for refused in [
        // Readable, and refused: the page has not armed this axis.
        json!({ "ask": "set", "axis": 1, "mode": "velocity", "value": 1.0 }),
        json!({ "ask": "jog", "axis": 1, "mode": "velocity", "value": 1.0 }),
        json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": null }),
        json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": 1e300 }),
        json!("slower"),
    ] {
        page.arm_once_at_rest(0);
        page.say(json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": 2.0 }));
        page.await_state(0, "active");
        page.say(refused.clone());
        assert!(!page.refusal().is_empty());
        assert_eq!(page.event("disarmed")["axis"], 0, "{refused}");
        motor_is_stopped(&sim);
    }
}

#[test]
fn a_page_that_says_only_what_cannot_be_read_counts_as_silent() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.take_command();
    let ended = page.wait_for_saying("the end", &json!("here"), |message| {
        (message["event"] == "command").then(|| message["message"].as_str().unwrap().to_owned())
    });
    assert!(ended.contains("silent"), "{ended}");
}

#[test]
fn a_jog_that_is_not_repeated_stops_by_itself() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.take_command();
    page.arm(0);
    page.say(json!({ "ask": "jog", "axis": 0, "mode": "velocity", "value": 2.0 }));
    // The page is still there, and says nothing of the jog.
    assert_eq!(page.event("disarmed")["axis"], 0);
    motor_is_stopped(&sim);
    // An RMD that was stopped holds.
    page.await_state(0, "holding");
}

#[test]
fn the_axes_of_a_page_in_command_that_vanishes_trip() {
    let sim = Sim::with_times(10_000_000, 1_500_000);
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.turn(0);
    let mut other = view.page();
    other.event("axes");
    drop(page);
    motor_is_stopped(&sim);
    let told = other.await_state(0, "tripped");
    assert_eq!(told["axis"]["trip"]["reason"], "host_silent", "{told}");
    assert!(told["trip_text"].as_str().unwrap().contains("axis 0 tripped"), "{told}");
}

#[test]
fn the_axes_of_a_page_in_command_that_hangs_trip() {
    let sim = Sim::with_times(10_000_000, 1_500_000);
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.turn(0);
    // It says nothing any more, and its connection stays.
    motor_is_stopped(&sim);
    let ended = page.event("command");
    assert!(ended["message"].as_str().unwrap().contains("silent"), "{ended}");
    let told = page.await_state(0, "tripped");
    assert_eq!(told["axis"]["trip"]["reason"], "host_silent", "{told}");
}
