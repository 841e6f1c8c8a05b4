//! `mgw move`.

use serde_json::Value;

use crate::support::{Sim, json};

fn arrival(lines: &[Value]) -> &Value {
    lines.iter().find(|line| line["arrived"].is_boolean()).unwrap_or_else(|| panic!("{lines:?}"))
}

#[test]
fn an_axis_goes_by_a_distance_and_says_that_it_has_arrived() {
    let sim = Sim::patient();
    for (distance, target) in [("1.5", 1.5), ("-0.5", 1.0)] {
        let lines = sim.mgw(&["--json", "move", "0", distance, "--speed-limit", "5"]).json_lines();
        let goal = lines.iter().find_map(|line| line["target_rad"].as_f64()).unwrap();
        assert!((goal - target).abs() < 0.05, "{lines:?}");
        let arrived = arrival(&lines);
        assert_eq!(arrived["arrived"], true, "{lines:?}");
        assert!((arrived["position_rad"].as_f64().unwrap() - goal).abs() <= 0.02, "{arrived}");
        assert!(lines.iter().any(|line| line["event"] == "stop_confirmed"), "{lines:?}");
        assert_eq!(lines.last().unwrap()["state"], "holding");
    }
    let text = sim.mgw(&["move", "3", "1", "--speed-limit", "5", "--tolerance", "0.1"]).success();
    assert!(text.contains("axis 3 moves from 0.000 rad to 1.000 rad"), "{text}");
    assert!(text.contains("axis 3 has arrived") && text.ends_with("axis 3 is holding\n"), "{text}");
}

#[test]
fn for_ends_it_on_the_way() {
    let sim = Sim::patient();
    let outcome = sim.mgw(&["--json", "move", "0", "50", "--speed-limit", "1", "--for", "0.5"]);
    let lines: Vec<Value> = outcome.stdout.lines().map(json).collect();
    assert_eq!(arrival(&lines)["arrived"], false, "{lines:?}");
    assert_eq!(lines.last().unwrap()["state"], "holding");
    let error = json(&outcome.failure(1));
    assert_eq!(error["error"]["name"], "not_arrived");
    assert!(
        error["error"]["message"].as_str().unwrap().contains("was to go to 50.000 rad"),
        "{error}"
    );
}

#[test]
fn what_cannot_be_moved_so_is_refused_before_arming() {
    let sim = Sim::patient();
    for (arguments, name) in [
        (&["1", "1", "--speed-limit", "1"][..], "unsupported"),
        (&["0", "1", "--speed-limit", "0"], "speed_limit_zero"),
        (&["2", "1", "--speed-limit", "1"], "unsupported"),
        (&["0", "nan", "--speed-limit", "1"], "not_a_number"),
        (&["0", "inf", "--speed-limit", "1"], "not_a_number"),
        (&["0", "1", "--speed-limit", "-1"], "out_of_range"),
        (&["0", "1", "--speed-limit", "0.001"], "out_of_range"),
        (&["0", "1", "--speed-limit", "1000"], "out_of_range"),
    ] {
        let outcome = sim.mgw(&[&["--json", "move"], arguments].concat());
        assert_eq!(outcome.stdout, "", "{arguments:?}");
        let text = outcome.failure(1);
        let error = json(&text);
        assert_eq!(error["error"]["name"], name, "{arguments:?}: {error}");
        assert_eq!(sim.await_state(arguments[0], |_| true)["state"], "idle");
    }
    sim.mgw(&["move", "0", "1"]).failure(2);
    sim.mgw(&["move", "0", "1", "--speed-limit", "1", "--tolerance", "0"]).failure(2);
    sim.mgw(&["move", "0", "1", "--speed-limit", "1", "--for", "0"]).failure(2);
}

#[test]
fn a_move_beyond_the_positions_of_its_axis_is_refused_before_arming() {
    let sim = Sim::patient();
    sim.mgw_once_in_command(&["config", "axis", "0", "position_max_rad=1"]).success();
    let outcome = sim.mgw_once_in_command(&["--json", "move", "0", "1.5", "--speed-limit", "1"]);
    assert_eq!(outcome.stdout, "");
    assert!(outcome.failure(1).contains("out_of_range"));
    sim.mgw_once_in_command(&["move", "0", "0.5", "--speed-limit", "5"]).success();
}
