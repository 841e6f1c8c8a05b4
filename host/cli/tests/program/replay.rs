//! `mgw replay`, and `mgw sim --flight-recorder`.

use std::fs;
#[cfg(unix)]
use std::os::unix::fs::PermissionsExt;

use flight_recorder::Recording;
#[cfg(unix)]
use host_protocol::Trip;
#[cfg(unix)]
use mgw_cli::flight::OnImage;

use crate::support::{Sim, file, json, mgw};

/// Presses the e-stop while an axis turns, and returns what led to the trip.
fn trip() -> String {
    let kept = file("trip.mgfr");
    let mut sim = Sim::with(&["--flight-recorder", &kept]);
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
        line.contains(&format!("what led to it is in {kept}")).then_some(())
    });
    assert!(set.join().unwrap().contains("axis 0"));
    kept
}

#[test]
fn what_led_to_a_trip_is_played_again_to_the_same_microsecond() {
    let kept = &trip();

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
    let kept = trip();
    let whole = fs::read(&kept).unwrap();
    let refused = |bytes: &[u8]| {
        fs::write(&kept, bytes).unwrap();
        mgw(&["replay", &kept]).failure(1)
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
    let text = mgw(&["replay", "no/such.mgfr"]).failure(2);
    assert!(text.contains("cannot read no/such.mgfr"), "{text}");
    let error = json(&mgw(&["--json", "replay", "no/such.mgfr"]).failure(2));
    assert_eq!(error["error"]["name"], "file");
}

/// Sources of a firmware whose virtual board answers what it is told to, and exits so.
#[cfg(unix)]
fn sources(name: &str, answer: &str, code: i32) -> String {
    let folder = file(name);
    fs::create_dir_all(format!("{folder}/.ci")).unwrap();
    let player = format!("{folder}/.ci/virtual-board");
    let text = format!(
        "#!/bin/sh\n[ $# = 2 ] && [ \"$1\" = replay ] && [ -f \"$2\" ] || exit 9\n\
                        echo '{answer}'\nexit {code}\n"
    );
    fs::write(&player, text).unwrap();
    fs::set_permissions(&player, fs::Permissions::from_mode(0o755)).unwrap();
    folder
}

#[cfg(unix)]
#[test]
fn what_the_image_made_of_it_is_told_behind_what_the_core_made_of_it() {
    let kept = &trip();
    let recorded = Recording::trip_of(&fs::read(kept).unwrap()).unwrap();
    let late = |us: u64| {
        let played = Trip { time_us: recorded.1.time_us + us, ..recorded.1 };
        let left_out = vec!["lost frames".to_owned()];
        OnImage { recorded, played: Some(played), causes: 7, left_out }
    };
    let words = |played: Result<OnImage, &str>| serde_json::to_string(&played).unwrap();
    let answer = |us| words(Ok(late(us)));

    let folder = &sources("same", &answer(150), 0);
    let text = mgw(&["replay", kept, "--image", folder]).success();
    let lines: Vec<&str> = text.lines().rev().take(3).collect();
    assert!(lines[0].starts_with("on image  t="), "{text}");
    assert!(lines[0].ends_with("; 150 us later than recorded"), "{text}");
    assert_eq!(lines[1], "left out  lost frames");
    assert!(lines[2].starts_with("the same; the recording ends "), "{text}");
    let lines = mgw(&["--json", "replay", kept, "--image", folder]).json_lines();
    let last = lines.last().unwrap();
    assert_eq!(last["event"], "replayed_on_image");
    assert_eq!((&last["late_us"], &last["is_same"]), (&150.into(), &true.into()));
    assert_eq!(last["played"]["reason"], "e_stop");

    for (answer, code, expected) in [
        (answer(201), 0, "the image does not trip as was recorded"),
        (words(Err("the bus was open")), 0, "mgfr: the bus was open"),
        ("nothing".to_owned(), 0, "virtual-board replay: expected"),
        (answer(0), 1, "exit status: 1; it says above why"),
    ] {
        let folder = sources("otherwise", &answer, code);
        let text = mgw(&["replay", kept, "--image", &folder]).failure(1);
        assert!(text.contains(expected), "{text}");
    }
    let text = mgw(&["replay", kept, "--image", "/tmp"]).failure(1);
    assert!(text.contains("/tmp holds no sources of the firmware"), "{text}");
}

#[test]
fn a_file_that_cannot_be_written_is_refused_before_anything_moves() {
    let notes = &file("notes");
    fs::write(notes, "what nobody wants to lose").unwrap();
    for path in ["/dev/full", "/no/such/folder/trip.mgfr", "/tmp", notes] {
        let text = mgw(&["sim", "--listen", "127.0.0.1:0", "--flight-recorder", path]).failure(2);
        assert!(text.contains(&format!("{path} cannot be the file")), "{text}");
    }
    assert_eq!(fs::read_to_string(notes).unwrap(), "what nobody wants to lose");
}
