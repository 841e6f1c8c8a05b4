//! Everything that must stop a motor, stops it.

use crate::bench::{
    self, HOLD, VELOCITY, assert_tripped, listed, move_axis, run_with_host, state, stop,
};
use crate::rig::{Instead, Rig};
use host_protocol::{AxisState, Protocol, Request, StopAction, StopTarget, TripReason, requests};

/// Reads the speed (RMD V3.6 §2.13).
const SPEED: &str = "141#9C00000000000000";

#[test]
fn a_late_reply_to_motion_is_not_taken_for_the_stops() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    rig.run(20_500); // a refresh is under way, unanswered
    let since = rig.now_us;
    stop(&mut rig);
    rig.receive(0, "241#A2326400F4012D00");
    rig.run(300);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert!(!state(&mut rig).stop_acknowledged);
}

#[test]
fn a_stop_that_is_acknowledged_but_never_stands_still_trips() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    run_with_host(&mut rig, 10_000_000);
    assert_tripped(&mut rig, TripReason::StopUnconfirmed, false);
}

#[test]
fn stopping_all_leaves_an_axis_alone_whose_bus_does_not_run() {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    bench::configure_axis(&mut rig, 0, 0, Protocol::Rmd, 1, StopAction::Hold);
    rig.ask(Request::Stop(requests::Stop { target: StopTarget::All })).unwrap();
    run_with_host(&mut rig, 1_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
}

/// How often the speed is still read until the stop is confirmed, when the answer to the second
/// reading is `late`.
fn readings_after(late: &str) -> usize {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(1_000);
    let mut polls = 0;
    rig.instead(move |text| {
        polls += u32::from(text == SPEED);
        if text == SPEED && polls == 2 { Instead::Nothing } else { Instead::AsUsual }
    });
    let stopped_at = rig.now_us;
    stop(&mut rig);
    while rig.sent_since(0, stopped_at).iter().filter(|text| **text == SPEED).count() < 2 {
        rig.run(100);
    }
    // Its window of 5 ms closes.
    rig.run(5_500);
    rig.receive(0, late);
    let since = rig.now_us;
    while bench::outcomes(&rig).is_empty() {
        rig.run(100);
        assert!(rig.now_us < since + 30_000);
    }
    rig.sent_since(0, since).iter().filter(|text| **text == SPEED).count()
}

/// What was read before does not count if a late answer says that the motor turned.
#[test]
fn a_late_reading_shows_no_standstill_and_can_show_that_there_is_none() {
    let stands = readings_after("241#9C1E0A0000000000");
    let turns = readings_after("241#9C1E0A0064000000");
    assert_eq!(turns, stands + 1);
}
