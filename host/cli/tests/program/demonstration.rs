//! `mgw` without arguments.

use crate::support::{command as command_of, mgw};

#[test]
fn all_five_axes_stop_without_the_host() {
    let text = mgw(&[]).success();
    assert!(text.contains("All 5 axes tripped and stopped without the host."), "{text}");
    for protocol in ["rmd 1", "thruster 0x0B", "d5 0x0B", "d5 0x0C"] {
        assert!(text.contains(protocol), "{text}");
    }
    for axis in 0..5 {
        assert!(text.contains(&format!("axis {axis} tripped")), "{text}");
    }
    assert!(
        text.contains("the setpoint expired") && text.contains("the host was silent"),
        "{text}"
    );
    assert!(text.contains("What to try next"), "{text}");
    // Not as Rust prints its values.
    assert!(!text.contains('{') && !text.contains("Centi") && !text.contains("Some("), "{text}");
    // 600 °/s counter-clockwise, D5 manual, common commands, row 2.
    assert!(text.contains("D50B05032058028D"), "{text}");
    // Speed 0 is the stop of a D5, on CAN and on RS485.
    assert!(text.contains("00B#D50B050320000033"), "{text}");
    assert!(text.contains(" D50C050320000034"), "{text}");
}

#[test]
fn it_names_the_command_as_it_was_run() {
    for (cargo, command) in [(Some("cargo"), "  cargo run -- sim "), (None, "  mgw sim ")] {
        let mut program = command_of(&["demo"]);
        program.env_remove("CARGO").envs(cargo.map(|cargo| ("CARGO", cargo)));
        let text = String::from_utf8(program.output().unwrap().stdout).unwrap();
        assert!(text.contains(command), "{text}");
    }
}

#[test]
fn it_is_the_same_each_time() {
    assert_eq!(mgw(&["demo"]).success(), mgw(&[]).success());
}

#[test]
fn it_speaks_json_too() {
    let lines = mgw(&["--json"]).json_lines();
    let last = lines.last().unwrap();
    assert_eq!(last["axes"], 5);
    assert_eq!(last["stopped"], 5);
    let stops: Vec<_> = lines
        .iter()
        .filter(|line| line.get("reaction_us").is_some_and(|value| value.is_u64()))
        .collect();
    assert!(stops.len() >= 5, "{lines:?}");
}
