//! `mgw doctor` names what is wrong, and what to do about it.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use mgw_cli::{Outcome, print_on};
use mgw_client::Interrupt;
use mgw_sim::{SimTransport, Wiring, World};

use crate::support::{FOUR, Sim, json};

/// The lines of one examination: grade, what it is of, what is said.
fn examine(sim: &Sim) -> Vec<(String, String, String)> {
    let outcome = sim.mgw_once_in_command(&["--json", "doctor"]);
    let report = json(outcome.stdout.lines().next().expect("a report"));
    let wrong = report["wrong"].as_u64().expect("a number");
    assert_eq!(outcome.code, Some(i32::from(wrong > 0)), "{outcome:?}");
    let text = |value: &serde_json::Value| value.as_str().expect("text").to_owned();
    let lines = report["doctor"].as_array().expect("a list").iter();
    lines.map(|line| (text(&line["grade"]), text(&line["of"]), text(&line["message"]))).collect()
}

fn is_said(lines: &[(String, String, String)], grade: &str, of: &str, text: &str) -> bool {
    lines
        .iter()
        .any(|line| (line.0.as_str(), line.1.as_str()) == (grade, of) && line.2.contains(text))
}

/// What is wrong beside the link and the clock, which this machine may hold up.
fn wrong(lines: &[(String, String, String)]) -> Vec<&str> {
    let lines = lines.iter().filter(|line| line.0 == "wrong");
    lines.map(|line| line.1.as_str()).filter(|of| !["link", "clock"].contains(of)).collect()
}

#[test]
fn a_gateway_that_is_well_is_found_so() {
    let lines = examine(&Sim::start());
    assert_eq!(wrong(&lines), Vec::<&str>::new(), "{lines:?}");
    for of in ["firmware", "gateway", "axis 0", "axis 1", "axis 2", "axis 3", "bus 0", "bus 2"] {
        assert!(is_said(&lines, "good", of, ""), "{of}: {lines:?}");
    }
}

#[test]
fn faults_are_found_and_said_what_to_do_about() {
    let mut sim = Sim::start();
    sim.mgw_once_in_command(&["config", "axis", "3", "rmd_dialect=v4_4"]).success();
    sim.half_configure(7, "bus = 0\n");
    sim.mgw_once_in_command(&["config", "timeout", "0", "0"]).success();
    sim.typed("motor 0 faults 0x0002");
    let lines = examine(&sim);
    for (of, text) in [
        ("axis 0", "stall (0x0002)"),
        ("axis 0", "`mgw config timeout 0 300`"),
        ("axis 3", "contradict rmd_dialect = v4_4"),
        ("axis 7", "lacks protocol"),
    ] {
        assert!(is_said(&lines, "wrong", of, text), "{of} {text}: {lines:?}");
    }
    assert_eq!(wrong(&lines).len(), 4, "{lines:?}");

    sim.typed("bus 1 cut");
    let lines = examine(&sim);
    assert!(is_said(&lines, "wrong", "bus 1", "120 Ω at both ends"), "{lines:?}");
    assert!(is_said(&lines, "wrong", "axis 2", "did not reply"), "{lines:?}");

    sim.typed("e-stop press");
    let lines = examine(&sim);
    assert!(is_said(&lines, "wrong", "gateway", "release the button"), "{lines:?}");
    assert!(is_said(&lines, "note", "bus 0", "not scanned"), "{lines:?}");
}

#[test]
fn motors_without_an_axis_and_two_with_one_id_are_found() {
    let sim = Sim::with(&["--motor", "0:rmd:1", "--motor", "0:rmd:2", "--motor", "0:rmd:2:v4_4"]);
    let lines = examine(&sim);
    assert!(is_said(&lines, "wrong", "buses", "none is configured"), "{lines:?}");
    let bus = ["config", "bus", "0", "bitrate=1000000", "protocols=rmd"];
    sim.mgw_once_in_command(&bus).success();
    let lines = examine(&sim);
    assert!(is_said(&lines, "note", "bus 0", "rmd 1 is no axis: `mgw adopt`"), "{lines:?}");
    assert!(is_said(&lines, "wrong", "bus 0", "two motors seem to be rmd 2"), "{lines:?}");
}

/// The motor of axis 3 was asked last 2 s ago: its own timeout has struck, which it says once a
/// second. In virtual time, so that it says so while the first request to it is on the line.
#[test]
fn a_motor_that_speaks_into_a_request_is_no_noise() {
    let mut collisions = 0;
    for phase in 0..40 {
        let world = Rc::new(RefCell::new(World::new(Wiring::four_motors())));
        let run = |words: &[&str]| -> (Outcome, String) {
            let transport = SimTransport::new(world.clone(), 0);
            print_on(Box::new(transport), Interrupt::default(), words)
        };
        assert_eq!(run(&["config", "apply", FOUR]).0.exit_code, 0);
        world.borrow_mut().run_for(Duration::from_secs(2));
        world.borrow_mut().trace();
        world.borrow_mut().run_for(Duration::from_secs(1));
        let trace = world.borrow_mut().trace();
        let notice = trace.iter().find(|entry| entry.wire.to_string().starts_with("3E0108F1"));
        let next_us = notice.expect("a notice").time_us + 1_000_000;
        // The doctor comes to bus 2 after 31 ms, to the motor some 100 µs long.
        let begin_us = next_us - 32_500 + 50 * phase;
        world.borrow_mut().run_until(gateway::Instant::from_micros(begin_us));
        let (outcome, said) = run(&["doctor"]);
        assert_eq!(outcome.exit_code, 0, "{said}");
        collisions += usize::from(said.contains("note  bus 2     13 bytes were no frames"));
    }
    assert!(collisions > 0);
}
