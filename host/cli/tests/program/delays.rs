//! `mgw delays`, and the tables that `mgw bench` and `mgw plan` share with it.

use std::fs;

use serde_json::json;

use crate::support::{FOUR, Sim, file, mgw};

const HEAD: &str = "reply-delays 1\n\
    # protocol model firmware bus bitrate command where count min p50 p99 max when gateway buckets\n";
const FAST: &str = "rmd X8 v1 can 1000000 read_status_2 lab-a 2 249 251 251 251 2026-11-23 0.1.0 \
                    248:2\n";
const SLOW: &str = "rmd X8 v1 can 1000000 read_status_2 lab-a 1 900 900 900 900 2026-11-24 0.2.0 \
                    896:1\n";
const BOTH: &str = "rmd X8 v1 can 1000000 read_status_2 lab-a 3 249 251 900 900 \
                    2026-11-23,2026-11-24 0.1.0,0.2.0 248:2,896:1\n";
const OTHER: &str = "rmd Y2 v1 can 1000000 torque_current simulator 1 40 40 40 40 2026-11-24 0.1.0 \
                     40:1\n";

fn file_of(name: &str, text: &str) -> String {
    let path = file(name);
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn tables_are_merged_in_any_order_and_written_where_they_were() {
    let one = &file_of("one.txt", &format!("{HEAD}{FAST}"));
    let other = &file_of("other.txt", &format!("reply-delays 1\n\n# a lab\n{OTHER}{SLOW}"));
    let wanted = format!("{HEAD}{BOTH}{OTHER}");
    assert_eq!(mgw(&["delays", one, other]).success(), wanted);
    assert_eq!(mgw(&["delays", other, one]).success(), wanted);
    let lines = mgw(&["--json", "delays", one, other]).json_lines();
    let first = &lines[0]["reply_delays"][0];
    assert_eq!((&first["model"], &first["count"]), (&json!("X8"), &json!(3)));
    assert_eq!(first["buckets"], json!([{"us": 248, "count": 2}, {"us": 896, "count": 1}]));
    let text = mgw(&["delays", one, other, "--output", one]).failure(1);
    assert!(text.contains("is there already"), "{text}");
    assert_eq!(fs::read_to_string(one).unwrap(), format!("{HEAD}{FAST}"), "it is as it was");
    let said = mgw(&["delays", one, other, "--output", one, "--force"]).success();
    assert_eq!(said, format!("2 entries are in {one}\n"));
    assert_eq!(fs::read_to_string(one).unwrap(), wanted);
    let lines = mgw(&["--json", "delays", one, "--output", one, "--force"]).json_lines();
    assert_eq!(lines[0]["entries"], 2);
}

#[test]
fn what_is_no_table_is_named_by_file_and_line() {
    let path = &file_of("bad.txt", &format!("{HEAD}{FAST}{}", SLOW.replace(" 900 ", " 9e2 ")));
    let text = mgw(&["delays", path]).failure(2);
    let wanted = format!("{path}: line 4: min `9e2` is no whole number, or too large");
    assert!(text.contains(&wanted), "{text}");
    let text = mgw(&["plan", FOUR, "--delays", path]).failure(2);
    assert!(text.contains(&wanted), "{text}");
    for (arguments, wanted) in [
        (&["delays"][..], "<FILE>"),
        (&["delays", path, "--bitrate", "0"], "takes BUS=BIT_S, bus 0 to 3"),
        (&["delays", path, "--bitrate", "9=1000000"], "takes BUS=BIT_S, bus 0 to 3"),
        (&["delays", path, "--where", "my lab"], "takes letters, digits and . _ - + only"),
        (&["delays", path, "--force"], "--output"),
        (&["plan", FOUR, "--motor", "0=X8"], "--delays"),
        (&["plan", FOUR, "--delays", path, "--motor", "X8"], "takes AXIS=MODEL, axis 0 to 31"),
    ] {
        let text = mgw(arguments).failure(2);
        assert!(text.contains(wanted), "{arguments:?}: {text}");
    }
    mgw(&["delays", "/nowhere/x"]).failure(2);
    fs::write(path, b"\x89PNG\r\n\x1a\n\xff\xfe").unwrap();
    let text = mgw(&["delays", path]).failure(2);
    assert!(text.contains("neither a recording (MCAP) nor a table of delays"), "{text}");
}

#[test]
fn a_plan_takes_the_longest_delay_of_a_motor_as_the_axis_may_have() {
    let table = &file_of("plan.txt", &format!("{HEAD}{BOTH}{OTHER}"));
    let delay = |more: &[&str]| {
        let arguments = [&["--json", "plan", FOUR, "--delays", table], more].concat();
        let planned = mgw(&arguments).json_lines();
        let axes = &planned[0]["plan"]["buses"][0]["axes"];
        [0, 1].map(|axis| {
            (axes[axis]["reply_delay_us"].clone(), axes[axis]["reply_delay_stated"].clone())
        })
    };
    let default = (json!(250), json!(false));
    assert_eq!(delay(&[]), [(json!(900), json!(true)), default.clone()]);
    assert_eq!(delay(&["--motor", "0=Y2"]), [(json!(40), json!(true)), default.clone()]);
    assert_eq!(delay(&["--reply-delay", "0=7"]), [(json!(7), json!(true)), default.clone()]);
    assert_eq!(delay(&["--motor", "0=Z"])[0], default);
    let said = mgw(&["plan", FOUR, "--delays", table]);
    for wanted in [
        "axis 0: the longest delay of X8, Y2; --motor 0=MODEL chooses one",
        "axis 0: its delay is in part that of a simulator",
        "axis 1: the table has nothing of thruster motors on can at 1000000 bit/s",
    ] {
        assert!(said.stderr.contains(wanted), "{}", said.stderr);
    }
    said.success();
    let by_axis = &file_of("axis.toml", "[reply_delay_us]\n0 = 100\n");
    let text = mgw(&["plan", FOUR, "--delays", by_axis, "--motor", "0=X8"]).failure(2);
    assert!(text.contains("it has delays by axis"), "{text}");
}

#[test]
fn bench_writes_a_table_that_says_it_is_of_a_simulator() {
    let sim = Sim::patient();
    let table = &file("bench.txt");
    let bench = ["bench", "0", "1", "--yes", "--rounds", "10", "--table", table];
    sim.mgw(&bench).success();
    let text = mgw(&["delays", table]).success();
    assert_eq!(text, fs::read_to_string(table).unwrap());
    let lines: Vec<&str> = text.lines().skip(2).collect();
    let begins = |line: usize, with: &str| {
        assert!(lines[line].starts_with(with), "{text}");
    };
    assert_eq!(lines.len(), 2, "{text}");
    begins(0, "rmd X8S2V10 ");
    begins(1, "thruster unknown unknown can 1000000 cycle-estimated simulator 10 ");
    assert!(lines[0].contains(" can 1000000 cycle-estimated simulator 10 "), "{text}");
    let text = sim.mgw_once_at_rest(&[&bench[..], &["--where", "lab-a"]].concat()).failure(2);
    assert!(text.contains("the gateway is simulated, so --where can be simulator only"), "{text}");
}
