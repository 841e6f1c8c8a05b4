//! `mgw record`, `mgw serve --record`, `mgw play` and `mgw plot`.

use std::fs;

use serde_json::Value;

use crate::server::Server;
use crate::support::{Process, Sim, file, mgw, mgw_reading};

/// The messages of a recording: topic and message.
fn played(arguments: &[&str]) -> Vec<(String, Value)> {
    let lines = mgw(&[&["--json", "play"], arguments].concat()).json_lines();
    lines
        .into_iter()
        .map(|mut line| (line["topic"].as_str().unwrap().to_owned(), line["message"].take()))
        .collect()
}

fn named<'a>(all: &'a [(String, Value)], event: &str) -> Vec<&'a Value> {
    all.iter().map(|(_, message)| message).filter(|of| of["event"] == event).collect()
}

/// A program commands through a server and is killed: the server's recording and a watcher's tell
/// the same trip, and what the motor did before.
#[test]
fn a_server_and_a_watcher_record_the_same_trip_of_another_program() {
    let (by_server, by_watcher) = (file("server.mcap"), file("watcher.mcap"));
    let sim = Sim::with_times(10_000_000, 1_500_000);
    let mut server = Server::start(&sim.port, &["--record", &by_server]);
    let port = server.port.clone();
    let record = ["--port", &port, "--json", "record", &by_watcher, "0", "1", "--period", "5"];
    let mut watcher = Process::start(&record);
    watcher.wait_for("the recording", |line| line.contains("\"recording\"").then_some(()));
    let through = |words: &[&str]| mgw(&[&["--port", &port], words].concat());
    through(&["cycle", "0", "velocity", "2", "--rate", "100", "--for", "0.5"]).success();
    let mut host = Process::start(&["--port", &port, "--json", "set", "0", "velocity", "2"]);
    host.wait_for("motion", |line| line.contains("\"active\"").then_some(()));
    host.kill();
    sim.await_state("0", |state| state["state"] == "tripped" && state["stop_confirmed"] == true);
    assert_eq!(watcher.interrupt(), Some(0));
    assert_eq!(server.process.interrupt(), Some(0));

    let (served, watched) = (played(&[&by_server]), played(&[&by_watcher]));
    let (trip, same) = (named(&served, "tripped"), named(&watched, "tripped"));
    assert_eq!((trip.len(), same.len()), (1, 1));
    assert_eq!(trip[0]["trip"]["reason"], "host_silent");
    assert_eq!(trip[0]["trip"], same[0]["trip"]);
    assert_eq!(trip[0]["time_us"], same[0]["time_us"]);

    // The same samples: what the watcher had is in the server's.
    let positions = |all: &[(String, Value)]| -> Vec<(u64, f64)> {
        let of_axis = all.iter().filter(|(topic, _)| topic == "/axis/0/sample");
        let reading =
            |of: &Value| Some((of["time_us"].as_u64()?, of["position_rad"]["value"].as_f64()?));
        of_axis.filter_map(|(_, message)| reading(message)).collect()
    };
    let (all, some) = (positions(&served), positions(&watched));
    assert!(some.len() > 50 && some.iter().all(|sample| all.contains(sample)), "{}", some.len());
    let turned = all.iter().map(|sample| sample.1).fold(f64::MIN, f64::max);
    assert!(turned > 0.5, "2 rad/s for half a second: {turned}");

    // What a program asked has its number, and what the gateway's own cycle told is in both.
    let asked = named(&served, "request");
    let of = |name: &str| asked.iter().filter(|of| of["request"] == name).collect::<Vec<_>>();
    let programs = |name: &str| of(name).iter().filter_map(|of| of["program"].as_u64()).max();
    assert!(programs("run_cycle") < programs("setpoint"), "{:?}", of("run_cycle"));
    assert!(of("hello").iter().any(|hello| hello["by_server"] == true));
    assert!(!named(&served, "reply").is_empty());
    for recording in [&served, &watched] {
        let periods = named(recording, "period");
        assert!(periods.len() > 20, "{}", periods.len());
        assert_eq!(periods[5]["axes"][0]["axis"], 0);
        assert!(recording.iter().all(|(_, message)| message["time_us"].is_u64()
            || message["event"] == "request"
            || message["event"] == "reply"));
    }

    // As text, as CSV, and as a picture.
    for nothing in [&["--topic", "/evnt"][..], &["--axis", "9"], &["--candump"]] {
        let told = mgw(&[&["play", &by_watcher], nothing].concat());
        assert!(told.stderr.contains("there is nothing of that in "), "{told:?}");
        assert_eq!(told.success(), "");
    }
    let text = mgw(&["play", &by_server, "--topic", "/event"]).success();
    assert!(text.contains("axis 0 tripped"), "{text}");
    let text = mgw(&["play", &by_watcher, "--topic", "/axis/0"]).success();
    assert!(text.starts_with("      time s  axis  state         position rad"), "{text}");
    let csv = mgw(&["play", &by_watcher, "--csv", "--topic", "/axis/0"]).success();
    let head = csv.lines().next().unwrap();
    assert!(head.starts_with("time_s,host_time_s,topic,axis,"), "{head}");
    assert!(head.contains(",position_rad.age_us,position_rad.value,"), "{head}");
    let samples = watched.iter().filter(|(topic, _)| topic == "/axis/0/sample");
    assert_eq!(csv.lines().count(), 1 + samples.count());
    let at = trip[0]["time_us"].as_f64().unwrap() / 1e6;
    let (from, to) = (format!("{}", at - 0.1), format!("{}", at + 0.1));
    let part = played(&[&by_server, "--from", &from, "--to", &to, "--axis", "0"]);
    assert!(part.iter().any(|(_, of)| of["event"] == "tripped") && part.len() < served.len() / 2);
    assert!(part.iter().all(|(topic, _)| !topic.starts_with("/axis/1")));
    let picture = file("trip.svg");
    mgw(&["plot", &by_server, "--axis", "0", "--output", &picture]).success();
    let svg = fs::read_to_string(&picture).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("axis 0") && svg.contains("velocity_rad_s"));
    let pixels = file("trip.png");
    mgw(&["plot", &by_server, "--axis", "0", "--output", &pixels]).success();
    assert!(fs::read(&pixels).unwrap().starts_with(b"\x89PNG\r\n"));
    let text = mgw(&["plot", &by_server, "--output", &picture]).failure(1);
    assert!(text.contains("is there already"), "{text}");
}

#[test]
fn a_killed_recording_is_readable_and_says_that_it_was_cut_off() {
    let path = file("killed.mcap");
    let sim = Sim::patient();
    let mut recorder =
        Process::start(&["--port", &sim.port, "record", &path, "0", "--period", "5"]);
    recorder.wait_for("the recording", |line| line.starts_with("recording into").then_some(()));
    sim.mgw(&["set", "0", "velocity", "2", "--for", "2.5"]).success();
    recorder.kill();
    let lines = mgw(&["--json", "play", &path]).json_lines();
    let told = lines.last().expect("lines");
    assert_eq!((&told["event"], &told["file"]), (&"cut_off".into(), &path.clone().into()));
    let fast = |line: &Value| line["message"]["velocity_rad_s"]["value"].as_f64() > Some(1.5);
    assert!(lines.iter().filter(|line| fast(line)).count() > 100, "{}", lines.len());
    let told = mgw(&["play", &path]);
    assert!(told.stderr.contains("was cut off"), "{}", told.stderr);
    told.success();
}

#[test]
fn raw_frames_of_an_open_bus_are_recorded_and_exported() {
    let path = file("bus.mcap");
    let sim = Sim::patient();
    let mut recorder = Process::start(&[
        "--port", &sim.port, "record", &path, "0", "--period", "1000", "--frames", "0",
    ]);
    recorder.wait_for("the recording", |line| line.starts_with("recording into").then_some(()));
    let text = sim.mgw(&["arm", "0", "--for", "1"]).failure(1);
    assert!(text.contains("command") || text.contains("raw"), "{text}");
    assert_eq!(recorder.interrupt(), Some(0));
    // The bus is closed again: an axis on it can be armed.
    sim.mgw_once_in_command(&["arm", "1", "--for", "0.1"]).success();
    // A server sees what is sent and fetched on an open bus.
    let by_server = file("raw.mcap");
    let mut server = Server::start(&sim.port, &["--record", &by_server]);
    mgw(&["--port", &server.port, "raw", "0", "send", "141#9A00000000000000"]).success();
    assert_eq!(server.process.interrupt(), Some(0));
    let exported = mgw(&["play", &by_server, "--candump"]).success();
    let decoded = mgw_reading(&["decode", "--json"], exported).decoded();
    let of = |direction: &str| decoded.iter().filter(|of| of["direction"] == direction).count();
    assert_eq!((of("request"), of("reply")), (1, 1), "{decoded:?}");
    assert!(decoded.iter().all(|line| line["command"] == "read_status_1"), "{decoded:?}");
}

#[test]
fn a_file_that_is_being_recorded_is_not_taken_by_another_recording() {
    let sim = Sim::patient();
    let path = file("both.mcap");
    let mut first = Process::start(&["--port", &sim.port, "--json", "record", &path, "--force"]);
    first.wait_for("the recording", |line| line.contains("\"recording\"").then_some(()));
    let text = sim.mgw(&["record", &path, "--force"]).failure(1);
    let said = format!("cannot write {path} (another program is writing it). Name another file");
    assert!(text.contains(&said), "{text}");
    assert_eq!(first.interrupt(), Some(0));
    let kept = mgw(&["--json", "play", &path]).success();
    assert!(kept.contains("/axis/0/sample") && !kept.contains("cut_off"), "{kept}");
    // What is over holds nobody back.
    sim.mgw(&["record", &path, "--force", "--for", "0.1"]).success();
}

#[test]
fn a_file_that_cannot_be_written_is_told_and_stops_nothing() {
    let path = file("there.mcap");
    fs::write(&path, "a letter").unwrap();
    let sim = Sim::patient();
    let text = sim.mgw(&["record", &path, "0"]).failure(1);
    assert!(text.contains("is there already") && text.contains("--force"), "{text}");
    assert_eq!(fs::read_to_string(&path).unwrap(), "a letter");
    // Nor is it for a recording that cannot begin, or that would end at a file of another one.
    let words = ["--port", &sim.port, "--json", "set", "0", "velocity", "2", "--for", "60"];
    let mut host = Process::start(&words);
    host.await_motion();
    sim.mgw(&["record", &path, "--frames", "0", "--force"]).failure(1);
    host.interrupt();
    assert_eq!(fs::read_to_string(&path).unwrap(), "a letter");
    let (first, second) = (file("long.mcap"), file("long.2.mcap"));
    fs::write(&second, "a letter").unwrap();
    let text = sim.mgw(&["record", &first, "0", "--for", "0.1"]).failure(1);
    assert!(text.contains("long.2.mcap is there already"), "{text}");
    assert!(!fs::exists(&first).unwrap());
    let text = sim.mgw(&["record", "/nowhere/run.mcap"]).failure(1);
    assert!(text.contains("cannot write /nowhere/run.mcap"), "{text}");
    let text = mgw(&["play", &path]).failure(2);
    assert!(text.contains("no MCAP file"), "{text}");
    let text = mgw(&["plot", &path, "--output", "x.jpg"]).failure(2);
    assert!(text.contains("x.jpg: pictures are SVG or PNG; name a file that ends in"), "{text}");
    if !cfg!(target_os = "linux") {
        return;
    }
    let text = sim.mgw(&["record", "/dev/full", "--force", "0"]).failure(1);
    assert!(text.contains("cannot write /dev/full (No space left"), "{text}");
    // A server goes on without its recording; what it cannot begin it does not.
    let arguments = ["--port", &sim.port, "serve", "--listen", "127.0.0.1:0", "--socket"];
    let socket = file("full.sock");
    let text =
        mgw(&[&arguments[..], &[&socket, "--record", "/dev/full", "--force"]].concat()).failure(1);
    assert!(text.contains("No space left"), "{text}");
}
