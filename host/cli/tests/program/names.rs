//! Names instead of numbers, typed as a user would.

use serde_json::{Value, json};

use crate::support::{Sim, file, mgw, mgw_reading};

/// A simulator whose RMD on CAN is `left`, its thruster `prop`, their bus `arm_bus`, itself
/// `arm-2_B`.
fn named(arguments: &[&str]) -> Sim {
    let sim = Sim::with(arguments);
    for words in [
        &["axis", "0", "name=left", "ttl_us=10000000"][..],
        &["axis", "1", "name=prop", "ttl_us=10000000"],
        &["bus", "0", "name=arm_bus"],
        &["gateway", "name=arm-2_B", "link_silence_us=10000000"],
    ] {
        sim.mgw_once_in_command(&[&["config"], words].concat()).success();
    }
    sim
}

#[test]
fn what_takes_a_number_takes_a_name() {
    let sim = named(&[]);
    for words in [
        &["arm", "left", "prop", "--for", "0.1"][..],
        &["set", "left", "velocity", "1", "--for", "0.1"],
        &["move", "left", "0.05", "--speed-limit", "1", "--for", "5"],
        &[
            "cycle", "left", "velocity", "1", "prop", "signal", "0.05", "--rate", "100", "--for",
            "0.2",
        ],
        &["native", "left", "--command", "read_status_2"],
        &["stop", "left"],
        &["output-off", "left"],
        &["motor", "left", "pid"],
        &["motor", "arm_bus:1", "pid"],
        &["motor", "arm_bus:thruster:11", "timeout"],
        &["raw", "arm_bus", "send", "141#9A00000000000000", "--wait", "0"],
        &["scan", "arm_bus", "--listen", "0"],
        &["scan", "arm_bus@1000000", "--listen", "0"],
        &["bus", "arm_bus"],
        &["state", "prop"],
        &["state", "0x01"],
        &["config", "timeout", "left", "300"],
        &["config", "axis", "left", "velocity_limit_rad_s=5"],
        &["config", "unset", "axis", "left", "velocity_limit_rad_s"],
        &["config", "bus", "arm_bus", "reply_window_us=6000"],
        &["config", "show", "left"],
        &["bench", "left", "--yes", "--rounds", "10"],
    ] {
        let outcome = sim.mgw_once_at_rest(words);
        // At its own bitrate a bus with axes is not scanned by the other way.
        if words[1] == "arm_bus@1000000" {
            assert!(!outcome.stderr.contains("is called"), "{outcome:?}");
        } else {
            assert_eq!(outcome.code, Some(0), "{words:?}: {outcome:?}");
        }
    }
    // Whether it has tripped depends on how busy this machine is.
    let outcome = sim.mgw_once_in_command(&["clear", "prop"]);
    assert!(
        outcome.code == Some(0) || outcome.stderr.contains("axis 1 has nothing that this clears")
    );
    let text = sim.mgw(&["jog", "left"]).failure(2);
    assert!(text.contains("standard input is none"), "{text}");
    sim.mgw_once_in_command(&["config", "remove", "prop"]).success();
    let text = sim.mgw(&["state", "prop"]).failure(2);
    assert!(text.contains("no axis is called `prop`; there are: left (0)"), "{text}");
}

#[test]
fn a_configuration_names_buses_and_axes() {
    let sim = named(&[]);
    let own = ["config", "axis", "7", "protocol=rmd", "node=7", "stop_action=hold", "bus=arm_bus"];
    sim.mgw_once_in_command(&own).success();
    let bus = &sim.mgw(&["--json", "config", "show", "7"]).json_lines()[0]["parameters"]["bus"];
    assert_eq!(bus, 0);
    let text = sim.mgw(&["config", "axis", "7", "bus=amr_bus"]).failure(2);
    assert!(text.contains("no bus is called `amr_bus`; there are: arm_bus (0)"), "{text}");
    let merge = |text: &str| {
        let arguments = ["--port", &sim.port, "config", "apply", "-", "--merge"];
        mgw_reading(&arguments, text)
    };
    merge("[[axis]]\naxis = \"left\"\nttl_us = 70_000\n").success();
    merge("[[bus]]\nbus = \"arm_bus\"\nexclusive = true\n").success();
    let left = &sim.mgw(&["--json", "config", "show", "0"]).json_lines()[0]["parameters"];
    assert_eq!(left["ttl_us"], 70_000);
    let text = merge("[[axis]]\naxis = \"right\"\nttl_us = 70_000\n").failure(2);
    let there = "line 2, no axis is called `right`; there are: left (0), prop (1)";
    assert!(text.contains(there), "{text}");
    let file = file("named.toml");
    std::fs::write(&file, sim.mgw(&["config", "dump"]).success()).unwrap();
    let delays = "[reply_delay_us]\nleft = 900\n";
    let plan = ["--json", "plan", &file, "--delays", "-"];
    let axes = mgw_reading(&plan, delays).json_lines();
    let by_number = mgw_reading(&plan, delays.replace("left", "0")).json_lines();
    assert_eq!(axes, by_number);
    let text = mgw(&["play", "run.mcap", "--axis", "left"]).failure(2);
    assert!(text.contains("the number of an axis: a recording has no names"), "{text}");
    let text = mgw_reading(&plan, delays.replace("left", "right")).failure(2);
    assert!(text.contains("no axis is called `right`; there are: left (0), prop (1)"), "{text}");
}

#[test]
fn d5_motors_start_together_by_name() {
    let sim = Sim::start();
    sim.mgw(&["config", "axis", "2", "name=third"]).success();
    let text =
        sim.mgw(&["together", "third", "velocity", "1", "third", "velocity", "2"]).failure(2);
    assert!(text.contains("axis 2 is named twice"), "{text}");
    let text = sim.mgw(&["together", "3rd", "velocity", "1", "2", "velocity", "2"]).failure(2);
    assert!(text.contains("`3rd` is neither the number nor the name of an axis"), "{text}");
}

/// The gateway would refuse it when both are armed.
#[test]
fn what_cannot_start_together_is_told_before_anything_is_armed() {
    let sim = Sim::patient();
    for (axis, said) in [
        ("1", "axis 1 speaks thruster: only D5 motors are started by one frame"),
        ("0", "axis 0 speaks rmd: only D5 motors are started by one frame"),
    ] {
        let outcome = sim.mgw(&["together", "2", "velocity", "1", axis, "velocity", "6"]);
        assert!(!outcome.stdout.contains("stop"), "something was armed: {outcome:?}");
        let text = outcome.failure(1);
        assert!(text.contains(said), "{text}");
    }
}

/// The list of names, for what is unknown; the axis, for what is taken; what is allowed, otherwise.
#[test]
fn a_wrong_name_is_answered_with_what_there_is() {
    let sim = named(&[]);
    for (words, expected) in [
        (
            &["set", "lefft", "velocity", "1"][..],
            "no axis is called `lefft`; there are: left (0), prop (1)",
        ),
        (
            &["stop", "Left"],
            "nothing was stopped: no axis is called `Left`; there are: left (0), prop (1)",
        ),
        (&["raw", "left", "listen"], "no bus is called `left`; there are: arm_bus (0)"),
        (&["arm", "arm-2_B"], "no axis is called `arm-2_B`; there are: left (0), prop (1)"),
        (&["arm", "0:1"], "takes a number from 0 to 255, or a name: letters, digits, - and _"),
        (&["clear", "2nd"], "must be the number or the name of an axis, or `gateway`"),
    ] {
        let text = sim.mgw(words).failure(2);
        assert!(text.contains(expected), "{words:?}: {text}");
    }
    for word in ["", "-1", "256", "2nd", "a b", "all", "gateway", "a:1"] {
        let text = mgw(&["arm", word]).failure(2);
        assert!(!text.contains("is called"), "{word}: {text}");
    }
    for (words, expected) in [
        (&["axis", "1", "name=left"][..], "axis 0 has the name that axis 1 is given"),
        (
            &["axis", "1", "name=2nd"],
            "`2nd`: the name of axis 1 is 1 to 16 letters, digits, - and _",
        ),
        (&["axis", "1", "name=all"], "is not `all` or `gateway`"),
        (&["bus", "1", "name=arm_bus"], "bus 0 has the name that bus 1 is given"),
        (&["axis", "9", "name=far"], "it has no bus"),
        (&["gateway", "name=seventeen-letters"], "the name of the gateway is 1 to 16 letters"),
    ] {
        let text = sim.mgw_once_in_command(&[&["config"], words].concat()).failure(1);
        assert!(text.contains(expected), "{words:?}: {text}");
    }
    assert_eq!(sim.mgw(&["--json", "axes"]).json_lines()[0]["axes"][1]["name"], "prop");
}

#[test]
fn names_are_shown_beside_numbers() {
    let sim = named(&[]);
    let of = |words: &[&str]| sim.mgw(words).json_lines().remove(0);
    let info = of(&["--json", "info"]);
    assert_eq!((&info["name"], &info["buses"][0]["name"]), (&json!("arm-2_B"), &json!("arm_bus")));
    assert_eq!(info["buses"][1]["name"], Value::Null);
    assert_eq!(of(&["--json", "axes"])["axes"][1]["name"], "prop");
    assert_eq!(of(&["--json", "state", "0"])["axes"][0]["name"], "left");
    assert_eq!(of(&["--json", "state", "2"])["axes"][0]["name"], Value::Null);
    assert_eq!(of(&["--json", "watch", "left", "--count", "1"])["name"], "left");
    assert_eq!(of(&["--json", "config", "show", "left"])["name"], "left");
    assert!(sim.mgw(&["info"]).success().starts_with("name      arm-2_B\n"));
    for words in [&["axes"][..], &["state"], &["watch", "0", "1", "2", "--count", "1"]] {
        let text = sim.mgw(words).success();
        let column = text.lines().next().unwrap().find("name").unwrap_or_else(|| panic!("{text}"));
        let cell = |axis: &str| {
            let row = text.lines().find(|line| line.trim_start().starts_with(axis));
            row.unwrap_or_else(|| panic!("{text}"))[column..].split(' ').next().unwrap().to_owned()
        };
        assert_eq!([cell("0 "), cell("1 "), cell("2 ")], ["left", "prop", "-"], "{text}");
    }
    let text = sim.mgw(&["config", "show", "left"]).success();
    assert!(text.starts_with("axis 0 is called left\n"), "{text}");
}

/// The file has them, read again it is the same, and what it leaves out is taken away.
#[test]
fn a_file_gives_and_takes_names() {
    let sim = named(&[]);
    let dump = sim.mgw(&["config", "dump"]).success();
    // A busy machine has the thruster forget its timeout.
    let lines = dump.lines().filter(|line| !line.starts_with("motor_timeout_ms"));
    let dump: String = lines.map(|line| format!("{line}\n")).collect();
    for row in [
        "[gateway]\nname = \"arm-2_B\"",
        "bus = 0\nname = \"arm_bus\"",
        "axis = 0\nname = \"left\"",
    ] {
        assert!(dump.contains(row), "{dump}");
    }
    let reading = |arguments: &[&str], text: &str| {
        mgw_reading(&[&["--port", &sim.port], arguments].concat(), text)
    };
    reading(&["config", "diff", "-"], &dump).success();
    let other = dump
        .replace("name = \"left\"", "name = \"prop\"")
        .replacen("axis = 1\nname = \"prop\"", "axis = 1\nname = \"left\"", 1)
        .replace("name = \"arm_bus\"\n", "");
    let differs = reading(&["config", "diff", "-"], &other);
    for line in
        ["axis 0: name left -> prop", "axis 1: name prop -> left", "bus 0: name arm_bus -> not set"]
    {
        assert!(differs.stdout.contains(line), "{differs:?}");
    }
    reading(&["config", "apply", "-"], &other).success();
    assert_eq!(sim.mgw(&["--json", "axes"]).json_lines()[0]["axes"][0]["name"], "prop");
    let template = other.replace("name = \"prop\"", "name = \"prop\"  # the old one");
    let path = file("names.toml");
    std::fs::write(&path, &template).unwrap();
    let dump = sim.mgw(&["config", "dump", "--template", &path]).success();
    assert!(dump.contains("name = \"prop\"  # the old one\n"), "{dump}");
    assert_eq!(dump.matches("name = ").count(), 3, "{dump}");
    // Both mistakes at once, with their lines.
    let wrong = other
        .replace("axis = 1\nname = \"left\"", "axis = 1\nname = \"prop\"")
        .replace("[gateway]\nname = \"arm-2_B\"", "[gateway]\nname = \"arm 2\"");
    let text = reading(&["config", "check", "-"], &wrong).failure(1);
    for part in
        ["gateway: `arm 2`: the name of the gateway is 1 to 16", "axis 1: axis 0 has the name"]
    {
        assert!(text.contains(part), "{text}");
    }
    assert_eq!(text.matches("standard input: line").count(), 2, "{text}");
    // `--merge` leaves what it does not name.
    reading(&["config", "apply", "-", "--merge"], "[[axis]]\naxis = 0\nname = \"new\"\n").success();
    let names = &sim.mgw(&["--json", "axes"]).json_lines()[0]["axes"];
    assert_eq!((&names[0]["name"], &names[1]["name"]), (&json!("new"), &json!("left")));
}

/// What was saved runs again after a loss of power, with its names; what was not has the old ones.
#[test]
fn saved_names_outlive_a_loss_of_power() {
    let mut sim = named(&["--storage", &file("names.flash")]);
    let stored =
        |sim: &Sim| sim.mgw(&["--json", "info"]).json_lines()[0]["stored"]["differs"].clone();
    sim.mgw_once_in_command(&["config", "save"]).success();
    assert_eq!(stored(&sim), false);
    sim.mgw_once_in_command(&["config", "axis", "0", "name=lost"]).success();
    assert_eq!(stored(&sim), true);
    for typed in ["power off", "power on"] {
        sim.typed(typed);
    }
    let info = sim.mgw_once_connected(&["--json", "info"]).json_lines().remove(0);
    assert_eq!((&info["name"], &info["stored"]["differs"]), (&json!("arm-2_B"), &json!(false)));
    let axes = sim.mgw_once_connected(&["--json", "axes"]).json_lines().remove(0);
    assert_eq!(
        (&axes["axes"][0]["name"], &axes["axes"][1]["name"]),
        (&json!("left"), &json!("prop"))
    );
}
