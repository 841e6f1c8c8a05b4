//! Axes that share a trip group: one trips, all do.

use crate::bench::{self, VELOCITY, arm_axis, keep_moving, listed, run_with_host};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, ClearTarget, Error, Event, Request, TripReason, Value, requests,
};

/// Three axes, of which 0 and 2 belong together.
fn rig() -> Rig {
    let mut rig = bench::rmd_axes(3);
    for axis in [0, 2] {
        bench::parameter(&mut rig, axis, AxisParameter::TripGroup, Value::Unsigned(7));
    }
    rig
}

fn trips(rig: &Rig) -> Vec<(u8, TripReason)> {
    let trip_of = |event: &Event| match event {
        Event::Tripped { axis, trip } => Some((*axis, trip.reason)),
        _ => None,
    };
    rig.events().into_iter().filter_map(trip_of).collect()
}

#[test]
fn one_trips_and_the_group_stops_in_the_same_instant() {
    let mut rig = rig();
    let axes = [0, 1, 2].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &axes, VELOCITY, 30_000);
    // Axis 0 gets no setpoints any more.
    keep_moving(&mut rig, &axes[1..], VELOCITY, 200_000);
    assert_eq!(trips(&rig), [(0, TripReason::SetpointExpired), (2, TripReason::Group { axis: 0 })]);
    assert_eq!(listed(&mut rig, 1), AxisState::Active);
    assert_eq!(listed(&mut rig, 2), AxisState::Tripped { confirmed: true });
    let first =
        |text: &str| rig.wire.iter().find(|(at, _, sent)| *at > 100_000 && sent == text).unwrap().0;
    assert!(first("143#8100000000000000").abs_diff(first("141#8100000000000000")) < 1_000);
}

#[test]
fn nobody_of_the_group_is_armed_while_another_is_tripped() {
    let mut rig = rig();
    let axes = [(0, arm_axis(&mut rig, 0))];
    keep_moving(&mut rig, &axes, VELOCITY, 30_000);
    run_with_host(&mut rig, 300_000);
    assert_eq!(trips(&rig), [(0, TripReason::SetpointExpired)]); // axis 2 was idle and stays so
    let refused = rig.ask(Request::Arm(requests::Arm { axis: 2 }));
    assert_eq!(refused, Err(Error::Tripped { axis: 0, reason: TripReason::SetpointExpired }));
    rig.ask(Request::Clear(requests::Clear { target: ClearTarget::Axis(0) })).unwrap();
    arm_axis(&mut rig, 2);
    arm_axis(&mut rig, 1);
}

#[test]
fn a_fault_found_while_arming_does_not_reach_the_group_and_a_trip_does_reach_who_is_arming() {
    let mut rig = rig();
    let epoch = arm_axis(&mut rig, 0);
    rig.instead(
        |text| if text.starts_with("143#9C") { Instead::Nothing } else { Instead::AsUsual },
    );
    let arming = rig.send(&Request::Arm(requests::Arm { axis: 2 }));
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 10_000);
    assert_eq!(listed(&mut rig, 2), AxisState::Arming);
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(
        rig.answer(arming),
        Some(Err(Error::Tripped { axis: 2, reason: TripReason::EStop }))
    );

    let mut rig = self::rig();
    arm_axis(&mut rig, 0);
    rig.instead(|text| if text.starts_with("143#") { Instead::Nothing } else { Instead::AsUsual });
    rig.send(&Request::Arm(requests::Arm { axis: 2 }));
    run_with_host(&mut rig, 100_000);
    assert_eq!(trips(&rig), []);
    assert_eq!(listed(&mut rig, 0), AxisState::Armed);
}
