//! `mgw plan`: what it computes, what it refuses, and what would make it hold.

use serde_json::Value;

use crate::support::{FOUR, file, json, mgw, mgw_reading};

const EIGHT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/eight-motors.toml");

/// The plan of a file, which is printed even if it does not hold.
fn plan(arguments: &[&str]) -> (Option<i32>, Value) {
    let words: Vec<&str> = ["--json", "plan"].iter().chain(arguments).copied().collect();
    let outcome = mgw(&words);
    (outcome.code, json(&outcome.stdout))
}

fn rate(arguments: &[&str]) -> f64 {
    plan(arguments).1["plan"]["rate_hz"].as_f64().expect("a rate")
}

/// Four requests of 128 or 129 bits and replies of 131 or 132 at 1 Mbit/s, beside polls that take
/// 36 of 1000: 1040 / 0.964.
#[test]
fn eight_axes_on_two_buses_are_as_fast_as_four_on_one() {
    let ideal = [EIGHT, "--host", "usb", "--reply-delay", "0", "--gateway-us", "0"];
    let (code, planned) = plan(&ideal);
    assert_eq!(code, Some(0));
    for bus in [0, 1] {
        let bus = &planned["plan"]["buses"][bus];
        assert_eq!((&bus["wire_us"], &bus["cycle_us"]), (&1040.into(), &1040.into()));
        assert_eq!((&bus["polls_permille"], &bus["period_us"]), (&36.into(), &1079.into()));
        // G5: 100 + (2 · 4 − 1 + 1) · 135 where all four stop.
        assert_eq!(bus["axes"][3]["stop_together_us"], 1180);
    }
    assert_eq!(planned["plan"]["round_us"], 1079);
    // Eight axes: 96 bytes of positions out and up to 132 back, ten bits each; of velocities 64.
    let line = |more: &[&str]| {
        let words = [&[EIGHT, "--host", "1000000"], more].concat();
        plan(&words).1["plan"]["host"].clone()
    };
    let positions = line(&[]);
    assert_eq!((&positions["out_us"], &positions["back_us"]), (&960.into(), &1320.into()));
    assert_eq!(line(&["--no-positions"])["out_us"], 640);
}

/// BENCHMARKS.md prints what this computes.
#[test]
fn the_table_of_the_benchmarks_is_that_of_the_plan() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../BENCHMARKS.md"));
    let page = page.unwrap();
    for (host, name) in [("921600", "921,600 baud"), ("2000000", "2,000,000 baud")] {
        for (setpoints, more) in [("positions", &[][..]), ("velocities", &["--no-positions"])] {
            let planned = plan(&[&[EIGHT, "--host", host], more].concat()).1["plan"].clone();
            let (line, rate) = (&planned["host"], &planned["rate_hz"]);
            let (out, back) = (&line["out_bytes"], &line["back_bytes"]);
            let rate = rate.as_f64().expect("a rate");
            let row = format!("| {name} | {setpoints} | {out}, {back} | {rate:.1} Hz |");
            assert!(page.contains(&row), "{row}");
        }
    }
    let usb = rate(&[EIGHT, "--host", "usb"]);
    assert!(page.contains(&format!(
        "| USB, its time counted as nothing | either | 96 or 64, 132 | {usb:.1} Hz |"
    )));
}

#[test]
fn whatever_makes_it_harder_makes_it_slower() {
    let before = rate(&[EIGHT]);
    for harder in [
        ["--host", "460800"],
        ["--reply-delay", "400"],
        ["--reply-delay", "3=900"],
        ["--foreign", "0=500"],
        ["--gateway-us", "200"],
        ["--fields", "position,velocity,current,voltage,faults"],
    ] {
        let after = rate(&[&[EIGHT], &harder[..]].concat());
        assert!(after < before, "{harder:?}: {after} of {before}");
    }
}

#[test]
fn a_rate_that_does_not_hold_is_refused_with_what_would_make_it_hold() {
    let refused = mgw(&["plan", EIGHT, "--rate", "350"]);
    let said = refused.failure(1);
    assert!(said.contains("350 Hz do not hold: 248.7 Hz can be reached"), "{said}");
    assert!(said.contains("a host line of 2000000 baud"), "{said}");
    let (code, held) = plan(&[EIGHT, "--rate", "350", "--host", "2000000"]);
    assert_eq!((code, &held["holds"]), (Some(0), &true.into()));

    let refused = mgw(&["plan", EIGHT, "--rate", "260"]).failure(1);
    assert!(refused.contains("--no-positions"), "{refused}");
    // The bus is the limit: fewer axes on it, or nothing.
    let usb = [EIGHT, "--host", "usb", "--foreign", "1=2500", "--rate", "600"];
    let (code, held) = plan(&usb);
    assert_eq!((code, &held["holds"]), (Some(1), &false.into()));
    let said = held["changes"].to_string();
    assert!(said.contains("2 instead of 4 axes on bus 1, the others on another bus"), "{said}");

    let (_, hopeless) = plan(&[EIGHT, "--rate", "5000"]);
    assert_eq!(hopeless["changes"], serde_json::json!([]));
    let (_, full) = plan(&[EIGHT, "--foreign", "0=9000"]);
    assert_eq!(full["plan"]["rate_hz"], Value::Null);
}

/// What the reply to a setpoint does not tell is read in each period of `RunCycle`, and in no `Cycle`.
#[test]
fn a_running_cycle_has_room_for_what_it_reads() {
    let bus = |arguments: &[&str], bus: usize| {
        plan(&[&[FOUR], arguments].concat()).1["plan"]["buses"][bus].clone()
    };
    let reads = |bus: &Value, axis: usize| bus["axes"][axis]["reads"].clone();
    let period = |bus: &Value| bus["period_us"].as_u64().unwrap();
    let (few, more) = (["--fields", "faults"], ["--fields", "velocity,current"]);
    // An RMD, which tells all, and a thruster.
    let (before, after) = (bus(&few, 0), bus(&more, 0));
    assert_eq!([0, 1].map(|axis| reads(&before, axis)), [0, 0]);
    assert_eq!([0, 1].map(|axis| reads(&after, axis)), [0, 2]);
    assert!(period(&after) > period(&before) && before["repeat_us"] == after["repeat_us"]);
    assert!(after["steady_us"].as_u64() > after["period_us"].as_u64());
    // A D5 tells no current.
    assert_eq!(reads(&bus(&more, 1), 0), 1);
    assert_eq!(reads(&bus(&["--impedance", "0"], 0), 0), 1);

    // A rate of RunCycle is another one than that of Cycle.
    let rate = ["--rate", "600", "--host", "2000000"];
    let (code, cycle) = plan(&[&[EIGHT], &rate[..]].concat());
    assert_eq!((code, &cycle["holds"]), (Some(1), &false.into()));
    let (code, running) = plan(&[&[EIGHT, "--running"], &rate[..]].concat());
    assert_eq!((code, &running["holds"]), (Some(0), &true.into()));
    // The line to the host carries an event of each period: 600 of 163 bytes in a second are 978000
    // bit/s.
    let (code, slow) = plan(&[EIGHT, "--running", "--rate", "600", "--host", "460800"]);
    assert_eq!((code, &slow["plan"]["host"]["event_bytes"]), (Some(1), &163.into()));
}

/// What a gateway would refuse, or what would trip, holds no more than what a bus has no time for.
#[test]
fn a_rate_that_no_gateway_takes_does_not_hold() {
    let refused = |arguments: &[&str], said: &str| {
        let outcome = mgw(&[&["plan"], arguments].concat());
        let told = outcome.failure(1);
        assert!(told.contains(said), "{told}");
    };
    refused(&[FOUR, "--running", "--rate", "10"], "takes no RunCycle of less than 50 Hz");
    // A setpoint of 100 ms is over before the next one comes.
    refused(&[FOUR, "--rate", "9"], "expires before the next below 10.0 Hz: ttl_us");
    assert_eq!(plan(&[FOUR, "--rate", "10"]).0, Some(0));
    // The rate that is printed can be asked for.
    for running in [&[][..], &["--running"]] {
        let name = if running.is_empty() { "rate_hz" } else { "running_hz" };
        let reached = plan(&[FOUR]).1["plan"][name].to_string();
        assert_eq!(plan(&[&[FOUR, "--rate", &reached], running].concat()).0, Some(0), "{reached}");
    }
    // Where others leave a bus no time a stop has no bound: 6250 of 160 bits are a second.
    let (_, full) = plan(&[FOUR, "--foreign", "0=6250"]);
    let axis = &full["plan"]["buses"][0]["axes"][0];
    assert_eq!((&axis["stop_alone_us"], &axis["stop_together_us"]), (&Value::Null, &Value::Null));
}

/// Its reply of 132 bits must be there within 5 ms; on CAN what goes before it does not count.
#[test]
fn a_motor_that_answers_too_late_for_its_window_is_told() {
    for (delay, late) in [("3000", 0), ("4868", 0), ("4870", 8)] {
        let outcome = mgw(&["plan", EIGHT, "--host", "usb", "--reply-delay", delay]);
        let told = outcome.stdout.matches("µs: reply_window_us").count();
        assert_eq!(told, late, "{delay}: {outcome:?}");
        let (_, planned) = plan(&[EIGHT, "--host", "usb", "--reply-delay", delay]);
        let axis = &planned["plan"]["buses"][0]["axes"][0];
        assert_eq!(axis["reply_counts"], late == 0, "{delay}: {axis}");
    }
}

/// Such axes can be configured, and no gateway arms them.
#[test]
fn an_axis_that_is_never_armed_is_told_and_no_rate_holds_with_it() {
    let text = std::fs::read_to_string(FOUR).unwrap();
    let words = ["plan", "-", "--rate", "10"];
    let said = "could not confirm a stop";
    for (axis, node, key) in [(1, "thruster", "return_mode = 256"), (2, "d5", "d5_ack_level = 0")] {
        let protocol = format!("protocol = \"{node}\"\n");
        let mute = text.replacen(&protocol, &format!("{protocol}{key}\n"), 2);
        let named = format!("the motor of axis {axis} is set so that it {said}");
        let outcome = mgw_reading(&["plan", "-"], mute.as_str());
        assert_eq!(outcome.code, Some(0), "{outcome:?}");
        assert!(outcome.stdout.contains(&format!("never armed: {named}")), "{outcome:?}");
        let told = mgw_reading(&words, mute.as_str()).failure(1);
        assert!(told.contains(&format!("10 Hz do not hold: {named}")), "{told}");
        let outcome = mgw_reading(&["--json", "plan", "-"], mute.as_str());
        let plan = &json(&outcome.stdout)["plan"];
        let axes = plan["buses"].as_array().unwrap().iter();
        let axes = axes.flat_map(|bus| bus["axes"].as_array().unwrap());
        let mute: Vec<u64> = axes
            .filter(|axis| axis["can_confirm"] == false)
            .map(|axis| axis["axis"].as_u64().unwrap())
            .collect();
        assert_eq!(mute, [axis]);
    }
    let outcome = mgw_reading(&words, text.as_str());
    assert!(outcome.code == Some(0) && !outcome.stdout.contains(said), "{outcome:?}");
}

#[test]
fn what_is_told_of_an_axis_is_of_one_that_is_there() {
    for (arguments, said) in [
        (["--impedance", "3"], "axis 3 takes no impedance setpoints: only RMD motors on CAN do"),
        (["--reply-delay", "9=5"], "axis 9 is named, and"),
    ] {
        let outcome = mgw(&[&["plan", FOUR], &arguments[..]].concat());
        let told = outcome.failure(2);
        assert!(told.contains(said), "{told}");
    }
    // The two RMDs take positions, of four bytes more than a velocity; an impedance setpoint has 16
    // more.
    let out =
        |more: &[&str]| plan(&[&[FOUR], more].concat()).1["plan"]["host"]["out_bytes"].clone();
    let impedance = ["--impedance", "0"];
    assert_eq!(
        (out(&["--no-positions"]), out(&[]), out(&impedance)),
        (43.into(), 51.into(), 63.into())
    );
}

/// A name in the file stands for the number; what is unknown is answered with what there is.
#[test]
fn what_takes_a_number_takes_a_name_of_the_file() {
    let text = std::fs::read_to_string(FOUR).unwrap();
    let text = text.replace("axis = 0\n", "axis = 0\nname = \"left\"\n");
    let text = text.replacen("bus = 0\n", "bus = 0\nname = \"arm_bus\"\n", 1);
    let path = &file("named.toml");
    std::fs::write(path, text).unwrap();
    let table = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reply-delays.txt");
    for (by_name, by_number) in [
        (&["--impedance", "left"][..], &["--impedance", "0"][..]),
        (&["--reply-delay", "left=400"], &["--reply-delay", "0=400"]),
        (&["--foreign", "arm_bus=100"], &["--foreign", "0=100"]),
        (&["--rs485", "arm_bus"], &["--rs485", "0"]),
        (&["--delays", table, "--motor", "left=X8"], &["--delays", table, "--motor", "0=X8"]),
    ] {
        let of = |arguments: &[&str]| mgw(&[&["plan", path], arguments].concat());
        let (named, numbered) = (of(by_name), of(by_number));
        assert_eq!(
            (named.code, &named.stdout, &named.stderr),
            (numbered.code, &numbered.stdout, &numbered.stderr)
        );
        assert!(named.code != Some(2), "{named:?}");
    }
    for (arguments, said) in [
        (&["--impedance", "right"][..], "no axis is called `right`; there are: left (0)"),
        (&["--reply-delay", "right=5"], "no axis is called `right`; there are: left (0)"),
        (&["--foreign", "left=5"], "no bus is called `left`; there are: arm_bus (0)"),
        (&["--rs485", "left"], "no bus is called `left`; there are: arm_bus (0)"),
        (&["--delays", table, "--motor", "right=X8"], "no axis is called `right`; there are"),
    ] {
        let told = mgw(&[&["plan", path], arguments].concat()).failure(2);
        assert!(told.contains(said), "{told}");
    }
}

#[test]
fn a_slow_bus_is_told_which_bitrate_it_needs() {
    let text = std::fs::read_to_string(EIGHT).unwrap().replace("1_000_000", "250_000");
    let words = ["--json", "plan", "-", "--host", "usb", "--rate", "250"];
    let one_bus = text.replace("bus = 1\nprotocol", "bus = 0\nprotocol");
    let same_nodes = (4..8).fold(one_bus, |text, axis| {
        let old = format!("axis = {axis}\nbus = 0\nprotocol = \"rmd\"\nnode = {}\n", axis - 3);
        text.replace(&old, &old.replace("node = ", "node = 1"))
    });
    let outcome = mgw_reading(&words, same_nodes);
    assert_eq!(outcome.code, Some(1), "{outcome:?}");
    let said = json(&outcome.stdout)["changes"].to_string();
    assert!(said.contains("1000000 bit/s on bus 0"), "{said}");
    assert!(json(&outcome.stderr)["error"]["name"] == "does_not_hold");
}

#[test]
fn stated_delays_are_told_from_assumed_ones() {
    let path = &file("delays.toml");
    std::fs::write(path, "[reply_delay_us]\n0 = 111\n1 = 222\n").unwrap();
    let (_, planned) = plan(&[FOUR, "--delays", path, "--reply-delay", "1=333"]);
    let axes = |bus: usize| &planned["plan"]["buses"][bus]["axes"];
    let delay = |axis: &Value| (axis["reply_delay_us"].clone(), axis["reply_delay_stated"].clone());
    assert_eq!(delay(&axes(0)[0]), (111.into(), true.into()));
    assert_eq!(delay(&axes(0)[1]), (333.into(), true.into()));
    assert_eq!(delay(&axes(1)[0]), (250.into(), false.into()));
    assert_eq!(planned["plan"]["buses"][2]["kind"], "rs485");
    for (text, said) in [
        ("[reply_delay_us]\n40 = 1\n", "40 is no axis, 0 to 31"),
        ("[reply_delay_us]\n1 = 2000000\n", "0 to 1000000"),
        ("[reply_delay_us]\n1 = -4\n", "AXIS = MICROSECONDS"),
        ("[delays]\n1 = 4\n", "AXIS = MICROSECONDS"),
        ("nonsense", "AXIS = MICROSECONDS"),
    ] {
        std::fs::write(path, text).unwrap();
        let error = mgw(&["plan", FOUR, "--delays", path]).failure(2);
        assert!(error.contains(said), "{text}: {error}");
    }
}

#[test]
fn bad_input_is_told_from_a_plan_that_does_not_hold() {
    for (arguments, said) in [
        (&["/nowhere"][..], "/nowhere"),
        (&[EIGHT, "--rate", "0"], "0.001 to 1000000"),
        (&[EIGHT, "--rate", "nan"], "0.001 to 1000000"),
        (&[EIGHT, "--reply-delay", "32=5"], "axes 0 to 31"),
        (&[EIGHT, "--reply-delay=-1"], "0 to 1000000"),
        (&[EIGHT, "--reply-delay", "x y=5"], "AXIS=MICROSECONDS"),
        (&[EIGHT, "--foreign", "5"], "BUS=FRAMES_S"),
        (&[EIGHT, "--foreign", "3=5"], "bus 3 is named"),
        (&[FOUR, "--foreign", "2=5"], "bus 2 is RS485"),
        (&[EIGHT, "--rs485", "7"], "bus 7 is named"),
        (&[EIGHT, "--host", "0"], "1200 to 20000000 baud"),
        (&[EIGHT, "--fields", "speed"], "must be one of"),
        (&[EIGHT, "--gateway-us", "9999999"], "100000"),
        (&[EIGHT, "--running"], "--rate"),
        (&[EIGHT, "--impedance", "9"], "axis 9 is named"),
        (&[FOUR, "--impedance", "1"], "axis 1 takes no impedance setpoints"),
    ] {
        let words: Vec<&str> = ["plan"].iter().chain(arguments).copied().collect();
        let error = mgw(&words).failure(2);
        assert!(error.contains(said), "{arguments:?}: {error}");
    }
    let error = mgw_reading(&["plan", "-"], "[[bus]]\nbus = 0\nbitrate = 1\n").failure(1);
    assert!(error.contains("standard input: line"), "{error}");
    let error = mgw_reading(&["plan", "-"], "[gateway]\n").failure(2);
    assert!(error.contains("no axis to plan for") && !error.contains("[E-"), "{error}");
}
