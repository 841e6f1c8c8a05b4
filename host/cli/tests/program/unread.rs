//! Standard output that nobody reads, whose reader goes, or that takes nothing.

use std::fs::File;
use std::io::{PipeReader, PipeWriter, Write, pipe};
use std::os::unix::process::ExitStatusExt;
use std::process::Stdio;
use std::time::{Duration, Instant};

use nix::fcntl::{FcntlArg, fcntl};
use nix::sys::signal::Signal;

use crate::support::{Process, Sim, file, json, mgw, mgw_cut_short};

/// What a pipe holds at least.
const PIPE: i32 = 4_096;
/// No wait is longer.
const LIMIT: Duration = Duration::from_secs(60);
/// Enough for the line of the arming, not for the table of states.
const ROOM: usize = 200;

/// A pipe that is nearly full.
fn full_pipe(room: usize) -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = pipe().expect("a pipe");
    let size = fcntl(&writer, FcntlArg::F_SETPIPE_SZ(PIPE)).expect("a small pipe");
    let filler = vec![b'\n'; usize::try_from(size).unwrap() - room];
    writer.write_all(&filler).expect("there is room");
    (reader, writer)
}

/// A command that turns an axis and whose output nobody reads.
fn turning(sim: &Sim, output: PipeWriter) -> Process {
    let arguments = ["--port", &sim.port, "set", "0", "velocity", "2"];
    let process = Process::printing_to(output, &arguments);
    sim.process.wait_for("motion", |line| line.contains("moving").then_some(()));
    process
}

#[test]
fn ctrl_c_stops_although_nobody_reads() {
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        let sim = Sim::patient();
        let (_reader, writer) = full_pipe(ROOM);
        let mut host = turning(&sim, writer);
        assert_eq!(host.signal(signal), Some(0), "{signal}");
        let state = sim.await_state("0", |_| true);
        assert_eq!(state["state"], "holding", "{signal}: {state}");
    }
}

#[test]
fn a_second_signal_ends_it_whatever_it_waits_for() {
    let mut sim = Sim::patient();
    let (_reader, writer) = full_pipe(ROOM);
    let mut host = turning(&sim, writer);
    sim.typed("motor 0 mute");
    assert_eq!(host.insist(Signal::SIGINT).signal(), Some(Signal::SIGINT as i32));
}

/// A server's log waits for its reader; what programs ask it does not.
#[test]
fn a_server_whose_log_nobody_reads_serves() {
    let sim = Sim::patient();
    let socket = file("unread.sock");
    let (_reader, writer) = full_pipe(ROOM + socket.len());
    let words = ["--port", &sim.port, "serve", "--listen", "127.0.0.1:0", "--socket", &socket];
    let _server = Process::printing_to(writer, &words);
    let port = format!("unix:{socket}");
    let served = |words: &[&str]| mgw(&[&["--port", &port], words].concat());
    let end = Instant::now() + LIMIT;
    while served(&["info"]).code != Some(0) {
        assert!(Instant::now() < end, "nobody is served");
    }
    // Each leaves a line: it was in command, and has gone.
    for _ in 0..3 {
        served(&["set", "0", "velocity", "2", "--for", "0.1"]).success();
    }
    served(&["stop"]).success();
}

/// Of a stop that is not confirmed.
const NOT_CONFIRMED: &str = "E-stop-not-confirmed";

#[test]
fn a_verdict_outlives_its_reader() {
    let mut sim = Sim::patient();
    sim.half_configure(7, "bus = 0\n");
    let nothing = file("nothing.toml");
    std::fs::write(&nothing, "[gateway]\n").expect("a file");
    let cut_short = |words: &[&str], lines| {
        let arguments = [&["--port", &sim.port], words].concat();
        mgw_cut_short(&arguments, Stdio::null(), lines)
    };
    let said = cut_short(&["config", "diff", &nothing], 0).failure(1);
    assert!(said.contains("settings other than"), "{said}");
    let said = cut_short(&["doctor"], 0).failure(1);
    assert!(said.contains("wrong"), "{said}");
    assert_eq!(cut_short(&["info"], 0).code, Some(0));
    sim.typed("motor 0 mute");
    let arguments = ["--port", &sim.port, "stop", "0"];
    let said = mgw_cut_short(&arguments, Stdio::null(), 0).failure(3);
    assert!(said.contains(NOT_CONFIRMED), "{said}");
}

#[test]
fn a_motion_whose_reader_goes_is_stopped_and_no_success() {
    let sim = Sim::patient();
    for words in [
        "move 0 20 --speed-limit 1",
        "set 0 velocity 2 --for 60",
        "cycle 0 velocity 2 --rate 100 --for 60",
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let arguments = [&["--json", "--port", &sim.port], &*words].concat();
        let outcome = mgw_cut_short(&arguments, Stdio::null(), 1);
        let error = json(&outcome.failure(1));
        assert_eq!(error["error"]["name"], "cut_short", "{words:?}");
        let state = sim.await_state("0", |_| true);
        assert_eq!(state["state"], "holding", "{words:?}: {state}");
    }
}

/// Nobody reads what they print: they do what they are for all the same, or fail.
#[test]
fn what_is_written_and_changed_needs_no_reader() {
    let sim = Sim::patient();
    let cut_short = |words: &[&str]| {
        let arguments = [&["--port", &sim.port], words].concat();
        mgw_cut_short(&arguments, Stdio::null(), 0)
    };
    let found = file("found.toml");
    assert_eq!(
        cut_short(&["--json", "adopt", "0", "--listen", "0", "--output", &found]).code,
        Some(0)
    );
    assert!(std::fs::read_to_string(&found).expect("it is written").contains("[[bus]]"));

    let recorded = file("unread.mcap");
    let record = ["record", &recorded, "0", "--period", "5", "--for", "0.5"];
    assert_eq!(cut_short(&record).code, Some(0));
    let played = mgw(&["--json", "play", &recorded]).json_lines();
    assert!(played.len() > 10, "{played:?}");

    let lock = ["motor", "0", "brake", "lock", "--yes"];
    let said = sim.mgw_once_in_command(&lock).failure(1);
    assert!(said.contains("status does not say so"), "{said}");
    let said = cut_short(&lock).failure(1);
    assert!(said.contains("status does not say so"), "{said}");
}

#[test]
fn undecoded_lines_are_a_failure_without_a_reader() {
    let path = file("undecoded.log");
    std::fs::write(&path, "zz\n".repeat(1_000)).expect("a file");
    let said = mgw_cut_short(&["decode", &path], Stdio::null(), 0).failure(1);
    assert!(said.contains("no frame that could be decoded"), "{said}");
}

#[test]
fn a_full_disk_is_told_and_hides_no_other_failure() {
    let mut sim = Sim::patient();
    let full = || File::options().write(true).open("/dev/full").expect("it is there");
    let port = sim.port.clone();
    let mut info = Process::printing_to(full(), &["--port", &port, "info"]);
    info.wait_for("the failure", |line| {
        line.contains("standard output: No space left on device").then_some(())
    });
    assert_eq!(info.wait(), Some(1));
    sim.typed("motor 0 mute");
    let mut stop = Process::printing_to(full(), &["--port", &port, "stop", "0"]);
    stop.wait_for("the failure", |line| line.contains(NOT_CONFIRMED).then_some(()));
    assert_eq!(stop.wait(), Some(3));
}
