//! Motors that echo and do not do it: what they have not shown is not told as done.

use host_protocol::Protocol::{Rmd, Thruster};
use mgw_sim::Injection;

use crate::rig::{Cut, MOTOR, Rig};

const V3_9: u8 = 3;
const V4_4: u8 = 6;

/// Runs a command that the motor does not confirm.
fn not_confirmed(rig: &Rig, cut: Cut, typed: &str) -> String {
    let words: Vec<&str> = typed.split_whitespace().chain(["--yes"]).collect();
    let (outcome, _) = rig.run_until(cut, &words);
    let (name, text) = outcome.failure.expect("it fails");
    assert_eq!(name, "NotConfirmed", "{text}");
    text
}

#[test]
fn what_a_motor_echoes_and_does_not_store_is_not_told_as_done() {
    let rig = Rig::with(&[(0, Rmd, 1, V4_4)]);
    for typed in
        ["config bus 0 bitrate=1000000 protocols=rmd", "raw 0 --unsafe send 141#8100000000000000"]
    {
        let words: Vec<&str> = typed.split_whitespace().collect();
        assert_eq!(rig.run(&words).exit_code, 0, "{typed}");
    }
    // Its output stays on, so that it stores nothing.
    rig.world.borrow_mut().inject(MOTOR, Injection::StoresOnlyOff(true));
    rig.world.borrow_mut().inject(MOTOR, Injection::IgnoreStop(true));
    let typed = "motor 0:1 acceleration velocity_acceleration_dps2=3000";
    let text = not_confirmed(&rig, Cut::Never, typed);
    assert!(text.contains("velocity_acceleration_dps2 is 11459 and not 3000"), "{text}");
}

#[test]
fn a_motor_that_has_its_new_id_after_a_restart_only_has_not_shown_it_before() {
    let rig = Rig::with(&[(0, Rmd, 1, V4_4)]);
    rig.world.borrow_mut().inject(MOTOR, Injection::IgnoreRestart(true));
    // It answers from the new id already, and hears on the old one.
    let text = not_confirmed(&rig, Cut::Never, "motor 0:1@1000000 id 2");
    assert!(text.contains("it has not shown itself as 2 alone"), "{text}");
    // As that says.
    rig.world.borrow_mut().power_cycle(MOTOR);
    assert!(rig.finds("0:rmd:2@1000000"));
}

#[test]
fn a_motor_that_has_missed_the_frame_of_its_new_id_keeps_the_old_one() {
    // The thruster acknowledges what the motor misses.
    let rig = Rig::with(&[(0, Rmd, 1, V3_9), (0, Thruster, 11, 0)]);
    let typed = "motor 0:1@1000000 id 2";
    assert_eq!(rig.run(&["motor", "0:1@1000000", "id", "2", "--yes"]).exit_code, 0);
    let at = rig.sent.borrow().iter().position(|frame| frame.starts_with("300#79")).unwrap();
    let rig = Rig::with(&[(0, Rmd, 1, V3_9), (0, Thruster, 11, 0)]);
    let text = not_confirmed(&rig, Cut::Frame(at + 1), typed);
    assert!(rig.sent.borrow()[at].starts_with("300#79"));
    assert!(text.contains("it still answers as 1"), "{text}");
    assert!(rig.finds("0:rmd:1@1000000"));
    rig.assert_still();
}
