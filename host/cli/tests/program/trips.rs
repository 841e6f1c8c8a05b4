//! `mgw trips show`: what a gateway's flight recorder has kept, read over the host link.

use std::fs;
use std::path::Path;

use flight_recorder::Recording;
use host_protocol::replies::{FlightRecordPage, MAX_FLIGHT_RECORD_BYTES};
use host_protocol::{Reply, Request};

use crate::hostile_text::hostile_reply;
use crate::server::Server;
use crate::support::{Outcome, Process, Sim, file, json, mgw, scripted_gateway};

/// Presses the e-stop while axis 0 is armed: it trips, and nothing moves any more.
fn trip(sim: &mut Sim) {
    let mut host = Process::start(&["--port", &sim.port, "arm", "0"]);
    host.wait_for("the arming", |line| line.contains("is armed").then_some(()));
    sim.process.type_line("e-stop press");
    sim.await_state("0", |state| state["state"] == "tripped");
    host.wait();
}

/// Makes an axis that has tripped idle again.
fn clear(sim: &mut Sim) {
    sim.process.type_line("e-stop release");
    sim.await_state("0", |state| state["stop_confirmed"] == true);
    let end = std::time::Instant::now() + std::time::Duration::from_secs(60);
    while sim.mgw(&["clear", "gateway"]).stdout.is_empty() {
        assert!(std::time::Instant::now() < end, "the e-stop stays latched");
    }
    sim.mgw_once_in_command(&["clear", "0"]).success();
}

fn show(sim: &Sim, arguments: &[&str]) -> Outcome {
    sim.mgw(&[&["trips", "show"], arguments].concat())
}

#[test]
fn what_led_to_a_trip_is_read_shown_and_kept() {
    let mut sim = Sim::patient();
    let text = show(&sim, &[]).failure(1);
    assert!(text.contains("the flight recorder has kept nothing"), "{text}");
    assert!(text.ends_with("[E-flight-recorder]\n"), "{text}");
    let text = show(&sim, &["0"]).failure(1);
    assert!(text.contains("there is no trip 0: the gateway remembers 0"), "{text}");

    trip(&mut sim);
    let shown = show(&sim, &[]).success();
    assert!(shown.contains("axis 0 trips: emergency stop"), "{shown}");
    assert!(shown.lines().any(|line| line.contains("bus 0  > 0x141#81")), "{shown}");
    assert!(shown.lines().last().unwrap().starts_with("the same; the recording ends "), "{shown}");
    assert_eq!(show(&sim, &["0"]).success(), shown, "it is the latest trip");

    // The file says the same.
    let kept = &file("shown");
    let saved = show(&sim, &["--around", "0.005", "--save", kept]);
    assert!(saved.stderr.contains(&format!("what led to it is in {kept}")), "{saved:?}");
    assert_eq!(mgw(&["replay", kept, "--around", "0.005"]).success(), saved.success());
    let lines = sim.mgw(&["--json", "trips", "show", "0", "--save", kept]).json_lines();
    assert_eq!(mgw(&["--json", "replay", kept]).json_lines(), lines);
    assert_eq!(lines.last().unwrap()["is_same"], true);

    // What is no recording is not overwritten, and the recorder is not even asked.
    let notes = &*file("notes-of-somebody");
    fs::write(notes, "what nobody wants to lose").unwrap();
    for path in [notes, "/no/such/folder/trip.mgfr"] {
        let text = show(&sim, &["--save", path]).failure(1);
        assert!(text.contains(&format!("cannot write {path} (")), "{text}");
    }
    assert_eq!(fs::read_to_string(notes).unwrap(), "what nobody wants to lose");
}

#[test]
fn it_keeps_one_trip_until_an_axis_is_armed_again() {
    let mut sim = Sim::patient();
    trip(&mut sim);
    clear(&mut sim);
    let mut host = Process::start(&["--port", &sim.port, "arm", "0"]);
    host.wait_for("the arming", |line| line.contains("is armed").then_some(()));
    let text = show(&sim, &[]).failure(1);
    assert!(text.contains("the flight recorder records, as an axis is armed"), "{text}");
    let error = json(&sim.mgw(&["--json", "trips", "show"]).failure(1));
    assert_eq!(error["error"]["name"], "flight_recording");
    assert_eq!(error["error"]["explain"], "E-flight-recorder");
    host.interrupt();
    host.wait();
    sim.await_state("0", |state| state["state"] == "idle" || state["state"] == "holding");
    let text = show(&sim, &["0"]).failure(1);
    assert!(text.contains("has kept nothing: no axis has tripped since"), "{text}");

    trip(&mut sim);
    assert!(show(&sim, &["0"]).success().contains("the same"));
    let kept = file("not-this-one");
    let text = show(&sim, &["1", "--save", &kept]).failure(1);
    assert!(text.contains("keeps one trip: trip 0, that of axis 0 at t="), "{text}");
    assert!(text.contains("and not that of axis 0 at t="), "{text}");
    assert!(!Path::new(&kept).exists(), "it was not asked for");
    let text = show(&sim, &["2"]).failure(1);
    assert!(text.contains("there is no trip 2: the gateway remembers 2"), "{text}");
}

#[test]
fn programs_of_a_server_read_it_side_by_side() {
    let mut sim = Sim::patient();
    let server = Server::start(&sim.port, &[]);
    trip(&mut sim);
    let shown = show(&sim, &[]).success();
    let port = server.port.as_str();
    std::thread::scope(|scope| {
        let programs: Vec<_> = (0..3)
            .map(|_| scope.spawn(move || mgw(&["--port", port, "trips", "show"]).success()))
            .collect();
        for program in programs {
            assert_eq!(program.join().unwrap(), shown);
        }
    });
}

/// The same recording with a copy of the core that lacks its last byte, as of a build that has
/// another one.
fn of_another_build(file: &[u8]) -> Vec<u8> {
    let checksum_and_one = 5;
    file[..file.len() - checksum_and_one].to_vec()
}

/// A gateway that has kept this.
fn keeps(memory: Vec<u8>) -> String {
    scripted_gateway(move |request| {
        let Request::ReadFlightRecord(read) = request else { return hostile_reply(request) };
        let from = usize::try_from(read.offset).unwrap();
        Reply::ReadFlightRecord(FlightRecordPage {
            id: 1,
            parts: 1,
            length: u32::try_from(memory.len()).unwrap(),
            bytes: memory[from..].iter().copied().take(MAX_FLIGHT_RECORD_BYTES).collect(),
        })
    })
}

#[test]
fn what_another_build_has_recorded_is_told_and_kept() {
    let mut sim = Sim::patient();
    trip(&mut sim);
    let path = &file("another-build");
    show(&sim, &["--save", path]).success();
    let memory = of_another_build(&fs::read(path).unwrap());
    fs::remove_file(path).unwrap();

    let ours = env!("CARGO_PKG_VERSION");
    let builds = format!("recorded by simulated {ours} (simulator), and this is mgw {ours}");
    let port = keeps(memory.clone());
    let text = mgw(&["--port", &port, "trips", "show"]).failure(1);
    assert!(text.contains("the core of this program cannot go on from it"), "{text}");
    assert!(text.contains(&builds), "{text}");
    assert!(text.contains("--save FILE"), "{text}");
    let port = keeps(memory.clone());
    let text = mgw(&["--port", &port, "trips", "show", "--save", path]).failure(1);
    assert!(text.contains(&builds) && text.contains(&format!("is in {path}")), "{text}");
    let saved = fs::read(path).unwrap();
    assert_eq!(saved, [&memory[..], &Recording::checksum(&memory)].concat());
    assert!(mgw(&["replay", path]).failure(1).contains(&builds));
}
