//! `mgw replay`, and `mgw sim --flight-recorder`.

use std::fs;
use std::path::PathBuf;

use flight_recorder::Recording;

use crate::support::{Sim, json, mgw};

fn file(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("mgw-{}-{name}.mgfr", std::process::id()));
    let _ = fs::remove_file(&path);
    path
}

/// Presses the e-stop while an axis turns, and returns what led to the trip.
fn trip(name: &str) -> PathBuf {
    let kept = file(name);
    let mut sim = Sim::with(&["--flight-recorder", kept.to_str().unwrap()]);
    // A busy machine may hold the host up.
    sim.mgw(&["config", "gateway", "link_silence_us=10000000"]).success();
    sim.mgw(&["config", "axis", "0", "ttl_us=10000000"]).success();
    let port = sim.port.clone();
    let set = std::thread::spawn(move || {
        mgw(&["--port", &port, "set", "0", "velocity", "2", "--for", "30"]).failure(1)
    });
    sim.await_state("0", |state| state["state"] == "active");
    sim.process.type_line("e-stop press");
    sim.process.wait_for("what led to the trip", |line| {
        line.contains(&format!("what led to it is in {}", kept.display())).then_some(())
    });
    assert!(set.join().unwrap().contains("axis 0"));
    kept
}

#[test]
fn what_led_to_a_trip_is_played_again_to_the_same_microsecond() {
    let kept = trip("played");
    let kept = kept.to_str().unwrap();

    let text = mgw(&["replay", kept]).success();
    assert!(text.lines().last().unwrap().starts_with("the same; the recording ends "), "{text}");
    assert!(text.contains("axis 0 trips: emergency stop"), "{text}");
    let stop = text.lines().find(|line| line.contains("bus 0  > 0x141#81")).unwrap();
    assert!(stop.starts_with("t="), "{stop}");

    let lines = mgw(&["--json", "replay", kept, "--around", "0.001"]).json_lines();
    let last = lines.last().unwrap();
    assert_eq!(last["event"], "replayed");
    assert_eq!((&last["is_same"], &last["axis"]), (&true.into(), &0.into()));
    assert_eq!(last["recorded"]["reason"], "e_stop");
    assert_eq!(last["recorded"]["time_us"], last["played"]["time_us"]);
    let tripped_us = last["recorded"]["time_us"].as_u64().unwrap();
    let first = lines.first().unwrap();
    assert_eq!(first["event"], "replayed_line");
    assert!(first["time_us"].as_u64().unwrap() >= tripped_us - 1_000, "{first}");
    // All of it is more than the moment of the trip, however soon after the arming that was.
    let lines = |around| mgw(&["replay", kept, "--around", around]).success().lines().count();
    assert!(lines("10") > lines("0.000001"));
}

#[test]
fn what_is_no_recording_or_plays_otherwise_is_refused_by_name() {
    let kept = trip("refused");
    let whole = fs::read(&kept).unwrap();
    let refused = |bytes: &[u8]| {
        fs::write(&kept, bytes).unwrap();
        mgw(&["replay", kept.to_str().unwrap()]).failure(1)
    };
    assert!(refused(b"").contains("it is empty: nothing has tripped yet"));
    for bytes in [&b"MGF"[..], &[0; 1_000]] {
        assert!(refused(bytes).contains("no recording of a flight recorder"), "{}", refused(bytes));
    }
    let mut damaged = whole.clone();
    damaged[10] ^= 1;
    for bytes in [&b"MGFR"[..], &whole[..whole.len() / 4], &damaged] {
        assert!(refused(bytes).contains("damaged, or lacks its end"), "{}", refused(bytes));
    }
    // Whoever takes the calls out of it has no trip any more.
    let mut record = whole[..whole.len() - 4].to_vec();
    let calls = Recording::read(&record).unwrap().halves[0].bytes();
    let begin = calls.as_ptr().addr() - record.as_ptr().addr();
    record[begin] = 0x1E;
    record.extend(Recording::checksum(&record));
    let text = refused(&record);
    assert!(text.contains("this core does not trip as was recorded"), "{text}");

    let text = mgw(&["replay", "/dev/zero"]).failure(1);
    assert!(text.contains("longer than the memory of any flight recorder"), "{text}");
    let text = mgw(&["replay", "no/such.mgfr"]).failure(1);
    assert!(text.contains("cannot read no/such.mgfr"), "{text}");
    let error = json(&mgw(&["--json", "replay", "no/such.mgfr"]).failure(1));
    assert_eq!(error["error"]["name"], "file");
}

#[test]
fn a_file_that_cannot_be_written_is_refused_before_anything_moves() {
    let notes = file("notes");
    fs::write(&notes, "what nobody wants to lose").unwrap();
    for path in ["/dev/full", "/no/such/folder/trip.mgfr", "/tmp", notes.to_str().unwrap()] {
        let text = mgw(&["sim", "--listen", "127.0.0.1:0", "--flight-recorder", path]).failure(2);
        assert!(text.contains(&format!("{path} cannot be the file")), "{text}");
    }
    assert_eq!(fs::read_to_string(&notes).unwrap(), "what nobody wants to lose");
}
