//! Axes that share a trip group: one trips, all do.

use crate::bench::{self, VELOCITY, arm_axis, keep_moving, listed, run_with_host};
use crate::motors::{self, Shared};
use crate::rig::{Instead, Rig};
use gateway::{Event as GatewayEvent, Set};
use host_protocol::{
    AxisParameter, AxisState, ClearTarget, Error, Event, Protocol, Request, StopAction, TripReason,
    Value, requests,
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

/// Axes 0 and 1 on CAN bus 0, 2 on CAN bus 1 and 3 on RS485, in these groups.
fn on_three_buses(groups: [u32; 4]) -> Rig {
    let mut rig = bench::rmd_axes(2);
    let mut serial = motors::rmd_serial(Shared::default());
    let mut can = std::mem::replace(&mut rig.motor, Box::new(|_, _, _| None));
    rig.motor = Box::new(
        move |now, bus, text| {
            if bus == 2 { serial(now, bus, text) } else { can(now, bus, text) }
        },
    );
    bench::configure_bus(&mut rig, 2, 2_000_000, &[Protocol::Rmd]);
    bench::configure_bus(&mut rig, 1, 1_000_000, &[Protocol::Rmd]);
    for (axis, bus) in [(2, 1), (3, 2)] {
        bench::configure_axis(&mut rig, axis, bus, Protocol::Rmd, 1, StopAction::Hold);
    }
    for (axis, group) in (0..).zip(groups) {
        bench::parameter(&mut rig, axis, AxisParameter::TripGroup, Value::Unsigned(group));
    }
    rig
}

fn arm_all(rig: &mut Rig) -> [(u8, u32); 4] {
    [0, 1, 2, 3].map(|axis| (axis, arm_axis(rig, axis)))
}

/// Who is stopped in a poll has a group, too.
#[test]
fn the_group_is_due_at_once_where_polls_have_stopped_all_whose_setpoints_expired() {
    let mut rig = on_three_buses([7; 4]);
    let axes = arm_all(&mut rig);
    keep_moving(&mut rig, &axes, VELOCITY, 30_000);
    let at = rig.now_us + 30_000;
    for (axis, epoch) in axes {
        let us = if axis == 0 || axis == 3 { 30_000 } else { 60_000 };
        let request = bench::axis_setpoint(&rig, axis, epoch, us, VELOCITY);
        rig.send(&request);
    }
    rig.run(29_999);
    assert_eq!(rig.gateway.tripped(), Set::NONE);
    rig.now_us = at;
    rig.handle(GatewayEvent::Tick);
    assert!(rig.gateway.tripped().has(0u8));
    while rig.gateway.tripped().len() < 4 {
        assert!(rig.gateway.next_deadline().is_some_and(|due| due.as_micros() <= at));
        rig.handle(GatewayEvent::Tick);
    }
}

/// One event trips axes of two groups: nobody of either is sent motion any more.
#[test]
fn trips_of_several_groups_reach_all_of_them_before_the_next_frame() {
    for after in (0..4_000).step_by(50) {
        let mut rig = on_three_buses([7, 8, 7, 8]);
        bench::parameter(&mut rig, 3, AxisParameter::RefreshUs, Value::Unsigned(2_000));
        let axes = arm_all(&mut rig);
        keep_moving(&mut rig, &axes, VELOCITY, 20_000 + after);
        // The tick of what is due is late.
        rig.run_without_ticks(60);
        let since = rig.wire.len();
        rig.bus_off(0);
        rig.run(2_000);
        let motion = |(_, bus, text): &&(u64, u8, String)| *bus == 2 && text[6..].starts_with("A2");
        assert_eq!(rig.wire[since..].iter().find(motion), None, "{after} µs");
        assert_eq!(rig.gateway.tripped().len(), 4);
    }
}
