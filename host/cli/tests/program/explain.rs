//! An error leads to its page: by the code at its end, which `mgw explain` takes.

use crate::support::{Sim, json, mgw};

/// What `mgw explain` prints for the code at the end of a text.
fn page_of(text: &str) -> String {
    let (_, code) = text.trim_end().rsplit_once(" [").expect("a code");
    mgw(&["explain", &format!("[{code}")]).success()
}

#[test]
fn the_code_of_an_error_leads_to_its_page() {
    let text = mgw(&["--port", "/dev/no-such-gateway", "info"]).failure(1);
    assert!(text.ends_with("ttyUSB*). [E-no-port]\n"), "{text}");
    assert!(page_of(&text).starts_with("# No port leads to a gateway\n"));
    // The same where no port was named, whose exit code is that of wrong usage.
    let text = mgw(&["info"]).failure(2);
    assert!(text.ends_with("starts a simulated one. [E-no-port]\n"), "{text}");
    let error = json(&mgw(&["--json", "info"]).failure(2));
    assert_eq!(error["error"]["explain"], "E-no-port");
    assert_eq!(error["error"]["name"], "usage");
    // What says all there is has none.
    let text = mgw(&["decode", "/no/such/file"]).failure(2);
    assert!(text.ends_with("Check the path.\n"), "{text}");
}

#[test]
fn refusals_and_trips_have_their_codes() {
    let sim = Sim::patient();
    let text = sim.mgw_once_in_command(&["set", "0", "velocity", "1000"]).failure(1);
    assert!(page_of(&text).starts_with("# A value is not allowed\n"), "{text}");

    let moving = ["set", "0", "velocity", "1", "--for", "40"];
    let outcome = sim.mgw_beside(&moving, "0", &["active"], || {
        sim.mgw_once_connected(&["estop"]).success();
    });
    let text = outcome.failure(1);
    assert!(page_of(&text).starts_with("# The e-stop is latched\n"), "{text}");
    let text = sim.mgw_once_in_command(&["arm", "0"]).failure(1);
    assert!(text.contains("the e-stop is latched") && text.ends_with(" [E-e-stop]\n"), "{text}");
    let told = sim.mgw_once_in_command(&["trips"]).success();
    assert!(told.contains("axis 0 tripped: emergency stop [E-e-stop]"), "{told}");
    let state = sim.await_state("0", |state| state["trip"].is_object());
    assert_eq!(state["trip"]["explain"], "E-e-stop");
    let report = sim.mgw_once_in_command(&["--json", "doctor"]).stdout;
    let report = json(report.lines().next().unwrap());
    let lines = report["doctor"].as_array().unwrap();
    assert!(lines.iter().any(|line| line["explain"] == "E-e-stop"), "{report}");
}

#[test]
fn all_pages_are_listed_and_another_code_says_so() {
    let told = mgw(&["explain"]).success();
    assert!(told.contains("E-bus-off") && told.contains("The CAN bus is off"), "{told}");
    let text = mgw(&["explain", "E0308"]).failure(2);
    assert!(text.contains("`E0308`") && text.contains("`mgw explain` lists them"), "{text}");
}
