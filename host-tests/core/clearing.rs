//! A trip is cleared once its stop is confirmed and its cause gone, no sooner and no later.

use crate::bench::{
    self, VELOCITY, arm, assert_tripped, clear, keep_moving, listed, move_axis, run_with_host,
    state,
};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Quantity, Setpoint, StopAction, TripReason, Value,
};
use std::cell::Cell;
use std::rc::Rc;

/// Has the motor answer a request by `reply` as long as the returned switch is on.
fn switched_reply(rig: &mut Rig, request: &'static str, reply: &'static str) -> Rc<Cell<bool>> {
    let switch = Rc::new(Cell::new(false));
    let on = switch.clone();
    rig.instead(move |text| {
        if on.get() && text.starts_with(request) { Instead::Says(reply) } else { Instead::AsUsual }
    });
    switch
}

/// The quantity and the value that tripped axis 0.
fn exceeded(rig: &mut Rig) -> (Quantity, f32) {
    match state(rig).trip.map(|trip| trip.reason) {
        Some(TripReason::LimitExceeded { quantity, value, .. }) => (quantity, value),
        other => panic!("{other:?}"),
    }
}

fn position_range(rig: &mut Rig, min_rad: f32, max_rad: f32) {
    bench::parameter(rig, 0, AxisParameter::PositionMaxRad, Value::Float(max_rad));
    bench::parameter(rig, 0, AxisParameter::PositionMinRad, Value::Float(min_rad));
}

#[test]
fn a_position_limit_trip_can_be_cleared_where_the_motor_is_and_the_next_arming_watches_it_again() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    position_range(&mut rig, -10.0, 10.0);
    let far = switched_reply(&mut rig, "141#92", "241#9200000080841E00"); // 20 000°
    let epoch = arm(&mut rig);
    far.set(true);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 300_000);
    assert_eq!(exceeded(&mut rig), (Quantity::Position, 349.065_86));
    clear(&mut rig).unwrap();
    let epoch = arm(&mut rig);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 300_000);
    assert_eq!(exceeded(&mut rig), (Quantity::Position, 349.065_86));
    far.set(false); // moved back by hand
    run_with_host(&mut rig, 1_000_000);
    clear(&mut rig).unwrap();
}

#[test]
fn a_position_beyond_a_narrow_limit_trips_however_far_the_other_one_is() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    position_range(&mut rig, -1.0, 1_000.0);
    let beyond = switched_reply(&mut rig, "141#92", "241#92000000E05EF8FF"); // −5 000°
    let epoch = arm(&mut rig);
    beyond.set(true);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 300_000);
    assert_eq!(exceeded(&mut rig), (Quantity::Position, -87.266_464));
}

#[test]
fn a_current_limit_trip_of_a_thruster_is_cleared_when_the_current_is_back() {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::CurrentLimitA, Value::Float(5.0));
    let strong = switched_reply(&mut rig, "30B#5143", "28B#5143000000000064"); // 10 A
    let epoch = arm(&mut rig);
    strong.set(true);
    keep_moving(&mut rig, &[(0, epoch)], Setpoint::Signal { fraction: 0.1 }, 300_000);
    assert_eq!(exceeded(&mut rig), (Quantity::Current, 10.0));
    strong.set(false);
    run_with_host(&mut rig, 1_000_000);
    clear(&mut rig).unwrap();
}

#[test]
fn a_temperature_trip_is_not_cleared_while_the_motor_is_hot() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::TemperatureLimitC, Value::Float(40.0));
    let epoch = arm(&mut rig);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 300_000);
    assert_eq!(exceeded(&mut rig), (Quantity::Temperature, 50.0));
    let reason = state(&mut rig).trip.unwrap().reason;
    assert_eq!(clear(&mut rig), Err(Error::CauseRemains { axis: 0, reason }));
}

#[test]
fn a_confirmed_stop_of_a_motor_that_turns_again_is_confirmed_no_longer() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    run_with_host(&mut rig, 300_000);
    assert_tripped(&mut rig, TripReason::SetpointExpired, true);
    play.borrow_mut().turning = true;
    run_with_host(&mut rig, 3_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
    assert_eq!(clear(&mut rig), Err(Error::StopNotConfirmed { axis: 0 }));
}
