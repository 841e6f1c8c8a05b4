//! `mgw watch`: the subscription as a user sees it.

use serde_json::Value;

use crate::support::{Process, Sim};

#[test]
fn as_many_samples_of_each_axis_as_asked() {
    let sim = Sim::start();
    let lines =
        sim.mgw(&["--json", "watch", "0", "1", "--period", "50", "--count", "3"]).json_lines();
    for axis in [0, 1] {
        let samples = lines.iter().filter(|line| line["event"] == "sample" && line["axis"] == axis);
        assert_eq!(samples.count(), 3, "{lines:?}");
    }
    // Once every configured axis: headings and a row for each.
    let text = sim.mgw(&["watch", "--count", "1"]).success();
    assert!(
        text.starts_with("axis  state         position rad  velocity rad/s  current A"),
        "{text}"
    );
    assert_eq!(text.lines().count(), 5, "{text}");
}

#[test]
fn chosen_fields_with_their_own_ages() {
    let sim = Sim::start();
    let arguments =
        ["--json", "watch", "0", "--fields", "velocity,faults", "--period", "100", "--count", "10"];
    let lines = sim.mgw(&arguments).json_lines();
    let last = lines.last().unwrap();
    assert_eq!(last["state"], "idle");
    let names: Vec<&str> = last.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(
        names.join(" "),
        "axis dropped event fault_warnings fault_warnings_raw faults faults_age_us faults_raw \
         name state stop_confirmed time_us velocity_rad_s"
    );
    let age = |age: &Value| age.as_u64().unwrap_or(u64::MAX);
    let ages = [&last["velocity_rad_s"]["age_us"], &last["faults_age_us"]].map(age);
    assert!(ages[0].max(ages[1]) < 1_000_000 && ages[0] != ages[1], "{last}");
    let text = sim.mgw(&["watch", "0", "--fields", "faults,position", "--count", "1"]).success();
    // An event may come before.
    assert!(text.lines().any(|line| line == "axis  state         position rad  faults"), "{text}");
    let text = sim.mgw(&["watch", "0", "--fields", "speed"]).failure(2);
    assert!(text.contains("position, velocity, current"), "{text}");
}

#[test]
fn events_come_between_and_ctrl_c_ends_it() {
    let sim = Sim::patient();
    let mut watch =
        Process::start(&["--port", &sim.port, "--json", "watch", "0", "--period", "20"]);
    let parse = |line: &str| serde_json::from_str::<Value>(line).unwrap();
    watch.wait_for("a sample", |line| (parse(line)["event"] == "sample").then_some(()));
    sim.mgw(&["set", "0", "velocity", "2", "--for", "0.3"]).success();
    watch.wait_for("motion", |line| {
        parse(line)["velocity_rad_s"]["value"].as_f64().filter(|speed| *speed > 1.0)
    });
    watch.wait_for("the confirmed stop", |line| {
        (parse(line)["event"] == "stop_confirmed").then_some(())
    });
    assert_eq!(watch.interrupt(), Some(0));
}

/// More than a link of 921600 baud carries: what does not fit is counted, and the rest still comes.
#[test]
fn samples_that_the_link_cannot_carry_are_counted() {
    const COUNT: usize = 500;
    let sim = Sim::start();
    let arguments = ["watch", "0", "3", "--period", "1", "--count", &COUNT.to_string()];
    let lines = sim.mgw(&[&["--json"], arguments.as_slice()].concat()).json_lines();
    let sum = |field: &str| lines.iter().filter_map(|line| line[field].as_u64()).sum::<u64>();
    let (lost, dropped) = (sum("count"), sum("dropped"));
    assert!(dropped > 10 && lost >= dropped, "{lost} lost, {dropped} of them by the gateway");
    assert_eq!(lines.iter().filter(|line| line["event"] == "sample").count(), 2 * COUNT);
    let text = sim.mgw(&arguments).success();
    assert!(text.ends_with(" samples or events were lost\n"), "{text}");
}

#[test]
fn axes_are_watched_once_and_only_if_they_are_configured() {
    let sim = Sim::start();
    let lines =
        sim.mgw(&["--json", "watch", "0", "0", "--period", "50", "--count", "2"]).json_lines();
    assert_eq!(lines.iter().filter(|line| line["event"] == "sample").count(), 2, "{lines:?}");
    let text = sim.mgw(&["watch", "0", "9"]).failure(1);
    assert!(text.contains("axis 9 is not configured"), "{text}");
}

#[test]
fn a_motor_that_does_not_answer_is_told_once() {
    let sim = Sim::start();
    sim.mgw(&["config", "axis", "5", "bus=0", "protocol=rmd", "node=9", "stop_action=hold"])
        .success();
    let lines =
        sim.mgw(&["--json", "watch", "0", "5", "--period", "100", "--count", "50"]).json_lines();
    let silent: Vec<_> = lines.iter().filter(|line| line["event"] == "motor_silent").collect();
    let [silent] = silent.as_slice() else { panic!("{silent:?}") };
    assert_eq!(silent["axis"], 5);
    assert!(
        silent["message"].as_str().unwrap().contains("motor of axis 5 did not reply"),
        "{silent}"
    );
}
