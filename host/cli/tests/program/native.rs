//! `mgw native`: data fields of the manuals through the gateway.

use serde_json::{Value, json};

use crate::support::{self, Sim};

/// The words of a command line.
fn native(sim: &Sim, words: &str) -> crate::support::Outcome {
    sim.mgw(&[&["native"], words.split_whitespace().collect::<Vec<_>>().as_slice()].concat())
}

#[test]
fn reads_are_answered_in_the_words_of_decode() {
    let sim = Sim::start();
    for (words, command, field) in [
        // RMD V3.6 §2.13 on CAN and RS485, Thruster manual §2.1, D5 manual register 0x26.
        ("0 9C00000000000000", "read_status_2", "speed_dps"),
        ("3 9C 00 00 00 00 00 00 00", "read_status_2", "speed_dps"),
        ("0 --command read-status-2", "read_status_2", "speed_dps"),
        ("1 51560000", "read_speed", "speed_rpm"),
        ("1 --command read_speed", "read_speed", "speed_rpm"),
        ("2 D50B050226000038", "read", "speed_dps"),
        ("2 --command read --field register=current_speed --field bytes=2", "read", "speed_dps"),
    ] {
        let lines = native(&sim, &format!("{words} --json")).json_lines();
        let [line] = lines.as_slice() else { panic!("{words}: {lines:?}") };
        assert_eq!(
            (&line["command"], &line["direction"]),
            (&json!(command), &json!("reply")),
            "{words}"
        );
        assert_eq!(line["axis"].as_u64(), words.get(..1).unwrap().parse().ok(), "{words}: {line}");
        assert_eq!(line[field], 0, "{words}: {line}");
        assert!(line["frame"].as_str().is_some_and(|data| data.len() == 16), "{words}: {line}");
    }
    let text = native(&sim, "0 9C00000000000000").success();
    assert!(text.starts_with("9C19000000000000") && text.contains("temperature_c=25"), "{text}");
}

#[test]
fn what_moves_is_armed_kept_up_and_stopped() {
    let sim = Sim::patient();
    for (words, frame) in [
        ("0 --command torque_current --field current_a=1", "A1"),
        ("0 A2 00 00 00 10 27 00 00", "A2"),
        ("1 --command signal --field signal_percent=-20", "5443"),
        ("2 --command write --field register=speed --field value=600", "5D0B050320"),
        ("3 A2000000F0D8FFFF", "A2"),
    ] {
        let text = native(&sim, words).failure(2);
        assert!(text.contains("--for SECONDS"), "{words}: {text}");
        let lines = native(&sim, &format!("{words} --for 2 --json")).json_lines();
        let has = |is: &dyn Fn(&Value) -> bool| lines.iter().any(is);
        assert!(
            has(&|line| line["frame"].as_str().is_some_and(|data| data.starts_with(frame))),
            "{lines:?}"
        );
        let moved = |line: &Value| {
            line["velocity_rad_s"]["value"].as_f64().is_some_and(|speed| speed.abs() > 0.5)
        };
        assert!(has(&moved), "{words}: {lines:?}");
        assert!(has(&|line| line["event"] == "stop_confirmed"), "{words}: {lines:?}");
        let rest = if words.starts_with('1') { "idle" } else { "holding" };
        assert_eq!(lines.last().unwrap()["state"], rest, "{words}");
    }
}

/// 0xA8, 90° at 500 °/s: had it gone out twice it would have gone twice as far.
#[test]
fn what_moves_by_a_distance_goes_out_once() {
    let sim = Sim::patient();
    let text = native(&sim, "0 A800F40128230000 --for 2").success();
    assert!(
        text.contains("incremental_position") && text.ends_with("axis 0 is holding\n"),
        "{text}"
    );
    let position = sim.await_state("0", |_| true)["position_rad"]["value"].as_f64().unwrap();
    assert!((position - std::f64::consts::FRAC_PI_2).abs() < 0.05, "{position}");
}

#[test]
fn what_stops_is_a_stop_and_what_changes_the_motor_goes_to_an_idle_one() {
    let sim = Sim::patient();
    let line = &native(&sim, "0 8100000000000000 --json").json_lines()[0];
    assert_eq!((&line["command"], &line["axis"]), (&json!("stop"), &json!(0)), "{line}");
    // The motor holds now: it is changed once it has let go.
    let text = native(&sim, "0 43000000E8030000").failure(1);
    assert!(text.contains("axis 0 is holding"), "{text}");
    sim.mgw(&["output-off", "0"]).success();
    let line = &native(&sim, "0 --command read_acceleration --field index=0 --json").failure(2);
    assert!(line.contains("index"), "{line}");
    let line = &native(&sim, "0 43000000E8030000 --json").json_lines()[0];
    assert_eq!(line["command"], "write_acceleration", "{line}");
    let line = &native(&sim, "0 B3000000E8030000 --json").json_lines()[0];
    assert_eq!(line["command"], "set_communication_timeout", "{line}");
    // The gateway no longer relies on what it knew of the motor's own timeout.
    let text = sim.mgw(&["arm", "0", "--for", "0.1"]).failure(1);
    assert!(text.contains("timeout"), "{text}");
}

#[test]
fn slips_are_told_before_anything_is_sent() {
    let sim = Sim::start();
    for (words, said) in [
        ("0", "DATA"),
        ("0 9C0", "`9C0`"),
        ("0 9C zz", "`zz`"),
        ("0 3E01089C00000000000000F230", "at most 8 bytes"),
        ("0 9C00000000000000 --for 1", "this one does not"),
        ("0 9C00000000000000 --command stop", "cannot be used with"),
        ("0 --field current_a=1", "--command"),
        ("0 --command torque", "torque_current"),
        ("0 --command torque_current", "--current_a"),
        ("0 --command torque_current --field current_a", "NAME=VALUE"),
        ("0 --command motion_mode", "CAN id of its own"),
        ("0 --command read_can_id", "CAN id 300"),
        ("0 --command read_rs485_id", "RS485 id CD"),
        ("2 --command execute --for 1", "waits in the motor"),
        ("2 D50B050500000015", "waits in the motor"),
        (
            "2 --command async_write --field register=speed --field value=600 --for 1",
            "waits in the motor",
        ),
    ] {
        let text = native(&sim, words).failure(2);
        assert!(text.contains(said), "{words}: {text}");
    }
    for (words, name) in [
        ("40 9C00000000000000", "unknown_axis"),
        ("9 9C00000000000000", "not_configured"),
        ("0 FF00000000000000", "not_a_command"),
        ("2 D50C050226000039", "not_this_node"),
        ("0 --command torque_current --field current_a=400", "out_of_range"),
        // Nothing of these arms the axis.
        ("0 A200000040420F00 --for 1", "out_of_range"),
        ("0 A800000028230000 --for 1", "speed_limit_zero"),
        ("0 A300000028230000 --for 1", "cannot_check_limit"),
        ("1 4C41012CFFFFF8F9 --for 1", "unsupported"),
        ("1 54430000000000C8 --for 1", "not_a_command"),
        ("2 D50C05032058028E --for 1", "not_this_node"),
    ] {
        let text = native(&sim, &format!("{words} --json")).failure(1);
        let error = support::json(&text);
        assert_eq!(error["error"]["name"], name, "{words}: {error}");
    }
}

#[test]
fn what_is_no_command_is_told_with_its_cause() {
    let sim = Sim::start();
    for (words, cause) in [
        ("0 9C00", "2 data bytes instead of 8;"),
        ("0 FF00000000000000", "0xFF is a command that the manual does not list"),
        ("1 515600", "3 data bytes instead of 4 or 8;"),
        ("1 54430000", "4 data bytes instead of 8;"),
        ("1 58580000", "0x5858 is a command that the manual does not list"),
        ("1 5443000000000065 --for 1", "signal 101 is outside -100..=100"),
        ("2 D50B", "2 data bytes instead of 8, from D5 to the checksum;"),
        ("2 D50B050226000039", "checksum 0x39 instead of 0x38;"),
        ("2 D50B05032058028E --for 1", "checksum 0x8e instead of 0x8d;"),
        ("2 D50C050226000039", "these bytes are for node 12, and the motor of axis 2 is node 11"),
        ("2 D5FE050500000008", "for all motors"),
    ] {
        let outcome = native(&sim, words);
        assert_eq!(outcome.stdout, "", "{words}");
        let text = outcome.failure(1);
        assert!(text.contains(cause), "{words}: {text}");
    }
    let text = native(&sim, "0 --command bogus").failure(2);
    assert!(text.contains("torque_current") && !text.contains("read_can_id"), "{text}");
    assert!(!native(&sim, "2 --command bogus").failure(2).contains("execute"));
}

#[test]
fn a_stop_of_an_axis_that_is_not_idle_is_a_stop_of_the_axis() {
    let sim = Sim::patient();
    let outcome = sim.mgw_beside(&["arm", "0", "--for", "40"], "0", &["armed"], || {
        let text = sim.mgw_once_connected(&["native", "0", "8100000000000000"]).success();
        assert_eq!(text, "axis 0: carried out as a stop of the axis\n");
    });
    assert!(outcome.failure(1).contains("axis 0 was stopped by another host"));
}

/// RMD V3.6 §2.10, Thruster manual §2.2: CI and CB.
#[test]
fn what_acts_later_says_so() {
    let sim = Sim::start();
    for (words, until) in [
        ("0 --command write_position_as_zero", "a restart of the motor"),
        ("1 43 49 00 00 00 00 00 7F", "a power cycle: power-cycle the device"),
        (
            "1 --command set_bitrate --field bitrate_kbps=500",
            "a power cycle: power-cycle the device",
        ),
    ] {
        let text = native(&sim, words).success();
        assert!(text.contains(&format!("acts after {until}")), "{words}: {text}");
        let lines = native(&sim, &format!("{words} --json")).json_lines();
        assert!(
            lines
                .iter()
                .any(|line| line["message"].as_str().is_some_and(|said| said.starts_with(until)))
        );
    }
    let text = native(&sim, "0 9C00000000000000").success();
    assert!(!text.contains("acts after"), "{text}");
}
