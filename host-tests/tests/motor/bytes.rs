//! The frames that change a motor, byte by byte.

use host_protocol::Protocol::{D5, Rmd, Thruster};

use crate::rig::Rig;

/// V3.6, V3.9 and V4.4 by their numbers.
const V3_6: u8 = 1;
const V3_9: u8 = 3;
const V4_4: u8 = 6;

/// What is typed for the first motor, and the frames of it that do more than read, in their order.
fn sends(motors: &[(u8, host_protocol::Protocol, u8, u8)], typed: &str, frames: &[&str]) {
    let rig = Rig::with(motors);
    let words: Vec<&str> = typed.split_whitespace().chain(["--yes"]).collect();
    let outcome = rig.run(&words);
    assert_eq!(outcome.exit_code, 0, "{typed}: {outcome:?}");
    let sent = rig.sent.borrow();
    let changes: Vec<&str> =
        sent.iter().map(String::as_str).filter(|frame| changes(frame)).collect();
    assert_eq!(changes, frames, "{typed}");
    rig.assert_still();
}

/// Whether a frame is none of the reads that a scan and a command ask.
fn changes(frame: &str) -> bool {
    let data = frame.split_once('#').map_or(frame.get(6..).unwrap_or_default(), |(_, data)| data);
    let reads = [
        "30", "42", "62", "9A", "9C", "B1", "B2", "B5", "4546", "5250", "5141", "5150", "5154",
        "5156",
    ];
    // A byte or a word of registers.
    let is_d5_read =
        data.starts_with("D5") && matches!(data.get(4..8), Some("0402") | Some("0502"));
    !is_d5_read && !reads.iter().any(|read| data.starts_with(read))
}

#[test]
fn an_rmd_of_v4_4() {
    let motors = [(0, Rmd, 1, V4_4)];
    let off = "141#8000000000000000";
    sends(
        &motors,
        "motor 0:1@1000000 id 2",
        &[off, "141#2005000002000000", "141#7600000000000000"],
    );
    sends(&motors, "motor 0:1@1000000 bitrate 500000", &[off, "141#B400000000000001"]);
    sends(&motors, "motor 0:1@1000000 pid speed_kp=0.25", &[off, "141#320400000000803E"]);
    sends(&motors, "motor 0:1@1000000 pid speed_kp=0.25 --ram", &[off, "141#310400000000803E"]);
    sends(
        &motors,
        "motor 0:1@1000000 acceleration velocity_deceleration_dps2=3000",
        &[off, "141#43030000B80B0000"],
    );
    sends(
        &motors,
        "motor 0:1@1000000 zero -1000",
        &[off, "141#6300000018FCFFFF", off, "141#7600000000000000"],
    );
    sends(
        &motors,
        "motor 0:1@1000000 zero here",
        &[off, "141#6400000000000000", off, "141#7600000000000000"],
    );
    sends(&motors, "motor 0:1@1000000 timeout 300", &[off, "141#B30000002C010000"]);
    sends(&motors, "motor 0:1@1000000 reset", &[off, "141#7600000000000000"]);
    sends(&motors, "motor 0:1@1000000 function fault-recovery on", &[off, "141#2008000001000000"]);
    sends(
        &motors,
        "motor 0:1@1000000 function multi-turn-saving off",
        &[off, "141#2004000000000000"],
    );
    sends(&motors, "motor 0:1@1000000 brake release", &[off, "141#7700000000000000"]);
}

#[test]
fn an_rmd_of_older_dialects() {
    let off = "141#8000000000000000";
    // 0x79 has an id of its own, which every RMD hears.
    let v3_9 = [(0, Rmd, 1, V3_9)];
    sends(&v3_9, "motor 0:1@1000000 id 2", &[off, "300#7900000000000002"]);
    sends(&v3_9, "motor 0:1@1000000 bitrate 500000", &[off, "141#B400000000000000"]);
    sends(&v3_9, "motor 0:1@1000000 pid speed_kp=86", &[off, "141#3200551956195519"]);
    let v3_6 = [(0, Rmd, 1, V3_6)];
    sends(
        &v3_6,
        "motor 0:1@1000000 acceleration position_acceleration_dps2=5000 \
            velocity_acceleration_dps2=3000",
        &[off, "141#4300000088130000", off, "141#43020000B80B0000"],
    );
    let line = [(2, Rmd, 1, V3_9)];
    sends(
        &line,
        "motor 2:rmd:1@115200 id 2",
        &["3E01088000000000000000F369", "3ECD0879000000000000027885"],
    );
}

#[test]
fn a_thruster() {
    let motors = [(0, Thruster, 11, 0)];
    // One that is new to its axis hears its stop first.
    let off = "30B#5443000000000000";
    sends(&motors, "motor 0:thruster:11@1000000 id 12", &[off, "30B#434900000000000C"]);
    sends(&motors, "motor 0:thruster:11@1000000 bitrate 500000", &[off, "30B#43420000000001F4"]);
    sends(&motors, "motor 0:thruster:11@1000000 timeout 500", &[off, "30B#53540000000001F4"]);
    sends(
        &motors,
        "motor 0:thruster:11@1000000 limits reverse_limit_deg=-90 forward_limit_deg=45.5",
        &[off, "30B#53504C41FC7C01C7"],
    );
    sends(&motors, "motor 0:thruster:11@1000000 zero here", &[off, "30B#415A000000000000"]);
    sends(&motors, "motor 0:thruster:11@1000000 clear-faults", &[off, "30B#43460000"]);
    sends(&motors, "motor 0:thruster:11@1000000 returns 0 7", &[off, "30B#564D000000000007"]);
    sends(&motors, "motor 0:thruster:11@1000000 stream 3 100", &[off, "30B#5352000000030064"]);
    sends(&motors, "motor 0:thruster:11@1000000 reports medium", &[off, "30B#4D4D0000"]);
    sends(&motors, "motor 0:thruster:11@1000000 reports off", &[off, "30B#4D510000"]);
}

#[test]
fn a_d5() {
    let motors = [(1, D5, 11, 0)];
    sends(&motors, "motor 1:11@210526 id 13", &["00B#D50B0503030D0023"]);
    sends(&motors, "motor 1:11@210526 ack-level 1", &["00B#D50B040310010023"]);
    sends(&motors, "motor 1:11@210526 reply-delay 34", &["00B#D50B040305220039"]);
    sends(&motors, "motor 1:11@210526 acceleration acceleration=100", &["00B#D50B04031564008B"]);
    sends(&motors, "motor 1:11@210526 timeout 0", &["00B#D50B040311000023"]);
    sends(&motors, "motor 1:11@210526 clear-faults", &["00B#D50B04031901002C"]);
    sends(&[(1, D5, 13, 0)], "motor 1:13@210526 reset", &["00D#D50D050600000018"]);
}
