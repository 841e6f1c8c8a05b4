//! `mgw jog`, its keys typed into a pseudo terminal. What a motor did is what the simulator says.

use std::fs::File;
use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

use nix::pty::openpty;

use crate::support::{Process, Sim, command};

const RIGHT: &str = "\u{1b}[C";
const LEFT: &str = "\u{1b}[D";
/// How often a keyboard repeats a key that is held down.
const REPETITION: Duration = Duration::from_millis(30);
/// No key is held for longer.
const LIMIT: Duration = Duration::from_secs(60);

/// A person at a keyboard.
struct Jog {
    keys: File,
    process: Process,
}

impl Jog {
    fn start(sim: &Sim, arguments: &[&str]) -> Self {
        let terminal = openpty(None, None).expect("a pseudo terminal");
        let arguments = [&["--port", &sim.port, "jog"], arguments].concat();
        let mut command = command(&arguments);
        command.stdin(Stdio::from(terminal.slave));
        let is_ready = |line: &str| line.contains("q ends").then_some(());
        let (process, ()) = Process::start_until(command, "the keys", is_ready);
        Self { keys: File::from(terminal.master), process }
    }

    fn press(&mut self, key: &str) {
        self.keys.write_all(key.as_bytes()).expect("it is read");
    }

    /// Holds a key down until a line is printed by `heard`; what was found in it.
    fn hold<T>(&mut self, key: &str, heard: impl Fn(&Process) -> Option<T>) -> T {
        let end = Instant::now() + LIMIT;
        loop {
            self.press(key);
            std::thread::sleep(REPETITION);
            if let Some(found) = heard(&self.process) {
                return found;
            }
            assert!(Instant::now() < end, "nothing moves");
        }
    }
}

/// Whether a state printed by `mgw jog` has this speed; it never turns the other way.
fn turns_at(wanted_rad_s: f64) -> impl Fn(&str) -> Option<()> {
    move |line| {
        let mut words = line.split_whitespace();
        let of_axis = words.next() == Some("0") && words.next() == Some("active");
        let speed = of_axis.then(|| words.nth(1))??.trim_end_matches('*');
        let speed: f64 = speed.parse().ok()?;
        assert!(speed * wanted_rad_s > -0.05, "{wanted_rad_s} rad/s: {line}");
        ((speed - wanted_rad_s).abs() < 0.06).then_some(())
    }
}

#[test]
fn an_axis_turns_while_a_key_is_held_down_and_stops_when_it_is_let_go() {
    let sim = Sim::patient();
    let mut jog = Jog::start(&sim, &["0"]);
    for (key, sign) in [(RIGHT, 1.0), (LEFT, -1.0), ("+", 1.0), ("-", -1.0)] {
        jog.hold(key, |process| process.line_that(turns_at(sign * 0.3)));
        // It is let go.
        jog.process.wait_for("its stop", |line| line.contains("stop confirmed").then_some(()));
        jog.process.wait_for("its end", |line| (line == "axis 0 is holding").then_some(()));
    }
    jog.press("q");
    assert_eq!(jog.process.wait(), Some(0));
}

#[test]
fn another_key_stops_it_and_a_tap_moves_nothing() {
    let sim = Sim::patient();
    let mut jog = Jog::start(&sim, &["0", "--velocity", "0.25"]);
    jog.press(RIGHT);
    jog.press("x");
    jog.press(LEFT);
    jog.press("x");
    jog.press("q");
    assert_eq!(jog.process.wait(), Some(0));
    let mut jog = Jog::start(&sim, &["0", "--velocity", "0.25"]);
    // The tap to the right was no motion, or it would turn that way first.
    jog.hold(LEFT, |process| process.line_that(turns_at(-0.25)));
    // The key stays down, as it were, and the space bar stops the axis.
    jog.press(&format!("{LEFT} "));
    jog.process.wait_for("its stop", |line| line.contains("stop confirmed").then_some(()));
    // As Ctrl-C does.
    jog.process.wait_for("its end", |line| (line == "axis 0 is holding").then_some(()));
    jog.hold(RIGHT, |process| process.line_that(|line| line.contains("active").then_some(())));
    assert_eq!(jog.process.interrupt(), Some(0));
    let state = sim.mgw(&["--json", "state", "0"]).json_lines();
    assert_eq!(state[0]["axes"][0]["state"], "holding");
}

#[test]
fn what_cannot_be_jogged_is_refused_before_a_key_is_asked_for() {
    let sim = Sim::start();
    for (arguments, code, wanted) in [
        (&["jog", "0"][..], 2, "standard input is none"),
        (&["jog", "9"], 1, "axis 9"),
        (&["jog", "5"], 1, "axis 5 is not configured"),
        (&["jog", "0", "--velocity", "0"], 2, "--velocity 0"),
        (&["jog", "0", "--velocity", "-1"], 2, "-1"),
        (&["jog", "0", "--velocity", "1000"], 1, "1000"),
        (&["jog", "0", "--velocity", "nan"], 2, "--velocity NaN"),
        (&["jog", "1", "--signal", "2"], 1, "2"),
        (&["jog", "0", "--signal", "0.1", "--velocity", "1"], 2, "--velocity"),
    ] {
        let outcome = sim.mgw(arguments);
        assert_eq!(outcome.stdout, "", "{arguments:?}");
        let text = outcome.failure(code);
        assert!(text.contains(wanted), "{arguments:?}: {text}");
    }
}
