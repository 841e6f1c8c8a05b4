//! When the firmware may leave, because nothing moves and nothing may.

use crate::bench::{self, VELOCITY, arm, clear, disarm, move_axis, run_with_host};
use crate::rig::Rig;
use host_protocol::{AxisState, StopAction};

/// Longer than any stop takes here.
const SETTLED_US: u64 = 500_000;

#[test]
fn nothing_configured_is_at_rest() {
    assert!(Rig::new().gateway.all_at_rest());
}

#[test]
fn an_axis_is_at_rest_before_it_is_armed_and_once_its_stop_is_confirmed() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    assert!(rig.gateway.all_at_rest(), "idle");
    arm(&mut rig);
    assert!(!rig.gateway.all_at_rest(), "armed");
    disarm(&mut rig);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Stopping);
    assert!(!rig.gateway.all_at_rest(), "stopping");
    run_with_host(&mut rig, SETTLED_US);
    assert!(!rig.gateway.all_at_rest(), "holding, and polled for it");
    bench::output_off(&mut rig).unwrap();
    assert!(rig.gateway.all_at_rest(), "idle again");
}

#[test]
fn a_motor_that_locks_itself_needs_nobody_to_hold() {
    let (mut rig, _) = bench::d5();
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, SETTLED_US);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Holding);
    assert!(rig.gateway.all_at_rest());
}

#[test]
fn a_trip_is_no_rest_until_it_is_cleared() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    move_axis(&mut rig, VELOCITY);
    run_with_host(&mut rig, SETTLED_US);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    assert!(!rig.gateway.all_at_rest(), "tripped, its stops are repeated");
    clear(&mut rig).unwrap();
    assert!(rig.gateway.all_at_rest());
}
