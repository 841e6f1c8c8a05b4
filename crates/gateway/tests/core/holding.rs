//! An RMD that holds must keep hearing something, or its own timeout (0xB3) cuts the output and a hanging load drops.

use crate::bench::{self, VELOCITY, arm, disarm, run_with_host};
use crate::rig::Rig;
use host_protocol::{AxisParameter, AxisState, Error, Request, StopAction, Value, requests};

/// The motor of axis 0 has heard something every 100 ms, up to now.
fn assert_fed_every_100_ms(rig: &Rig, since_us: u64) {
    let gap = rig.longest_gap_us(0, since_us, "141#");
    assert!(gap <= 100_000, "{gap} µs");
    assert!(rig.now_us - rig.wire.last().unwrap().0 <= 100_000);
}

/// The slowest state polls that can be configured.
fn with_slow_polls(rig: &mut Rig) {
    bench::parameter(rig, 0, AxisParameter::StatePollUs, Value::Unsigned(1_000_000));
    bench::parameter(rig, 0, AxisParameter::FaultPollUs, Value::Unsigned(1_000_000));
}

#[test]
fn a_disarmed_axis_is_polled_at_once_and_within_a_third_of_the_timeout() {
    let (mut rig, _) = bench::rmd_with_timeout(300);
    with_slow_polls(&mut rig);
    let since = rig.now_us;
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    assert_fed_every_100_ms(&rig, since);
}

#[test]
fn an_armed_axis_that_was_given_no_setpoint_is_polled_within_a_third_of_the_timeout() {
    let (mut rig, _) = bench::rmd_with_timeout(300);
    with_slow_polls(&mut rig);
    let since = rig.now_us;
    arm(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    assert_fed_every_100_ms(&rig, since);
}

#[test]
fn an_arming_that_fails_goes_on_holding() {
    let (mut rig, play) = bench::rmd_with_timeout(500);
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 500_000);
    play.borrow_mut().fault = true;
    let since = rig.now_us;
    assert_eq!(
        rig.ask(Request::Arm(requests::Arm { axis: 0 })),
        Err(Error::MotorFault { axis: 0, faults: 2 })
    );
    run_with_host(&mut rig, 2_000_000);
    let gap = rig.longest_gap_us(0, since, "141#");
    assert!(gap <= 500_000 / 3, "{gap} µs");
    assert!(rig.now_us - rig.wire.last().unwrap().0 <= 500_000 / 3);
}

#[test]
fn another_node_is_another_motor_and_is_not_held() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::move_axis(&mut rig, VELOCITY);
    bench::stop(&mut rig);
    run_with_host(&mut rig, 300_000);
    bench::parameter(&mut rig, 0, AxisParameter::Node, Value::Unsigned(5));
    let since = rig.now_us;
    run_with_host(&mut rig, 300_000);
    assert_eq!(rig.sent_since(0, since), Vec::<&str>::new());
}

#[test]
fn a_motor_that_should_hold_and_turns_is_stopped_again() {
    let (mut rig, play) = bench::rmd_with_timeout(300);
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 500_000);
    let since = rig.now_us;
    play.borrow_mut().turning = true;
    run_with_host(&mut rig, 100_000);
    assert!(rig.sent_since(0, since).contains(&bench::HOLD));
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Stopping);
    play.borrow_mut().turning = false;
    run_with_host(&mut rig, 100_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
}
