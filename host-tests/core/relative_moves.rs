//! Relative moves: the position is read once, and then an absolute target is held.

use crate::bench::{self, arm, expiry, run_with_host};
use crate::rig::{Instead, Rig};
use host_protocol::replies::MoveTarget;
use host_protocol::{
    AxisParameter, AxisState, Error, Protocol, Quantity, Reply, Request, StopAction, TripReason,
    Value, requests,
};

/// A quarter of a radian on from where the bench's motors stand, 360°: to 374.32°, at 115 °/s.
const TARGET: &str = "141#A400720038920000";

fn relative(rig: &Rig, epoch: u32, distance_rad: f32, speed_limit_rad_s: f32) -> Request {
    let expires_at_us = expiry(rig, 80_000);
    Request::MoveRelative(requests::MoveRelative {
        axis: 0,
        epoch,
        expires_at_us,
        distance_rad,
        speed_limit_rad_s,
    })
}

fn sent(rig: &Rig, since_us: u64) -> usize {
    rig.sent_since(0, since_us).iter().filter(|text| text.starts_with("141#A4")).count()
}

/// From now on the motor says that of its position.
fn stands_at(rig: &mut Rig, reply: &'static str) {
    rig.instead(
        move |text| {
            if text.starts_with("141#92") { Instead::Says(reply) } else { Instead::AsUsual }
        },
    );
}

#[test]
fn the_target_is_held_like_a_position_setpoint_until_it_expires() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = relative(&rig, epoch, 0.25, 2.0);
    let Ok(Reply::MoveRelative(MoveTarget { start_rad, target_rad })) = rig.ask(request) else {
        panic!("no target");
    };
    assert_eq!((start_rad, target_rad), (core::f32::consts::TAU, 6.533_116_4)); // 374.32°
    run_with_host(&mut rig, 60_000);
    let targets = rig.sent_since(0, since);
    assert!(targets.iter().filter(|text| **text == TARGET).count() >= 3);
    assert!(!targets.iter().any(|text| text.contains("#A8")));
    run_with_host(&mut rig, 60_000);
    assert_eq!(
        bench::state(&mut rig).trip.map(|trip| trip.reason),
        Some(TripReason::SetpointExpired)
    );
}

#[test]
fn what_cannot_be_done_is_refused_before_the_position_is_read() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(3.0));
    let request = relative(&rig, 0, 0.25, 2.0);
    assert_eq!(rig.ask(request), Err(Error::NotArmed { axis: 0, state: AxisState::Idle }));
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let refused = |rig: &mut Rig, epoch, distance, speed| {
        let request = relative(rig, epoch, distance, speed);
        rig.ask(request).unwrap_err()
    };
    assert_eq!(
        refused(&mut rig, epoch - 1, 0.25, 2.0),
        Error::StaleEpoch { axis: 0, current: epoch }
    );
    assert_eq!(
        refused(&mut rig, epoch, f32::NAN, 2.0),
        Error::NotANumber { quantity: Quantity::Position }
    );
    assert_eq!(refused(&mut rig, epoch, 0.25, 0.0), Error::SpeedLimitZero { axis: 0 });
    assert_eq!(
        refused(&mut rig, epoch, 0.25, 3.5),
        Error::OutOfRange { quantity: Quantity::SpeedLimit, value: 3.5, min: 0.0, max: 3.0 }
    );
    assert_eq!(sent(&rig, since), 0);

    let (mut rig, _) = bench::d5();
    let epoch = arm(&mut rig);
    assert_eq!(
        refused(&mut rig, epoch, 0.25, 2.0),
        Error::Unsupported { axis: 0, protocol: Protocol::D5 }
    );
}

/// ±179.9° (Thruster manual §4.1).
#[test]
fn a_target_beyond_what_the_device_takes_is_refused_with_what_it_takes() {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(true));
    let epoch = arm(&mut rig);
    for distance in [6.0f32, -6.0] {
        let request = relative(&rig, epoch, distance, 5.0);
        let Err(Error::OutOfRange { quantity: Quantity::Position, value, min, max }) =
            rig.ask(request)
        else {
            panic!("no refusal with a range")
        };
        assert!(!(min..=max).contains(&value), "{value} in {min} to {max}");
        assert_eq!([min, max].map(|end| (end.to_degrees() * 10.0).round()), [-1799.0, 1799.0]);
    }
}

#[test]
fn a_target_beyond_the_limit_is_refused_and_nothing_moves() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::PositionMaxRad, Value::Float(6.5));
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = relative(&rig, epoch, 0.25, 2.0);
    let refused = rig.ask(request);
    assert!(
        matches!(refused, Err(Error::OutOfRange { quantity: Quantity::Position, .. })),
        "{refused:?}"
    );
    run_with_host(&mut rig, 50_000);
    assert_eq!(sent(&rig, since), 0);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Armed);
}

#[test]
fn a_permission_that_ends_while_the_position_is_read_moves_nothing() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let expires_at_us = expiry(&rig, 200); // shorter than a frame and its reply take
    let request = Request::MoveRelative(requests::MoveRelative {
        axis: 0,
        epoch,
        expires_at_us,
        distance_rad: 0.25,
        speed_limit_rad_s: 2.0,
    });
    assert!(matches!(rig.ask(request), Err(Error::Stale { .. })));
    run_with_host(&mut rig, 50_000);
    assert_eq!(sent(&rig, since), 0);
}

#[test]
fn a_stop_while_the_position_is_read_ends_the_move() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = relative(&rig, epoch, 0.25, 2.0);
    let sequence = rig.send(&request);
    bench::stop(&mut rig);
    run_with_host(&mut rig, 100_000);
    let stopped = Error::Aborted { axis: 0, state: AxisState::Stopping };
    assert_eq!(rig.answer(sequence), Some(Err(stopped)));
    assert_eq!(sent(&rig, since), 0);
}

#[test]
fn the_position_is_read_after_the_request_and_not_before() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let polled = |rig: &Rig| rig.wire.last().is_some_and(|(_, _, text)| text.starts_with("141#92"));
    while !polled(&rig) {
        rig.send(&Request::Ping(requests::Ping {}));
        rig.run(50);
    }
    let since = rig.now_us + 1;
    let request = relative(&rig, epoch, 0.25, 2.0);
    assert!(matches!(rig.ask(request), Ok(Reply::MoveRelative(_))));
    assert!(rig.sent_since(0, since).contains(&"141#9200000000000000"));
}

#[test]
fn far_from_zero_the_target_is_as_exact_as_the_motor_counts() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    // 1 234 567.89°, where an f32 of radians has steps of 0.1°.
    stands_at(&mut rig, "241#9200000015CD5B07");
    let since = rig.now_us;
    let request = relative(&rig, epoch, 0.25, 2.0);
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 1_000);
    let targets = rig.sent_since(0, since);
    let target = targets.iter().find(|text| text.starts_with("141#A4"));
    assert_eq!(target, Some(&"141#A4007200ADD25B07")); // 14.32° further
}

#[test]
fn a_target_that_the_motor_cannot_count_is_refused() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    stands_at(&mut rig, "241#92000000FFFFFF7F");
    let since = rig.now_us;
    let request = relative(&rig, epoch, 0.25, 2.0);
    let refused = rig.ask(request);
    assert!(
        matches!(refused, Err(Error::OutOfRange { quantity: Quantity::Position, .. })),
        "{refused:?}"
    );
    assert_eq!(sent(&rig, since), 0);
}
