//! `mgw encode` with literal frames, and what it refuses.

use serde_json::{Value, json};

use crate::support::mgw;

/// The words of a command line.
fn encode(words: &str) -> crate::support::Outcome {
    mgw(&[&["encode"], words.split_whitespace().collect::<Vec<_>>().as_slice()].concat())
}

#[test]
fn every_protocol_and_bus() {
    for (words, frame) in [
        // RMD V3.6 §2.17.4, §2.13, §2.20.4, §2.33.5, §5.4, §3.2, §4.4, §7.4.
        ("--protocol rmd --node 1 torque_current --current_a 1", "141#A100000064000000"),
        ("--protocol rmd --node 1 torque_current --current_a -1", "141#A10000009CFF0000"),
        ("--protocol rmd --node 1 --bus rs485 read_status_2", "3E01089C00000000000000F230"),
        (
            "--protocol rmd --node 1 absolute_position --max_speed_dps 500 --angle_deg -360",
            "141#A400F4016073FFFF",
        ),
        ("--protocol rmd --node 1 set_can_id_filter --enabled on", "141#2002000001000000"),
        (
            "--protocol rmd --node 1 motion_mode --position_rad 10 --velocity_rad_s 1 --kp 10 --kd 1 --torque_nm 10",
            "401#E66682E052333B55",
        ),
        ("--protocol rmd --node all shutdown", "280#8000000000000000"),
        ("--protocol rmd --node all --bus rs485 shutdown", "3ECD088000000000000000366A"),
        ("--protocol rmd read_can_id", "300#7900010000000000"),
        ("--protocol rmd --bus rs485 set_rs485_id --id 2", "3ECD0879000000000000027885"),
        // Thruster manual §1.3, §2.1, §2.3, §4.1.
        ("--protocol thruster --node 11 signal --signal_percent -5", "30B#544300000000FFFB"),
        ("--protocol thruster --node 11 read_speed", "30B#51560000"),
        ("--protocol thruster --node 0x0B set_timeout --timeout_ms 5000", "30B#5354000000001388"),
        (
            "--protocol thruster --node 11 absolute_position --speed_rpm 300 --angle_deg -179.9",
            "30B#4C41012CFFFFF8F9",
        ),
        // D5 manual, common rows 2 and 3, quick start (2) and (4), row 7.
        ("--protocol d5 --node 11 write --register speed --value 600", "00B#D50B05032058028D"),
        ("--protocol d5 --node 11 write --register 0x20 --speed_dps -600", "00B#D50B05032058820D"),
        (
            "--protocol d5 --node 11 --bus serial write --register ack_level --value 1",
            "D50B040310010023",
        ),
        // Both by one frame, table row 7 and frame format; each is checked by its own range.
        (
            "--protocol d5 --node 11 write --register acceleration --acceleration 100 --deceleration 120",
            "00B#D50B050315647804",
        ),
        ("--protocol d5 --node all execute", "0FE#D5FE050500000008"),
        (
            "--protocol d5 --node 11 --can-id 181 read --register acceleration --bytes 2",
            "181#D50B050215000027",
        ),
        ("--protocol d5 --node 11 --can-id 18FF0B00 query_id", "18FF0B00#D50B050100000011"),
        // Options may come later, names with either dash, values after `=`.
        ("torque-current --current-a=1 --node 1 --protocol rmd --bus can", "141#A100000064000000"),
    ] {
        assert_eq!(encode(words).success(), format!("{frame}\n"), "{words}");
    }
    let line = encode("--protocol rmd --node 1 stop --json").json_lines().remove(0);
    let expected =
        json!({ "frame": "141#8100000000000000", "protocol": "rmd", "node": 1, "command": "stop" });
    assert_eq!(line, expected);
}

#[test]
fn values_outside_their_range_are_refused_by_name_with_the_range() {
    for (words, field, range) in [
        (
            "--protocol rmd --node 1 torque_current --current_a 327.68",
            "current_a",
            Some((-327.68, 327.67)),
        ),
        (
            "--protocol rmd --node 1 torque_current --current_a nan",
            "current_a",
            Some((-327.68, 327.67)),
        ),
        ("--protocol rmd --node 33 stop", "node", Some((1.0, 32.0))),
        (
            "--protocol rmd --node 1 write_acceleration --index 0 --acceleration_dps2 99",
            "acceleration_dps2",
            Some((100.0, 60000.0)),
        ),
        ("--protocol rmd --node 1 set_baud_rate --baud_code 2", "baud_code", Some((0.0, 1.0))),
        (
            "--protocol rmd --node 1 write_acceleration --index 1.5 --acceleration_dps2 100",
            "index",
            None,
        ),
        ("--protocol rmd --node 1 --bus rs485 read_can_id", "command", None),
        (
            "--protocol rmd --node 1 motion_mode --position_rad 12.6 --velocity_rad_s 0 --kp 0 --kd 0 --torque_nm 0",
            "position_rad",
            Some((-12.5, 12.5)),
        ),
        (
            "--protocol thruster --node 11 signal --signal_percent 101",
            "signal_percent",
            Some((-100.0, 100.0)),
        ),
        ("--protocol thruster --node 11 speed --speed_rpm 29", "speed", None),
        (
            "--protocol thruster --node 11 set_timeout --timeout_ms 99",
            "timeout",
            Some((100.0, 60000.0)),
        ),
        ("--protocol thruster --node 128 read_speed", "node", Some((1.0, 127.0))),
        (
            "--protocol d5 --node 11 write --register speed --value 32768",
            "value",
            Some((-32767.0, 32767.0)),
        ),
        (
            "--protocol d5 --node 11 write --register speed --speed_dps -32768",
            "speed_dps",
            Some((-32767.0, 32767.0)),
        ),
        ("--protocol d5 --node 11 write --register current_speed --value 0", "register", None),
        ("--protocol d5 --node 11 write --register 0x21 --value 0", "register", None),
        ("--protocol d5 --node all write --register speed --value 0", "node", None),
    ] {
        let text = encode(words).failure(1);
        assert!(text.starts_with(&format!("mgw: {field} ")), "{words}: {text}");
        let text = encode(&format!("{words} --json")).failure(1);
        let error = serde_json::from_str::<Value>(&text).unwrap()["error"].clone();
        assert_eq!(error["field"], field, "{words}: {error}");
        match range {
            Some((min, max)) => {
                assert_eq!(
                    (&error["name"], &error["min"], &error["max"]),
                    (&"OutOfRange".into(), &min.into(), &max.into())
                );
            }
            None => {
                assert!(error["name"] == "Forbidden" || error["name"] == "NotAnInteger", "{error}")
            }
        }
    }
}

#[test]
fn slips_are_answered_with_what_there_is() {
    for (words, said) in [
        (
            "--protocol rmd --node 1 torque",
            &["`torque`", "torque_current", "read_status_2", "set_can_id"][..],
        ),
        ("--protocol rmd --node 1 timeout_notice", &["`timeout_notice`", "torque_current"]),
        ("--protocol thruster --node 1 stream_1", &["`stream_1`", "configure_stream"]),
        (
            "--protocol rmd --node 1 torque_current --speed 1",
            &["`speed`", "--current_a -327.68..=327.67 A"],
        ),
        ("--protocol rmd --node 1 stop --speed 1", &["`speed`", "no fields"]),
        ("--protocol rmd --node 1 torque_current", &["needs --current_a", "-327.68..=327.67 A"]),
        ("--protocol rmd --node 1 torque_current --current_a", &["no value"]),
        (
            "--protocol rmd --node 1 torque_current --current_a much",
            &["--current_a much", "not a number"],
        ),
        ("--protocol rmd --node 1 torque_current 7", &["`7`", "--FIELD VALUE"]),
        ("--protocol rmd torque_current --current_a 1", &["--node"]),
        ("--protocol rmd --node one stop", &["`one`"]),
        ("--protocol rmd --node 1", &["--list"]),
        ("--node 1 stop", &["--protocol"]),
        ("stop --protocol can", &["rmd or thruster or d5", "`can`"]),
        ("--protocol rmd --can-id 123 --node 1 stop", &["d5"]),
        ("--protocol d5 --can-id 800 --node 1 query_id", &["`800`", "7FF"]),
        ("--protocol thruster --bus rs485 --node 1 read_speed", &["serial"]),
        ("--protocol thruster --node all read_speed", &["--node"]),
        (
            "--protocol d5 --node 11 write --register speed --angle_deg 1",
            &["`angle_deg`", "--value"],
        ),
    ] {
        let text = encode(words).failure(2);
        for part in said {
            assert!(text.contains(part), "{words}: {text}");
        }
    }
}

#[test]
fn the_list_has_every_command_with_fields_units_and_ranges() {
    let text = encode("--protocol rmd --list").success();
    for line in [
        "torque_current  0xA1  RMD V3.6 §2.17",
        "    --current_a             -327.68..=327.67 A, step 0.01",
        "    reply: temperature_c, current_a, speed_dps, angle_deg",
    ] {
        assert!(text.lines().any(|listed| listed == line), "{line}\n{text}");
    }
    assert!(
        encode("--protocol thruster --list")
            .success()
            .contains("--timeout_ms            0..=60000 ms")
    );
    assert!(
        encode("--list --protocol d5").success().contains("   0x20  speed              speed_dps")
    );
    for (protocol, commands) in [
        ("rmd", rmd::COMMANDS.len()),
        ("thruster", thruster::COMMANDS.len()),
        ("d5", d5::COMMANDS.len() + d5::REGISTERS.len()),
    ] {
        let lines = encode(&format!("--protocol {protocol} --list --json")).json_lines();
        assert_eq!(lines.len(), commands, "{protocol}");
    }
}

#[test]
fn refusals_name_what_is_allowed() {
    for (words, code, said) in [
        (
            "--protocol rmd --node 1 --bus rs485 motion_mode --position_rad 0 --velocity_rad_s 0 --kp 0 --kd 0 --torque_nm 0",
            1,
            "command motion_mode is refused",
        ),
        ("--protocol thruster --node 11 set_bitrate --bitrate_kbps 70", 1, "1000, 800, 666, 500"),
        ("--protocol thruster --node 11 set_bitrate --bitrate_kbps 7", 1, "33, 20, 10 kbit/s"),
        (
            "--protocol thruster --node 11 set_timeout --timeout_ms 50",
            1,
            "0, which is off, and 100..=60000 ms",
        ),
        (
            "--protocol thruster --node 11 set_timeout --timeout_ms 61000",
            1,
            "0, which is off, and 100..=60000 ms",
        ),
        (
            "--protocol rmd --node 1 torque_current --current_a 1 --current-a 2",
            2,
            "`current_a` is given twice",
        ),
        (
            "--protocol d5 --node 11 write --register speed --value 6 --speed_dps 7",
            2,
            "under two names",
        ),
    ] {
        let text = encode(words).failure(code);
        assert!(text.contains(said), "{words}: {text}");
    }
}
