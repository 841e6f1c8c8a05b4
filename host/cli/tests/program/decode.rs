//! `mgw decode` with literal input and output.

use std::fmt::Write;

use serde_json::Value;

use crate::support::{file, json, mgw, mgw_cut_short, mgw_reading};

/// Runs the program with each list of options of decode.txt.
#[test]
fn the_lines_of_the_file_are_decoded_as_it_says() {
    let lines = include_str!("decode.txt").lines().enumerate();
    let lines: Vec<(usize, &str)> =
        lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).collect();
    let is_options = |line: &str| line.starts_with('$') || line.starts_with('%');
    let runs = lines.chunk_by(|_, (_, next)| !is_options(next));
    assert_eq!(runs.clone().count(), lines.iter().filter(|(_, line)| is_options(line)).count());
    for run in runs {
        let ((number, first), lines) = run.split_first().unwrap();
        let (is_json, options) = (first.starts_with('$'), first[1..].split_whitespace());
        let (mut input, mut expected) = (String::new(), Vec::new());
        for (_, line) in lines {
            match line.strip_prefix('>') {
                Some(line) => writeln!(input, "{}", line.trim_start()).unwrap(),
                None => expected.push(*line),
            }
        }
        let mut arguments = vec!["decode"];
        arguments.extend(is_json.then_some("--json").into_iter().chain(options));
        let outcome = mgw_reading(&arguments, input);
        let failed = ["\"error\":", "error: "].iter().any(|error| outcome.stdout.contains(error));
        assert_eq!(outcome.code, Some(i32::from(failed)), "{outcome:?}");
        let printed = outcome.stdout.lines();
        let printed: Vec<String> = if is_json {
            printed.map(without_message).collect()
        } else {
            printed.map(str::to_owned).collect()
        };
        assert_eq!(printed, expected, "decode.txt, line {}: {first}", number + 1);
    }
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
fn thrusters_are_on_no_serial_bus() {
    let text = mgw_reading(&["decode", "--protocol", "thruster", "--bus", "rs485"], "").failure(2);
    assert!(text.contains("serial"), "{text}");
}

#[test]
fn each_interface_has_its_own_conversation() {
    let stop = "3E0108810000000000000032A5";
    let input = format!("(1.0) {stop}\n(1.1) {stop}\n");
    let lines = mgw_reading(&["--json", "decode"], input).decoded();
    assert_eq!(
        (&lines[0]["direction"], &lines[1]["direction"]),
        (&"request".into(), &"reply".into())
    );
    let input = "can0 300#7900000000000002\ncan1 300#7900000000000002\ncan0 300#7900000000000002\n";
    let lines = mgw_reading(&["--json", "decode"], input).decoded();
    let directions: Vec<_> = lines.iter().map(|line| line["direction"].as_str().unwrap()).collect();
    assert_eq!(directions, ["request", "request", "reply"]);
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
    for line in mgw_reading(&["decode", "--json"], noise).decoded() {
        assert!(line["error"].is_string() && line["frame"].is_string(), "{line}");
    }
}

#[test]
fn a_reader_of_decoded_frames_that_goes_away_is_no_panic() {
    let mut input = String::new();
    for node in 0..50_000 {
        writeln!(input, "141#A2000000{node:08X}").unwrap();
    }
    let path = file("long.log");
    std::fs::write(&path, input).unwrap();
    let outcome = mgw_cut_short(&["decode"], std::fs::File::open(&path).unwrap(), 2);
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
fn a_thruster_frame_that_is_too_short_names_both_lengths() {
    let line = mgw_reading(&["decode", "--json"], "30B#5156\n").decoded().remove(0);
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
        assert!(line.contains(&format!(",\"{key}\":{value},")), "{time}: {line}");
    }
}

#[test]
fn captures_are_read_from_files_and_a_byte_order_mark_is_no_byte() {
    let name = &file("frames.log");
    std::fs::write(name, "\u{feff}  can0  RX - -  141   [8]  9A 00 00 00 00 00 00 00\n").unwrap();
    let reply = "(2.5) serial2 3E01089C1934129CFF78567AD8\n";
    let lines = mgw_reading(&["--json", "decode", name, "-", name], reply).decoded();
    let told: Vec<_> = lines.iter().map(|line| (&line["interface"], &line["command"])).collect();
    let (can, serial) = (&Value::from("can0"), &Value::from("serial2"));
    let (status_1, status_2) = (&Value::from("read_status_1"), &Value::from("read_status_2"));
    assert_eq!(told, [(can, status_1), (serial, status_2), (can, status_1)]);
    let text = mgw(&["decode", "/no/such.log"]).failure(2);
    assert!(text.contains("cannot read /no/such.log"), "{text}");
}

#[test]
fn the_exit_code_says_whether_lines_failed() {
    let outcome = mgw_reading(&["decode"], "141#9A00000000000000\nhello\n141#00\n");
    assert_eq!(outcome.stdout.lines().count(), 3, "{outcome:?}");
    let text = outcome.failure(1);
    assert_eq!(text, "mgw: 2 of 3 lines are no frame that could be decoded.\n");
    let text = mgw_reading(&["decode", "--json"], "hello\n").failure(1);
    let error = &json(&text)["error"];
    assert_eq!((&error["name"], &error["failed"]), (&"undecoded".into(), &1.into()));
    assert_eq!(mgw_reading(&["decode"], "").code, Some(0));
}
