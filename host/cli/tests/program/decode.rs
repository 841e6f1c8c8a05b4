//! `mgw decode` with literal input and output.

use std::fmt::Write;

use serde_json::Value;

use crate::support::{mgw, mgw_cut_short, mgw_reading};

/// Asserts what `--json` prints for each line of input, without the texts for people.
#[track_caller]
fn expect(arguments: &[&str], rows: &[(&str, &str)]) {
    let input: String = rows.iter().fold(String::new(), |all, (line, _)| all + line + "\n");
    let output = mgw_reading(&[&["decode", "--json"], arguments].concat(), input).success();
    let lines: Vec<String> = output.lines().map(without_message).collect();
    let expected: Vec<&str> =
        rows.iter().flat_map(|(_, lines)| lines.lines().map(str::trim)).collect();
    assert_eq!(lines, expected);
}

/// A line without its `message`, which is always the last field and not for programs.
fn without_message(line: &str) -> String {
    serde_json::from_str::<Value>(line).unwrap_or_else(|error| panic!("{error}: {line}"));
    match line.split_once(r#","message":"#) {
        Some((rest, message)) => {
            assert!(message.len() > 10, "{line}");
            format!("{rest}}}")
        }
        None => line.to_owned(),
    }
}

#[test]
fn rmd_on_can() {
    expect(
        &["--protocol", "rmd"],
        &[
            (
                "(1700000000.000000) can0 141#A100000064000000",
                r#"{"time_s":1700000000.000000,"interface":"can0","frame":"141#A100000064000000","direction":"request","protocol":"rmd","node":1,"command":"torque_current","current_a":1}"#,
            ),
            (
                "(1700000000.000321) can0 241#A1326400F4012D00",
                r#"{"time_s":1700000000.000321,"interface":"can0","frame":"241#A1326400F4012D00","direction":"reply","protocol":"rmd","node":1,"command":"torque_current","temperature_c":50,"current_a":1,"speed_dps":500,"angle_deg":45}"#,
            ),
            // Several faults at once and two bits without a name.
            (
                "241#9afb0000f0001390",
                r#"{"frame":"241#9AFB0000F0001390","direction":"reply","protocol":"rmd","node":1,"command":"read_status_1","temperature_c":-5,"brake_released":false,"voltage_v":24,"faults":["stall","phase_over_current","motor_over_temperature"],"faults_raw":36883}"#,
            ),
            (
                "260#92000000FFFFFFFF",
                r#"{"frame":"260#92000000FFFFFFFF","direction":"reply","protocol":"rmd","node":32,"command":"read_multi_turn_angle","angle_deg":-0.01}"#,
            ),
            (
                "401#E66682E052333B55",
                r#"{"frame":"401#E66682E052333B55","direction":"request","protocol":"rmd","node":1,"command":"motion_mode","position_rad":9.999847412109375,"velocity_rad_s":1.0219780219780148,"kp":10.012210012210014,"kd":1,"torque_nm":10.004395604395604}"#,
            ),
            (
                "280#8100000000000000",
                r#"{"frame":"280#8100000000000000","direction":"request","protocol":"rmd","node":"all","command":"stop"}"#,
            ),
            (
                "241#B558385332563130",
                r#"{"frame":"241#B558385332563130","direction":"reply","protocol":"rmd","node":1,"command":"read_model","model":"X8S2V10"}"#,
            ),
            (
                "241#F1",
                r#"{"frame":"241#F1","direction":"event","protocol":"rmd","node":1,"command":"timeout_notice","data":""}"#,
            ),
        ],
    );
}

/// The reply of an id command has the id of its request (RMD V3.6 §4.4).
#[test]
fn rmd_id_commands_take_turns() {
    expect(
        &[],
        &[
            (
                "300#7900010000000000",
                r#"{"frame":"300#7900010000000000","direction":"request","protocol":"rmd","node":"all","command":"read_can_id"}"#,
            ),
            (
                "300#7900010000004202",
                r#"{"frame":"300#7900010000004202","direction":"reply","protocol":"rmd","node":2,"command":"read_can_id","id":2}"#,
            ),
            (
                "300#7900000000000002",
                r#"{"frame":"300#7900000000000002","direction":"request","protocol":"rmd","node":"all","command":"set_can_id","id":2}"#,
            ),
            (
                "300#7900000000000002",
                r#"{"frame":"300#7900000000000002","direction":"reply","protocol":"rmd","node":2,"command":"set_can_id","id":2}"#,
            ),
        ],
    );
    expect(
        &["--direction", "reply"],
        &[(
            "300#7900000000000002",
            r#"{"frame":"300#7900000000000002","direction":"reply","protocol":"rmd","node":2,"command":"set_can_id","id":2}"#,
        )],
    );
}

/// A closed-loop reply equal to its request has no state in it.
#[test]
fn rmd_commands_thrown_back_are_not_taken_for_states() {
    expect(
        &[],
        &[
            (
                "141#A200000010270000",
                r#"{"frame":"141#A200000010270000","direction":"request","protocol":"rmd","node":1,"command":"velocity","speed_dps":100}"#,
            ),
            (
                "141#9C00000000000000",
                r#"{"frame":"141#9C00000000000000","direction":"request","protocol":"rmd","node":1,"command":"read_status_2"}"#,
            ),
            (
                "241#A200000010270000",
                r#"{"frame":"241#A200000010270000","direction":"reply","protocol":"rmd","node":1,"command":"velocity","not_executed":true}"#,
            ),
            (
                "241#9C326400F4012D00",
                r#"{"frame":"241#9C326400F4012D00","direction":"reply","protocol":"rmd","node":1,"command":"read_status_2","temperature_c":50,"current_a":1,"speed_dps":500,"angle_deg":45}"#,
            ),
            // A fault that nobody has asked about.
            (
                "241#9A320001E5010400",
                r#"{"frame":"241#9A320001E5010400","direction":"event","protocol":"rmd","node":1,"command":"read_status_1","temperature_c":50,"brake_released":true,"voltage_v":48.5,"faults":["under_voltage"],"faults_raw":4}"#,
            ),
        ],
    );
}

/// RS485 says nothing of directions: what follows its own request is a reply, what has the form of
/// a request is one.
#[test]
fn rmd_on_rs485() {
    let request = r#"{"frame":"3E01089C00000000000000F230","direction":"request","protocol":"rmd","node":1,"command":"read_status_2"}"#;
    let reply = r#"{"frame":"3E01089C1934129CFF78567AD8","direction":"reply","protocol":"rmd","node":1,"command":"read_status_2","temperature_c":25,"current_a":46.6,"speed_dps":-100,"angle_deg":22136}"#;
    let both = format!("{request}\n{reply}");
    let garbage = format!(
        "{{\"frame\":\"EE\",\"error\":\"garbage\"}}\n{both}\n{{\"frame\":\"3E9C0100DB\",\"error\":\"garbage\"}}"
    );
    expect(
        &["--protocol", "rmd", "--bus", "rs485"],
        &[
            ("3E01089C00000000000000F230", request),
            ("3e 01 08 9c 19 34 12 9c ff 78 56 7a d8", reply),
            // Two frames in a line, then frame and garbage over several lines.
            ("3E01089C00000000000000F230 3E01089C1934129CFF78567AD8", &both),
            (
                "EE 3E01089C00000000000000F230 3E01089C1934",
                &format!("{{\"frame\":\"EE\",\"error\":\"garbage\"}}\n{request}"),
            ),
            ("129CFF78567AD8", reply),
            ("EE 3E01089C00000000000000F230 3E01089C1934129CFF78567AD8 3E9C0100DB", &garbage),
            // A stop and its echo have the same bytes.
            (
                "3E0108810000000000000032A5",
                r#"{"frame":"3E0108810000000000000032A5","direction":"request","protocol":"rmd","node":1,"command":"stop"}"#,
            ),
            (
                "3E0108810000000000000032A5",
                r#"{"frame":"3E0108810000000000000032A5","direction":"reply","protocol":"rmd","node":1,"command":"stop"}"#,
            ),
            // A setpoint has its unused bytes zero, a state has a temperature.
            (
                "3E0108A100000064000000 2F8D",
                r#"{"frame":"3E0108A1000000640000002F8D","direction":"request","protocol":"rmd","node":1,"command":"torque_current","current_a":1}"#,
            ),
            (
                "3ECD088000000000000000366A",
                r#"{"frame":"3ECD088000000000000000366A","direction":"request","protocol":"rmd","node":"all","command":"shutdown"}"#,
            ),
            (
                "3E02088000000000000000 0366",
                r#"{"frame":"3E020880000000000000000366","direction":"reply","protocol":"rmd","node":2,"command":"shutdown"}"#,
            ),
            (
                "3ECD0879000100000000027954",
                r#"{"frame":"3ECD0879000100000000027954","direction":"reply","protocol":"rmd","node":2,"command":"read_rs485_id","id":2}"#,
            ),
        ],
    );
    expect(
        &["--direction", "reply"],
        &[(
            "3E01089C00000000000000F230",
            r#"{"frame":"3E01089C00000000000000F230","direction":"reply","protocol":"rmd","node":1,"command":"read_status_2","temperature_c":0,"current_a":0,"speed_dps":0,"angle_deg":0}"#,
        )],
    );
    expect(
        &["--direction", "request"],
        &[(
            "3E01089C1934129CFF78567AD8",
            r#"{"frame":"3E01089C1934129CFF78567AD8","direction":"request","protocol":"rmd","node":1,"command":"read_status_2"}"#,
        )],
    );
}

#[test]
fn thrusters() {
    expect(
        &["--protocol", "thruster", "--bus", "can"],
        &[
            (
                "can1 30B#544300000000FFFB",
                r#"{"interface":"can1","frame":"30B#544300000000FFFB","direction":"request","protocol":"thruster","node":11,"command":"signal","signal_percent":-5}"#,
            ),
            (
                "can1 28B#544300000000EEEE",
                r#"{"interface":"can1","frame":"28B#544300000000EEEE","direction":"reply","protocol":"thruster","node":11,"command":"signal","refused":true}"#,
            ),
            (
                "28B#4652000000004012",
                r#"{"frame":"28B#4652000000004012","direction":"reply","protocol":"thruster","node":11,"command":"read_fault_record","faults":["ee_data","under_voltage"],"faults_raw":16402}"#,
            ),
            (
                "28B#410103E800F0000A",
                r#"{"frame":"28B#410103E800F0000A","direction":"event","protocol":"thruster","node":11,"command":"stream_1","speed_rpm":1000,"voltage_v":24,"current_a":1}"#,
            ),
            // A speed that answers, then, in the medium speed mode, one that comes by itself.
            (
                "28B#515600000000FA24",
                r#"{"frame":"28B#515600000000FA24","direction":"reply","protocol":"thruster","node":11,"command":"read_speed","speed_rpm":-1500}"#,
            ),
            (
                "30B#4D4D0000",
                r#"{"frame":"30B#4D4D0000","direction":"request","protocol":"thruster","node":11,"command":"medium_speed_mode"}"#,
            ),
            (
                "28B#515600000000FA24",
                r#"{"frame":"28B#515600000000FA24","direction":"event","protocol":"thruster","node":11,"command":"read_speed","speed_rpm":-1500}"#,
            ),
            (
                "30B#51560000",
                r#"{"frame":"30B#51560000","direction":"request","protocol":"thruster","node":11,"command":"read_speed"}"#,
            ),
            (
                "28B#515600000000FA24",
                r#"{"frame":"28B#515600000000FA24","direction":"reply","protocol":"thruster","node":11,"command":"read_speed","speed_rpm":-1500}"#,
            ),
        ],
    );
}

/// Thruster manual §2.4: nothing in the bytes tells a frame without a header; what was sent before
/// does.
#[test]
fn thruster_frames_without_a_header() {
    let values = r#"{"frame":"28B#03E800F0000A0410","direction":"reply","protocol":"thruster","node":11,"command":"headerless_return","speed_rpm":1000,"voltage_v":24,"current_a":1,"faults":["under_voltage","zero_protection"],"faults_raw":1040}"#;
    expect(
        &[],
        &[
            (
                "30B#564D000000000201",
                r#"{"frame":"30B#564D000000000201","direction":"request","protocol":"thruster","node":11,"command":"configure_return","flags":["no_header"],"flags_raw":2,"frames":["motion"],"frames_raw":1}"#,
            ),
            (
                "28B#564D000000000201",
                r#"{"frame":"28B#564D000000000201","direction":"reply","protocol":"thruster","node":11,"command":"configure_return","flags":["no_header"],"flags_raw":2,"frames":["motion"],"frames_raw":1}"#,
            ),
            (
                "30B#5443000000000005",
                r#"{"frame":"30B#5443000000000005","direction":"request","protocol":"thruster","node":11,"command":"signal","signal_percent":5}"#,
            ),
            ("28B#03E800F0000A0410", values),
        ],
    );
    expect(&["--headerless"], &[("28B#03E800F0000A0410", values)]);
}

#[test]
fn d5_on_both_buses() {
    let write = r#""direction":"request","protocol":"d5","node":11,"command":"write","register":32,"register_name":"speed","speed_dps":-600}"#;
    expect(
        &["--protocol", "d5"],
        &[
            ("00B#D50B05032058820D", &format!(r#"{{"frame":"00B#D50B05032058820D",{write}"#)),
            (
                "18FF0B00#D50B05032058820D",
                &format!(r#"{{"frame":"18FF0B00#D50B05032058820D",{write}"#),
            ),
            ("D50B05032058820D", &format!(r#"{{"frame":"D50B05032058820D",{write}"#)),
            (
                "5D0B0405122000 46 5D0B05CE07EEEEC1",
                r#"{"frame":"5D0B040512200046","direction":"reply","protocol":"d5","node":11,"command":"execute","register":18,"register_name":"status","faults":[],"faults_raw":32}
                   {"frame":"5D0B05CE07EEEEC1","direction":"reply","protocol":"d5","node":11,"command":"faulty_self_test","motor_error":"checksum","command_code":206}"#,
            ),
            // Two registers read at once.
            (
                "5D0B05022E851EE3",
                r#"{"frame":"5D0B05022E851EE3","direction":"reply","protocol":"d5","node":11,"command":"read","register":46,"register_name":"board_temperature","board_temperature_c":-5,"motor_temperature_c":30}"#,
            ),
            (
                "0FE#D5FE050600000009",
                r#"{"frame":"0FE#D5FE050600000009","direction":"request","protocol":"d5","node":"all","command":"reset"}"#,
            ),
        ],
    );
}

/// RMD and thrusters have ids of their own; D5 is known by its first byte; serial lines may hold
/// RMD and D5.
#[test]
fn auto_tells_the_protocols_apart() {
    expect(
        &[],
        &[
            (
                "141#9C00000000000000",
                r#"{"frame":"141#9C00000000000000","direction":"request","protocol":"rmd","node":1,"command":"read_status_2"}"#,
            ),
            (
                "281#51560000000003E8",
                r#"{"frame":"281#51560000000003E8","direction":"reply","protocol":"thruster","node":1,"command":"read_speed","speed_rpm":1000}"#,
            ),
            (
                "00B#5D0B05D45761019D",
                r#"{"frame":"00B#5D0B05D45761019D","direction":"reply","protocol":"d5","node":11,"command":"read_magnetic_angle","angle_deg":353}"#,
            ),
            (
                "3E01089C00000000000000F230 D50B050100000011",
                r#"{"frame":"3E01089C00000000000000F230","direction":"request","protocol":"rmd","node":1,"command":"read_status_2"}
                   {"frame":"D50B050100000011","direction":"request","protocol":"d5","node":11,"command":"query_id"}"#,
            ),
        ],
    );
}

#[test]
fn what_cannot_be_decoded_keeps_its_bytes_and_says_why() {
    expect(
        &[],
        &[
            ("", ""),
            ("hello \"world\"", r#"{"frame":"hello \"world\"","error":"line"}"#),
            ("141#9", r#"{"frame":"141#9","error":"line"}"#),
            (
                "141#9C000000000000000000",
                r#"{"frame":"141#9C000000000000000000","error":"length"}"#,
            ),
            ("141##19C00000000000000", r#"{"frame":"141##19C00000000000000","error":"can_fd"}"#),
            ("FFF#9C", r#"{"frame":"FFF#9C","error":"can_id"}"#),
            (
                "can0 20000004#0004000000000000",
                r#"{"interface":"can0","frame":"can0 20000004#0004000000000000","error":"error_frame"}"#,
            ),
            ("7FF#9C00", r#"{"frame":"7FF#9C00","error":"wrong_id"}"#),
            ("161#9C00000000000000", r#"{"frame":"161#9C00000000000000","error":"wrong_id"}"#),
            ("141#9C", r#"{"frame":"141#9C","protocol":"rmd","error":"length"}"#),
            ("141#R8", r#"{"frame":"141#R8","protocol":"rmd","error":"remote_frame"}"#),
            (
                "300#7900010000006102",
                r#"{"frame":"300#7900010000006102","direction":"request","protocol":"rmd","node":"all","command":"read_can_id"}"#,
            ),
            (
                "28B#5156000000010000",
                r#"{"frame":"28B#5156000000010000","protocol":"thruster","error":"upper_half"}"#,
            ),
            (
                "28B#41010000",
                r#"{"frame":"28B#41010000","direction":"reply","protocol":"thruster","node":11,"command":"unknown","data":"41010000","error":"unknown_command"}"#,
            ),
            (
                "00B#D50B05CF1234567A",
                r#"{"frame":"00B#D50B05CF1234567A","protocol":"d5","error":"checksum"}"#,
            ),
            (
                "00B#D50B030310010022",
                r#"{"frame":"00B#D50B030310010022","protocol":"d5","error":"length"}"#,
            ),
            ("00B#5D0B05D4560000 3A", r#"{"frame":"00B#5D0B05D4560000 3A","error":"line"}"#),
            (
                "00B#5D0B05D45600003A",
                r#"{"frame":"00B#5D0B05D45600003A","protocol":"d5","error":"fixed_byte"}"#,
            ),
            (
                "141#9001020304050607",
                r#"{"frame":"141#9001020304050607","direction":"request","protocol":"rmd","node":1,"command":"unknown","data":"9001020304050607","error":"unknown_command"}"#,
            ),
            (
                "00B#D50B05AA12345656",
                r#"{"frame":"00B#D50B05AA12345656","direction":"request","protocol":"d5","node":11,"command":"unknown","data":"05AA123456","error":"unknown_command"}"#,
            ),
            // High byte of the checksum first; a header that nothing follows; an id that is no
            // motor's.
            (
                "3E01089C0000000000000030F2",
                r#"{"frame":"3E01089C0000000000000030F2","error":"checksum"}"#,
            ),
            ("3E01089C", ""),
            (
                "3E01089C00000000000000F230",
                r#"{"frame":"3E01089C","error":"truncated"}
                {"frame":"3E01089C00000000000000F230","direction":"request","protocol":"rmd","node":1,"command":"read_status_2"}"#,
            ),
            (
                "3E21089C000000000000007AA2",
                r#"{"frame":"3E21089C000000000000007AA2","error":"checksum"}"#,
            ),
            ("5D0B05", r#"{"frame":"5D0B05","error":"truncated"}"#),
        ],
    );
}

#[test]
fn a_kind_of_line_that_was_not_asked_for_is_named() {
    let other = |frame: &str| format!(r#"{{"frame":"{frame}","error":"other_bus"}}"#);
    expect(&["--bus", "rs485"], &[("141#9C00000000000000", &other("141#9C00000000000000"))]);
    expect(&["--bus", "can"], &[("3E01", &other("3E01"))]);
    expect(&["--protocol", "thruster"], &[("3E01", &other("3E01"))]);
    expect(
        &["--protocol", "rmd"],
        &[("30B#51560000", r#"{"frame":"30B#51560000","protocol":"rmd","error":"wrong_id"}"#)],
    );
    let text = mgw_reading(&["decode", "--protocol", "thruster", "--bus", "rs485"], "").failure(2);
    assert!(text.contains("serial"), "{text}");
}

#[test]
fn each_interface_has_its_own_conversation() {
    let stop = "3E0108810000000000000032A5";
    let input = format!("(1.0) {stop}\n(1.1) {stop}\n");
    let lines = mgw_reading(&["--json", "decode"], input).json_lines();
    assert_eq!(
        (&lines[0]["direction"], &lines[1]["direction"]),
        (&"request".into(), &"reply".into())
    );
    let input = "can0 300#7900000000000002\ncan1 300#7900000000000002\ncan0 300#7900000000000002\n";
    let lines = mgw_reading(&["--json", "decode"], input).json_lines();
    let directions: Vec<_> = lines.iter().map(|line| line["direction"].as_str().unwrap()).collect();
    assert_eq!(directions, ["request", "request", "reply"]);
}

#[test]
fn text_for_people_stands_in_columns() {
    let input = "(12.5) can0 141#A100000064000000\n241#9A320001E5010400\n30B#5156000000000000\n7FF#00\n141#00\n\
                 3E01089C1934129CFF78567AD8\n";
    let expected = "\
12.5  can0  141#A100000064000000        rmd 1         request  torque_current             current_a=1
241#9A320001E5010400        rmd 1         reply    read_status_1              temperature_c=50 brake_released=true voltage_v=48.5 faults=under_voltage(0x0004)
30B#5156000000000000        thruster 11   request  read_speed
7FF#00                      error: wrong_id (no protocol has this id, and the data begin no D5 frame)
141#00                      rmd           error: length (1 data bytes instead of 8)
3E01089C1934129CFF78567AD8  rmd 1         reply    read_status_2              temperature_c=25 current_a=46.6 speed_dps=-100 angle_deg=22136
";
    assert_eq!(mgw_reading(&["decode"], input).success(), expected);
}

#[test]
fn a_long_capture_on_one_line_and_bytes_of_any_kind() {
    let mut input = String::from("(7.25) ");
    for _ in 0..20_000 {
        input.push_str("3E01089C00000000000000F2303E01089C1934129CFF78567AD8");
    }
    let output = mgw_reading(&["decode", "--json"], input).success();
    assert_eq!(output.lines().count(), 40_000);
    assert!(output.lines().skip(1).step_by(2).all(|line| line.contains(r#""angle_deg":22136"#)));
    // Not a byte of text.
    let noise: Vec<u8> =
        (0..100_000_u32).map(|n| n.wrapping_mul(2_654_435_761).to_be_bytes()[0]).collect();
    for line in mgw_reading(&["decode", "--json"], noise).json_lines() {
        assert!(line["error"].is_string() && line["frame"].is_string(), "{line}");
    }
}

#[test]
fn a_reader_of_decoded_frames_that_goes_away_is_no_panic() {
    let mut input = String::new();
    for node in 0..50_000 {
        writeln!(input, "141#A2000000{node:08X}").unwrap();
    }
    let path = std::env::temp_dir().join(format!("mgw-decode-{}.log", std::process::id()));
    std::fs::write(&path, input).unwrap();
    let outcome = mgw_cut_short(&["decode"], std::fs::File::open(&path).unwrap(), 2);
    std::fs::remove_file(&path).unwrap();
    assert_eq!((outcome.stdout.lines().count(), outcome.stderr.as_str()), (2, ""), "{outcome:?}");
}

#[test]
fn help_of_decode_and_encode_shows_examples() {
    for command in ["decode", "encode"] {
        let text = mgw(&[command, "--help"]).success();
        assert!(text.contains("Examples:") && text.contains(&format!("mgw {command}")), "{text}");
    }
}

#[test]
fn what_has_only_begun_at_the_end_is_truncated() {
    for bytes in ["3E", "3E01", "D5", "5D0B"] {
        expect(&[], &[(bytes, &format!(r#"{{"frame":"{bytes}","error":"truncated"}}"#))]);
    }
}

#[test]
fn a_thruster_frame_that_is_too_short_names_both_lengths() {
    let line = mgw_reading(&["decode", "--json"], "30B#5156\n").json_lines().remove(0);
    assert_eq!(
        (&line["error"], &line["message"]),
        (&"length".into(), &"2 data bytes instead of 4 or 8".into())
    );
}

#[test]
fn a_time_that_is_a_number_is_a_number() {
    for (time, key, value) in [
        ("-5", "time_s", "-5"),
        (".5", "time_s", "0.5"),
        ("1700000000.", "time_s", "1700000000"),
        ("noon", "time", "\"noon\""),
    ] {
        let line = mgw_reading(&["decode", "--json"], format!("({time}) 141#9C00000000000000\n"))
            .success();
        assert!(line.starts_with(&format!("{{\"{key}\":{value},")), "{time}: {line}");
    }
}
