//! Motors that answer and do not do what they are told: an echo proves receipt, not motion
//! (PROTOCOL-NOTES R26, R30).

use crate::bench::{self, VELOCITY, arm, assert_tripped, keep_moving, listed};
use crate::motors::Shared;
use crate::rig::{Instead, Rig};
use host_protocol::{AxisParameter, AxisState, Setpoint, StopAction, TripReason, Value};

/// As the parameter `rmd_dialect` names it.
const V4_4: u32 = 6;
const REST: Setpoint = Setpoint::Velocity { velocity_rad_s: 0.0 };

/// An RMD, cold and at its zero point, that answers a speed of 0 by zeros.
fn cold(turning: bool) -> (Rig, u32) {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    let rest = ["141#A200000000000000", "241#A200000000000000"];
    let epoch = echoing(&mut rig, &play, turning, rest);
    (rig, epoch)
}

/// Moves the motor, which from then on turns or stands and answers a speed of 0 so; the epoch.
fn echoing(rig: &mut Rig, play: &Shared, turning: bool, [asked, answer]: [&'static str; 2]) -> u32 {
    let epoch = arm(rig);
    keep_moving(rig, &[(0, epoch)], VELOCITY, 100_000);
    play.borrow_mut().turning = turning;
    rig.instead(move |text| if text == asked { Instead::Says(answer) } else { Instead::AsUsual });
    epoch
}

#[test]
fn a_speed_of_0_that_comes_back_unchanged_while_the_shaft_turns_is_asked_twice_and_trips() {
    let (mut rig, epoch) = cold(true);
    let since = rig.now_us;
    keep_moving(&mut rig, &[(0, epoch)], REST, 50_000);
    assert_tripped(&mut rig, TripReason::CommandRefused { faults: Some(0) }, false);
    let sent = rig.sent_since(0, since);
    let until_stop: Vec<_> =
        sent.into_iter().take_while(|text| !text.starts_with("141#81")).collect();
    assert_eq!(
        until_stop.iter().filter(|text| text.starts_with("141#A2")).count(),
        2,
        "{until_stop:?}"
    );
    assert!(
        until_stop.iter().any(|text| text.starts_with("141#9A")),
        "the reason is read: {until_stop:?}"
    );
}

#[test]
fn a_cold_motor_at_rest_may_answer_a_speed_of_0_by_zeros() {
    let (mut rig, epoch) = cold(false);
    keep_moving(&mut rig, &[(0, epoch)], REST, 500_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Active);
}

/// A speed of 0 comes back unchanged from a motor whose temperature is the torque cap, 30 °C.
#[test]
fn a_motor_as_warm_as_its_torque_cap_is_asked_whether_it_stands() {
    for turning in [false, true] {
        let (mut rig, play) = bench::rmd(StopAction::Hold);
        play.borrow_mut().dialect = V4_4;
        bench::parameter(&mut rig, 0, AxisParameter::RmdDialect, Value::Unsigned(V4_4));
        bench::parameter(&mut rig, 0, AxisParameter::TorqueCap, Value::Unsigned(30));
        let rest = ["141#A21E000000000000", "241#A21E000000000000"];
        let epoch = echoing(&mut rig, &play, turning, rest);
        keep_moving(&mut rig, &[(0, epoch)], REST, 500_000);
        if turning {
            assert_tripped(&mut rig, TripReason::CommandRefused { faults: Some(0) }, false);
        } else {
            assert_eq!(listed(&mut rig, 0), AxisState::Active);
        }
    }
}

#[test]
fn the_fault_word_is_read_before_a_motion_that_was_thrown_back_is_asked_again() {
    for phase_us in (0..50_000).step_by(1_700) {
        let (mut rig, play) = bench::rmd(StopAction::Hold);
        let epoch = arm(&mut rig);
        keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 100_000 + phase_us);
        play.borrow_mut().fault = true;
        play.borrow_mut().refuses = true;
        keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 50_000);
        assert_tripped(&mut rig, TripReason::MotorFault { faults: 2 }, true);
    }
}
