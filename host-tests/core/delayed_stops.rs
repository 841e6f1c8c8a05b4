//! A stop that does not leave its bus in time is reported, once (GUARANTEES G5).

use crate::bench::{self, VELOCITY, arm_axis, e_stop, keep_moving, move_axis, run_with_host};
use crate::rig::Rig;
use host_protocol::{
    AxisParameter, Event as HostEvent, Request, Setpoint, StopAction, StopTarget, Value, requests,
};

/// g + F(2k + 4) at 1 Mbit/s, on a bus that thrusters may share, and 1 ms.
fn bound_us(stops: u64) -> u64 {
    100 + 135 * (2 * stops + 4) + 1_000
}

fn reports(rig: &Rig) -> Vec<(u8, u8, u64)> {
    let report = |event: &HostEvent| match event {
        HostEvent::StopDelayed { bus, axis, waiting_us } => {
            Some((*bus, *axis, u64::from(*waiting_us)))
        }
        _ => None,
    };
    rig.events().into_iter().filter_map(report).collect()
}

#[test]
fn a_stop_that_a_full_bus_holds_back_is_reported_once_when_its_bound_has_passed() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 55_000);
    rig.cut(); // others have the bus: what is handed over stays in the controller
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
    rig.run(bound_us(1) - 1);
    assert_eq!(reports(&rig), []);
    rig.run(1);
    assert_eq!(reports(&rig), [(0, 0, bound_us(1))]);
    run_with_host(&mut rig, 500_000);
    rig.mend();
    run_with_host(&mut rig, 500_000);
    assert_eq!(reports(&rig).len(), 1);
}

#[test]
fn many_stops_at_once_have_the_time_of_the_last_of_them() {
    let mut rig = bench::rmd_axes(6);
    let moving = [0, 1, 2, 3, 4, 5].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &moving, VELOCITY, 55_000);
    rig.cut();
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(bound_us(6) - 1);
    assert_eq!(reports(&rig), []);
    rig.run(1);
    assert_eq!(reports(&rig), [0, 1, 2, 3, 4, 5].map(|axis| (0, axis, bound_us(6))));
}

#[test]
fn stops_that_leave_in_time_are_not_reported_however_many() {
    let mut rig = bench::rmd_axes(16);
    let moving: [_; 16] = core::array::from_fn(|axis| {
        let axis = u8::try_from(axis).unwrap();
        (axis, arm_axis(&mut rig, axis))
    });
    keep_moving(&mut rig, &moving, VELOCITY, 55_000);
    e_stop(&mut rig);
    run_with_host(&mut rig, 500_000);
    assert_eq!(reports(&rig), []);
    let confirmed = bench::outcomes(&rig);
    assert_eq!(confirmed.len(), 16, "{confirmed:?}");
}

/// At 500 kbit/s three frames each 2 ms take 405 of 1000: three more frames, and all of it takes
/// 1000 / 595 of its time (Thruster manual §2.5).
#[test]
fn what_thrusters_send_by_themselves_takes_its_share_of_the_bound() {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::Stream, Value::Unsigned(0x7_0002));
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], Setpoint::Signal { fraction: 0.2 }, 55_000);
    rig.cut();
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
    let bound_us = (100 + 270 * (6 + 3)) * 1_000 / 595 + 1_000;
    rig.run(bound_us - 1);
    assert_eq!(reports(&rig), []);
    rig.run(1);
    assert_eq!(reports(&rig), [(0, 0, bound_us)]);
}

#[test]
fn a_stop_for_a_bus_that_is_off_is_reported() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.bus_off(0);
    run_with_host(&mut rig, 300_000);
    assert_eq!(reports(&rig), [(0, 0, bound_us(1))]);
}
