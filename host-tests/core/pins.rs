//! The e-stop input, the enable output and the light.

use crate::bench::{self, HOLD, VELOCITY, arm_axis, keep_moving, listed, run_with_host};
use crate::rig::{BOARD, Instead, Rig};
use gateway::{Event, Gateway, Light};
use host_protocol::{
    AxisState, ClearTarget, Error, Event as HostEvent, Reply, Request, TripReason,
    replies::GatewayReport, requests,
};

/// The data of an RMD's stop by holding.
const HOLD_DATA: &str = "#8100000000000000";

fn status(rig: &mut Rig) -> GatewayReport {
    match rig.ask(Request::GatewayStatus(requests::GatewayStatus {})) {
        Ok(Reply::GatewayStatus(report)) => report,
        other => panic!("{other:?}"),
    }
}

fn clear(rig: &mut Rig, target: ClearTarget) -> Result<Reply, Error> {
    rig.ask(Request::Clear(requests::Clear { target }))
}

#[test]
fn an_open_input_stops_everything_at_once_and_bars_arming_until_it_is_closed_and_cleared() {
    let mut rig = bench::rmd_axes(2);
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 30_000);
    let pressed_at = rig.now_us;
    rig.handle(Event::EStopInput { open: true });
    assert!(rig.sent_since(0, pressed_at)[0].ends_with(HOLD_DATA));
    assert_eq!(rig.wire.last().map(|(at, ..)| *at), Some(pressed_at));
    run_with_host(&mut rig, 50_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    assert_eq!(listed(&mut rig, 1), AxisState::Holding); // stopped too, to be sure
    for stop in [HOLD, "142#8100000000000000"] {
        assert!(rig.sent_since(0, pressed_at).contains(&stop), "{stop}");
    }
    let report = status(&mut rig);
    assert_eq!((report.e_stop_latched, report.e_stop_input_open), (true, Some(true)));

    assert_eq!(clear(&mut rig, ClearTarget::Gateway), Err(Error::EStopInputOpen {}));
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 1 })), Err(Error::EStopped {}));
    rig.handle(Event::EStopInput { open: false });
    // Latched.
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 1 })), Err(Error::EStopped {}));
    clear(&mut rig, ClearTarget::Gateway).unwrap();
    clear(&mut rig, ClearTarget::Axis(0)).unwrap();
    arm_axis(&mut rig, 0);

    let seen: Vec<_> = rig
        .events()
        .into_iter()
        .filter(|event| {
            matches!(
                event,
                HostEvent::EStopInputChanged { .. }
                    | HostEvent::EStopLatched {}
                    | HostEvent::EStopCleared {}
            )
        })
        .copied()
        .collect();
    let expected = [
        HostEvent::EStopLatched {},
        HostEvent::EStopInputChanged { open: true },
        HostEvent::EStopInputChanged { open: false },
        HostEvent::EStopCleared {},
    ];
    assert_eq!(seen, expected);
}

#[test]
fn an_input_that_has_not_been_read_counts_as_open() {
    let mut rig = bench::rmd_axes(1);
    rig.replace_gateway(Gateway::new(&BOARD, Some(0)));
    rig.gateway.restore(rig.now(), &rig.memory);
    bench::hello_again(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(status(&mut rig).e_stop_input_open, Some(true));
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(Error::EStopped {}));
    assert_eq!(clear(&mut rig, ClearTarget::Gateway), Err(Error::EStopInputOpen {}));
}

#[test]
fn an_input_that_is_open_at_the_start_latches_as_soon_as_it_is_read() {
    let mut rig = bench::rmd_axes(1);
    rig.replace_gateway(Gateway::new(&BOARD, Some(0)));
    bench::hello_again(&mut rig);
    rig.handle(Event::EStopInput { open: true });
    assert!(status(&mut rig).e_stop_latched);
    rig.handle(Event::EStopInput { open: false });
    assert!(status(&mut rig).e_stop_latched);
}

#[test]
fn the_enable_output_falls_when_a_motor_is_unreachable_and_rises_when_that_is_over() {
    let mut rig = bench::rmd_axes(1);
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 30_000);
    assert_eq!((rig.gateway.enable_output(), status(&mut rig).enable_output), (true, Some(true)));
    rig.instead(|_| Instead::Nothing);
    run_with_host(&mut rig, 600_000);
    assert_eq!((rig.gateway.enable_output(), status(&mut rig).enable_output), (false, Some(false)));
    rig.ask(Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 })).unwrap();
    assert_eq!((rig.gateway.enable_output(), status(&mut rig).enable_output), (true, Some(true)));
    let levels: Vec<_> = rig
        .events()
        .into_iter()
        .filter_map(|event| match event {
            HostEvent::EnableOutputChanged { active } => Some(*active),
            _ => None,
        })
        .collect();
    assert_eq!(levels, [false, true]);
}

#[test]
fn the_light_shows_the_gravest_thing() {
    let mut rig = bench::rmd_axes(2);
    assert_eq!(rig.gateway.light(), Light::Idle);
    let epoch = arm_axis(&mut rig, 0);
    assert_eq!(rig.gateway.light(), Light::Armed);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 30_000);
    assert_eq!(rig.gateway.light(), Light::Armed);
    rig.run(300_000);
    assert_eq!(listed_trip(&mut rig), Some(TripReason::SetpointExpired));
    assert_eq!(rig.gateway.light(), Light::Tripped);
    clear(&mut rig, ClearTarget::Axis(0)).unwrap();
    assert_eq!(rig.gateway.light(), Light::Holding);
    rig.run(300_000); // the host in command falls silent
    assert_eq!(rig.gateway.light(), Light::LinkLost);
    rig.ask(Request::Ping(requests::Ping {})).unwrap();
    assert_eq!(rig.gateway.light(), Light::Holding);
    bench::output_off(&mut rig).unwrap();
    assert_eq!(rig.gateway.light(), Light::Idle);
    bench::e_stop(&mut rig);
    assert_eq!(rig.gateway.light(), Light::EStopped);
}

fn listed_trip(rig: &mut Rig) -> Option<TripReason> {
    match rig.ask(Request::ReadState(requests::ReadState { axis: 0 })) {
        Ok(Reply::ReadState(report)) => report.trip.map(|trip| trip.reason),
        other => panic!("{other:?}"),
    }
}
