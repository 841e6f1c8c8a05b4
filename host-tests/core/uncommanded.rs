//! An armed axis without a setpoint whose motor turns (GUARANTEES G1).

use crate::bench::{
    self, VELOCITY, arm, assert_tripped, listed, parameter, run_with_host, setpoint,
};
use crate::rig::{Instead, Rig};
use host_protocol::{AxisParameter, AxisState, StopAction, TripReason, Value};
use std::cell::RefCell;
use std::rc::Rc;

/// An armed RMD that reads the speeds given, °/s, one after the other and the last one for ever;
/// with the times at which it was asked.
fn armed_and_read(degrees_s: &'static [i16]) -> (Rig, Rc<RefCell<usize>>) {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    arm(&mut rig);
    let asked = Rc::new(RefCell::new(0));
    let count = asked.clone();
    let replies: Vec<&'static str> = degrees_s
        .iter()
        .map(|speed| {
            let [low, high] = speed.to_le_bytes();
            &*format!("241#9C326400{low:02X}{high:02X}2D00").leak()
        })
        .collect();
    rig.instead(move |text| {
        if !text.starts_with("141#9C") {
            return Instead::AsUsual;
        }
        let mut count = count.borrow_mut();
        *count += 1;
        Instead::Says(replies[(*count - 1).min(replies.len() - 1)])
    });
    (rig, asked)
}

#[test]
fn two_readings_20_ms_apart_trip_in_either_sense() {
    // 5 × 0.105 rad/s are 30.1 °/s.
    for speed in [&[31][..], &[-31]] {
        let (mut rig, asked) = armed_and_read(speed);
        run_with_host(&mut rig, 200_000);
        assert_tripped(&mut rig, TripReason::Uncommanded, true);
        assert!(*asked.borrow() >= 2);
    }
    let (mut rig, asked) = armed_and_read(&[30]);
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Armed);
    assert!(*asked.borrow() > 10);
}

#[test]
fn the_second_reading_comes_20_ms_after_the_first_however_slow_the_polls() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    parameter(&mut rig, 0, AxisParameter::StatePollUs, Value::Unsigned(1_000_000));
    arm(&mut rig);
    let since = rig.now_us;
    rig.instead(|text| match text.starts_with("141#9C") {
        true => Instead::Says("241#9C326400F4012D00"),
        false => Instead::AsUsual,
    });
    run_with_host(&mut rig, 3_000_000);
    assert_tripped(&mut rig, TripReason::Uncommanded, true);
    let speeds: Vec<u64> = rig
        .wire
        .iter()
        .filter(|(at, _, text)| *at >= since && text.starts_with("141#9C"))
        .map(|(at, ..)| *at)
        .collect();
    let pause = speeds[1] - speeds[0];
    assert!((20_000..22_000).contains(&pause), "{pause} µs");
}

#[test]
fn one_reading_is_noise() {
    let (mut rig, _) = armed_and_read(&[500, 0, 500, 0, 500, 0, 500, 0, 500, 0]);
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Armed);
}

#[test]
fn the_threshold_is_the_axis_s_own_and_may_be_taken_away() {
    for (threshold, trips) in [(9.0, false), (8.0, true)] {
        let (mut rig, play) = bench::rmd(StopAction::Coast);
        parameter(&mut rig, 0, AxisParameter::UncommandedRadS, Value::Float(threshold));
        arm(&mut rig);
        play.borrow_mut().turning = true; // 500 °/s are 8.73 rad/s.
        run_with_host(&mut rig, 500_000);
        assert_eq!(matches!(listed(&mut rig, 0), AxisState::Tripped { .. }), trips, "{threshold}");
    }
    let (mut rig, play) = bench::thruster();
    parameter(&mut rig, 0, AxisParameter::AllowUncommanded, Value::Bool(true));
    arm(&mut rig);
    play.borrow_mut().turning = true;
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Armed);
}

#[test]
fn a_setpoint_makes_it_commanded() {
    let (mut rig, play) = bench::rmd(StopAction::Coast);
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 80_000, VELOCITY);
    rig.ask(request).unwrap();
    play.borrow_mut().turning = true;
    bench::keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 1_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Active);
}
