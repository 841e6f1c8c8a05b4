//! `mgw config`: the configuration as one thing.

use crate::support::{FOUR, Sim, mgw, mgw_reading};
use serde_json::Value;

/// Has the program read this from standard input.
fn reading(sim: &Sim, arguments: &[&str], text: &str) -> crate::support::Outcome {
    mgw_reading(&[&["--port", &sim.port], arguments].concat(), text)
}

fn four_motors() -> String {
    std::fs::read_to_string(FOUR).unwrap()
}

fn parameter(sim: &Sim, axis: &str, name: &str) -> Value {
    sim.mgw(&["--json", "config", "show", axis]).json_lines()[0]["parameters"][name].clone()
}

/// What a file does not name has its default, unsafe flags above all.
#[test]
fn an_unsafe_flag_does_not_survive_a_file_that_does_not_name_it() {
    let sim = Sim::start();
    sim.mgw(&["config", "axis", "0", "unsafe_infinite_ttl=true", "ttl_us=50000"]).success();
    sim.mgw(&["config", "axis", "7", "bus=0", "protocol=rmd", "node=7", "stop_action=hold"])
        .success();
    sim.mgw(&["config", "gateway", "link_silence_us=9000000"]).success();
    // Merged it survives, as it was asked to.
    let merge = "[[axis]]\naxis = 0\nttl_us = 60_000\n";
    reading(&sim, &["config", "apply", "-", "--merge"], merge).success();
    assert_eq!(parameter(&sim, "0", "unsafe_infinite_ttl"), true);
    assert_eq!(parameter(&sim, "0", "ttl_us"), 60_000);
    sim.mgw(&["config", "apply", FOUR]).success();
    assert_eq!(parameter(&sim, "0", "unsafe_infinite_ttl"), false);
    assert_eq!(parameter(&sim, "0", "ttl_us"), 100_000);
    assert_eq!(sim.mgw(&["--json", "axes"]).json_lines()[0]["axes"].as_array().unwrap().len(), 4);
    let dump = sim.mgw(&["config", "dump"]).success();
    assert!(dump.contains("link_silence_us = 250000"), "{dump}");
}

#[test]
fn a_file_with_two_motors_of_one_node_changes_nothing_and_the_good_one_applies() {
    let sim = Sim::start();
    let before = sim.mgw(&["config", "dump"]).success();
    let twice = four_motors().replace("axis = 3\nbus = 2", "axis = 3\nbus = 0");
    let text = reading(&sim, &["config", "apply", "-"], &twice).failure(1);
    assert!(text.contains("standard input: line "), "{text}");
    assert!(text.contains("axis 3: axis 0 has this bus and node"), "{text}");
    assert_eq!(sim.mgw(&["config", "dump"]).success(), before);
    // An exchange of the nodes of two axes needs a moment at which both have the same.
    let exchanged = four_motors().replace(
        "node = 1\nstop_action = \"hold\"\nvelocity_limit_rad_s = 30.0\n\
        motor_timeout_ms = 300\n\n#",
        "node = 2\nstop_action = \"hold\"\n\n#",
    );
    let fifth = "[[axis]]\naxis = 5\nbus = 0\nprotocol = \"rmd\"\nnode = ";
    let hold = "\nstop_action = \"hold\"\n";
    reading(&sim, &["config", "apply", "-"], &format!("{}{fifth}2{hold}", four_motors())).success();
    reading(&sim, &["config", "apply", "-"], &format!("{exchanged}{fifth}1{hold}")).success();
    assert_eq!((parameter(&sim, "0", "node"), parameter(&sim, "5", "node")), (2.into(), 1.into()));
    sim.mgw(&["config", "apply", FOUR]).success();
    assert_eq!(sim.mgw(&["config", "dump"]).success(), before);
}

/// All at once, each with its line, and nothing is sent.
#[test]
fn duplicates_and_what_is_missing_are_told_together() {
    let sim = Sim::with(&["--unconfigured"]);
    let text = four_motors()
        .replace("stop_action = \"coast\"\n", "")
        .replace("axis = 2\n", "axis = 0\n")
        .replace("ttl_us = 500_000\n", "ttl_us = 500_000\nttl_us = 50_000\n");
    let line = |wanted: &str, nth: usize| {
        let lines = text.lines().enumerate().filter(|(_, line)| line.starts_with(wanted));
        lines.map(|(index, _)| index + 1).nth(nth).unwrap()
    };
    let error = reading(&sim, &["--json", "config", "apply", "-"], &text).failure(1);
    let error: Value = serde_json::from_str(&error).unwrap();
    let findings: Vec<(Value, Value, Value)> = error["error"]["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|finding| ["line", "axis", "key"].map(|field| finding[field].clone()).into())
        .collect();
    let expected = [
        (line("axis = 1", 0).into(), 1.into(), "stop_action".into()),
        (line("axis = 0", 1).into(), 0.into(), "axis".into()),
        (line("ttl_us", 1).into(), Value::Null, Value::Null),
    ];
    assert_eq!(findings, expected, "{error}");
    assert!(sim.mgw(&["axes"]).success().contains("no axis is configured"));
}

/// What is printed makes the same gateway again, and is printed by it again.
#[test]
fn a_dump_that_is_applied_is_dumped_again() {
    let sim = Sim::start();
    sim.mgw(&["config", "axis", "2", "d5_reply_id=extended:0x12345678", "limit_margin=0.15"])
        .success();
    let dump = sim.mgw(&["config", "dump"]).success();
    assert_eq!(reading(&sim, &["config", "diff", "-"], &dump).success(), "");
    let nothing = reading(&sim, &["config", "apply", "-"], &dump).success();
    assert!(nothing.contains("; 0 changes, 0 motor timeouts written"), "{nothing}");
    sim.mgw(&["config", "reset"]).success();
    assert!(sim.mgw(&["axes"]).success().contains("no axis is configured"));
    let bus = &sim.mgw(&["--json", "bus", "0"]).json_lines()[0]["buses"][0];
    assert_eq!((&bus["config"], &bus["state"]), (&Value::Null, &"unconfigured".into()));
    reading(&sim, &["config", "apply", "-"], &dump).success();
    assert_eq!(sim.mgw(&["config", "dump"]).success(), dump);
    assert!(
        sim.mgw(&["set", "0", "velocity", "2", "--for", "0.2"]).success().contains("confirmed")
    );
}

/// It would be there and could do nothing, and its dump would be no file that can be applied.
#[test]
fn an_axis_that_lacks_what_it_needs_is_refused_with_all_of_it() {
    let sim = Sim::start();
    let before = sim.mgw(&["config", "dump"]).success();
    let text = sim.mgw(&["config", "axis", "9", "velocity_limit_rad_s=3"]).failure(1);
    assert!(text.contains("axis 9 lacks bus, protocol, node, stop_action; give all"), "{text}");
    let text = sim.mgw(&["config", "axis", "9", "bus=0", "protocol=rmd", "node=9"]).failure(1);
    assert!(text.contains("axis 9 lacks stop_action; give all"), "{text}");
    let there = ["config", "axis", "9", "protocol=rmd", "node=9", "stop_action=hold"];
    let text = sim.mgw(&[&there[..], &["bus=3"]].concat()).failure(1);
    assert!(text.contains("bus 3 of axis 9 is not configured; do that first"), "{text}");
    let text = sim.mgw(&[&there[..], &["bus=6"]].concat()).failure(1);
    assert!(text.contains("there is no bus 6; buses are numbered below 4"), "{text}");
    assert_eq!(sim.mgw(&["config", "dump"]).success(), before);
}

/// Another program may leave such an axis, and a bus that carries raw frames only.
#[test]
fn what_is_incomplete_says_so_in_a_file() {
    let sim = Sim::start();
    let text = "[[bus]]\nbus = 1\nbitrate = 500_000\nprotocols = []\n\n[[axis]]\naxis = 9\n\
                incomplete = true\nbus = 2\nvelocity_limit_rad_s = 3.0\n";
    reading(&sim, &["config", "apply", "-"], text).success();
    let dump = sim.mgw(&["config", "dump"]).success();
    assert!(dump.contains("axis = 9\nincomplete = true\nbus = 2\n"), "{dump}");
    assert!(reading(&sim, &["config", "apply", "-"], &dump).success().contains("; 0 changes"));
    sim.mgw(&["config", "bus", "1", "exclusive=true"]).success();
    let more =
        "[[axis]]\naxis = 1\nbus = 1\nprotocol = \"rmd\"\nnode = 1\nstop_action = \"hold\"\n";
    let merge = ["config", "apply", "-", "--merge"];
    let told = reading(&sim, &merge, more).failure(1);
    assert!(told.contains("line 4, axis 1: bus 1 is not configured for rmd"), "{told}");
    reading(&sim, &merge, &more.replace("bus = 1", "bus = 1\nincomplete = false")).failure(1);
    let more = format!("[[bus]]\nbus = 1\nprotocols = [\"rmd\"]\n{more}");
    reading(&sim, &merge, &more).success();
}

/// What comes from a command that has failed is no wish to remove everything.
#[test]
fn an_empty_file_is_refused_and_removes_nothing() {
    let sim = Sim::start();
    let before = sim.mgw(&["config", "dump"]).success();
    for (text, arguments) in [
        ("", &["config", "apply", "-"][..]),
        ("# mgw: no gateway\n", &["config", "apply", "-"]),
        ("\n", &["config", "apply", "-", "--merge"]),
        ("", &["config", "diff", "-"]),
        ("", &["config", "check", "-"]),
    ] {
        let said = reading(&sim, arguments, text).failure(2);
        let wanted = "standard input: it has no section, [gateway], [[bus]] or [[axis]]; `mgw \
                      config reset` removes everything";
        assert!(said.contains(wanted), "{said}");
    }
    mgw_reading(&["config", "check", "-"], "").failure(2);
    mgw_reading(&["plan", "-"], "").failure(2);
    assert_eq!(sim.mgw(&["config", "dump"]).success(), before);
}

/// More than one list of changes holds: what can be done is said.
#[test]
fn a_configuration_of_more_settings_than_change_at_once_is_taken_away_axis_by_axis() {
    let sim = Sim::with(&["--unconfigured"]);
    let axis = |axis| {
        format!(
            "[[axis]]\naxis = {axis}\nincomplete = true\nrefresh_us = 500_000\nmissed_replies = 4\n\
             fault_poll_us = 1_000_000\nstate_poll_us = 1_000_000\nstandstill_rad_s = 0.2\n\
             stops_before_unreachable = 9\nstop_repeat_us = 600_000\ndirection = -1\n\
             ttl_us = 60_000\nlimit_margin = 0.2\nwarnings_are_faults = true\ntrip_group = 2\n"
        )
    };
    let merge = ["config", "apply", "-", "--merge"];
    for half in [0..16, 16..32] {
        reading(&sim, &merge, &half.map(axis).collect::<String>()).success();
    }
    let text = sim.mgw(&["config", "reset"]).failure(1);
    assert!(text.contains("in several steps: `mgw config remove AXIS`"), "{text}");
    assert_eq!(text.to_lowercase().matches("nothing was changed").count(), 1, "{text}");
    for axis in 0..4 {
        sim.mgw_once_in_command(&["config", "remove", &axis.to_string()]).success();
    }
    sim.once("config reset").success();
}

/// As it says everywhere else.
#[test]
fn a_change_that_a_holding_axis_bars_names_the_way_out() {
    let sim = Sim::patient();
    sim.mgw_once_in_command(&["stop", "0"]).success();
    let text = sim.once("config reset").failure(1);
    let way = "switch its motor's output off first: `mgw output-off 0`. Nothing was changed";
    assert!(text.contains(way), "{text}");
}

#[test]
fn a_difference_is_shown_and_is_an_exit_code() {
    let sim = Sim::start();
    let other = four_motors()
        .replace("ttl_us = 500_000", "ttl_us = 50_000")
        .replace("stop_action = \"coast\"\nsignal_limit = 0.5", "stop_action = \"coast\"");
    let outcome = reading(&sim, &["config", "diff", "-"], &other);
    assert_eq!(
        outcome.stdout,
        "axis 1: signal_limit 0.5 -> not set\naxis 3: ttl_us 500000 µs -> 50000 µs\n"
    );
    assert!(outcome.failure(1).contains("2 settings other than standard input"));
    assert_eq!(sim.mgw(&["config", "diff", FOUR]).success(), "");
    let checked = reading(&sim, &["config", "apply", "-", "--check"], &other).success();
    assert_eq!(checked, "standard input: 3 buses and 4 axes; 2 changes\n");
    assert_eq!(parameter(&sim, "3", "ttl_us"), 500_000);
    sim.mgw(&["config", "unset", "axis", "3", "ttl_us"]).success();
    assert_eq!(parameter(&sim, "3", "ttl_us"), 100_000);
    let like = sim.mgw(&["config", "dump", "--template", FOUR]).success();
    assert_eq!(like, four_motors().replace("ttl_us = 500_000\n", ""));
    let text = sim.mgw(&["config", "unset", "axis", "3", "stop_action"]).failure(1);
    assert!(
        text.contains("axis 3 lacks stop_action") && text.contains("Nothing was changed"),
        "{text}"
    );
}

/// What can be known without a gateway, and what it says it has not looked at.
#[test]
fn a_file_is_checked_without_a_gateway() {
    for arguments in [&["config", "check", FOUR][..], &["config", "apply", FOUR, "--check"]] {
        let text = mgw(arguments).success();
        assert!(text.contains("3 buses and 4 axes") && text.contains("Add --port"), "{text}");
    }
    let text = mgw_reading(&["config", "check", "-"], "[[axis]]\naxis = 0\n[[bus]\n").failure(1);
    for said in [
        "line 2, axis 0: lacks stop_action; it takes coast, hold, brake",
        "line 3, unclosed array table",
        "line 3, bus: lacks its number",
    ] {
        assert!(text.contains(said), "{text}");
    }
    mgw(&["config", "check", FOUR, "--merge"]).failure(2);
    let schema: Value = serde_json::from_str(&mgw(&["config", "schema"]).success()).unwrap();
    assert_eq!(schema["properties"]["axis"]["items"]["required"][0], "axis");
}

/// An e-stop has stopped the axes, which are not at rest then.
#[test]
fn nothing_of_a_list_is_made_where_one_of_its_axes_is_not_at_rest() {
    let sim = Sim::patient();
    let before = sim.mgw(&["config", "dump"]).success();
    sim.mgw(&["estop"]).success();
    let text = sim.mgw(&["config", "reset"]).failure(1);
    assert!(text.contains("Nothing was changed"), "{text}");
    assert_eq!(sim.mgw(&["config", "dump"]).success(), before);
}

/// Its manual does not say that it keeps the time without power: arming writes it again.
#[test]
fn a_dump_keeps_the_timeout_of_a_thruster_that_was_not_heard_for_a_while() {
    let sim = Sim::start();
    std::thread::sleep(std::time::Duration::from_millis(1_500));
    let dump = sim.mgw(&["config", "dump"]).success();
    assert_eq!(dump.matches("motor_timeout_ms = ").count(), 3, "{dump}");
}

/// 12 parameters each, and 352 changes fit in a list: what is there already is none.
#[test]
fn a_check_counts_changes_as_the_gateway_does() {
    let axes = |count: u32| {
        let axis = |axis| {
            format!(
                "[[axis]]\naxis = {axis}\nbus = 0\nprotocol = \"rmd\"\nnode = {}\n\
                 stop_action = \"hold\"\nrefresh_us = 500_000\nfault_poll_us = 1_000_000\n\
                 state_poll_us = 1_000_000\nmissed_replies = 4\nstandstill_rad_s = 0.2\n\
                 stops_before_unreachable = 9\nstop_repeat_us = 600_000\ndirection = -1\n",
                axis + 1
            )
        };
        let bus = "[[bus]]\nbus = 0\nbitrate = 1_000_000\nprotocols = [\"rmd\"]\n".to_owned();
        (0..count).map(axis).fold(bus, |text, axis| text + &axis)
    };
    const TOO_MANY: &str = "more than 352 parameters of axes";
    let check = |count| mgw_reading(&["config", "check", "-"], axes(count));
    check(29).success();
    let told = check(30).failure(1);
    assert!(told.contains(TOO_MANY), "{told}");
    mgw_reading(&["plan", "-"], axes(30)).success();
    let sim = Sim::start();
    let told = reading(&sim, &["config", "check", "-"], &axes(30)).failure(1);
    assert!(told.contains(TOO_MANY), "{told}");
    reading(&sim, &["config", "apply", "-"], &axes(20)).success();
    reading(&sim, &["config", "check", "-"], &axes(30)).success();
}
