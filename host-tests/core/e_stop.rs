//! An e-stop of many axes: the first stop of each bus does not wait for the others.

use crate::bench::{self, VELOCITY, arm_axis, axis_setpoint};
use crate::rig::Rig;
use gateway::{Event, Outgoing, Set};
use host_protocol::{
    AxisState, Error, Event as HostEvent, Incident, MAX_FRAME, Protocol, Request, StopAction,
    TripReason, requests,
};

/// Three armed axes on bus 0 and one at rest, two armed ones on bus 1.
const ARMED: [u8; 5] = [0, 1, 2, 4, 5];
const AXES: u8 = 6;

/// The motors stand; and the epoch of the last axis.
fn six() -> (Rig, u32) {
    let mut rig = bench::rmd_axes(4);
    bench::configure_bus(&mut rig, 1, 1_000_000, &[Protocol::Rmd]);
    for axis in [4, 5] {
        bench::configure_axis(&mut rig, axis, 1, Protocol::Rmd, axis - 3, StopAction::Hold);
    }
    let epoch = ARMED.map(|axis| arm_axis(&mut rig, axis))[4];
    rig.run(1_000);
    (rig, epoch)
}

fn set(axes: &[u8]) -> Set {
    axes.iter().fold(Set::NONE, |set, axis| set.with(Set::of(*axis)))
}

/// The next frame for a bus.
fn next(rig: &mut Rig, bus: u8) -> Option<String> {
    let transmit = rig.gateway.poll_transmit(rig.now(), bus)?;
    match transmit.frame {
        Outgoing::Can(frame) => Some(crate::text::can_text(&frame)),
        Outgoing::Serial(_) => None,
    }
}

#[test]
fn the_first_stop_of_each_bus_goes_before_the_e_stop_reaches_the_others() {
    let (mut rig, _) = six();
    rig.take_in(Event::EStopInput { open: true });
    let at = rig.now();
    assert_eq!(rig.gateway.tripped(), Set::NONE);
    assert_eq!(next(&mut rig, 1).as_deref(), Some("141#8100000000000000"));
    assert_eq!(rig.gateway.tripped(), set(&[4]));
    assert_eq!(next(&mut rig, 0).as_deref(), Some("141#8100000000000000"));
    assert_eq!(rig.gateway.tripped(), set(&[0, 4]));
    // Nothing else leaves meanwhile, and it is due at once.
    assert_eq!((next(&mut rig, 0), next(&mut rig, 1)), (None, None));
    assert!(!rig.gateway.all_at_rest());
    assert_eq!(rig.gateway.next_deadline(), Some(at));
    // Each tick reaches one axis more.
    let others = (0..6).filter(|axis| ![0, 4].contains(axis));
    for _ in others {
        assert!(rig.gateway.next_deadline().is_some_and(|due| due <= rig.now()));
        rig.now_us += 70;
        rig.take_in(Event::Tick);
    }
    assert_eq!(rig.gateway.tripped(), set(&ARMED));
    assert!(rig.gateway.next_deadline().is_none_or(|due| due > rig.now()));
    // All at the same time, for the same reason; what was at rest is stopped too.
    for (axis, trip) in rig.gateway.trips(set(&ARMED)) {
        assert_eq!((trip.reason, trip.time_us), (TripReason::EStop, at.as_micros()), "axis {axis}");
    }
    assert_eq!(rig.gateway.moving(), set(&[3]));
}

/// Where no tick comes for a while the reports of a bus lead from stop to stop.
#[test]
fn what_a_bus_reports_is_followed_by_its_next_stop() {
    let (mut rig, _) = six();
    let since = rig.now_us;
    rig.handle(Event::EStopInput { open: true });
    rig.run_without_ticks(2_000);
    let ids = |bus| rig.sent_since(bus, since).iter().map(|text| &text[..6]).collect::<Vec<_>>();
    assert_eq!(ids(0)[..4], ["141#81", "142#81", "143#81", "144#81"]);
    assert_eq!(ids(1)[..2], ["141#81", "142#81"]);
    assert_eq!(rig.gateway.tripped(), set(&ARMED));
}

/// Whenever the e-stop comes between two steps of an arming, and however late the next tick is.
#[test]
fn an_e_stop_ends_an_arming_before_its_next_reply() {
    let arm = Request::Arm(requests::Arm { axis: 3 });
    let is_armed = |rig: &Rig| {
        rig.events().contains(&&HostEvent::StateChanged { axis: 3, state: AxisState::Armed })
    };
    let mut ended = 0;
    for after in (0..).step_by(40) {
        let (mut rig, _) = six();
        let sequence = rig.send(&arm);
        rig.run(after);
        if rig.answer(sequence).is_some() {
            break;
        }
        rig.take_in(Event::EStopInput { open: true });
        rig.run_without_ticks(5_000);
        assert!(!is_armed(&rig), "{after} µs");
        rig.run(5_000);
        assert!(rig.answer(sequence).is_some_and(|answer| answer.is_err()), "{after} µs");
        ended += 1;
    }
    assert!(ended > 10, "{ended}");
}

#[test]
fn a_request_right_behind_an_e_stop_finds_every_axis_stopped() {
    let (mut rig, epoch) = six();
    let motion = axis_setpoint(&rig, 5, epoch, 80_000, VELOCITY);
    let mut bytes = Vec::new();
    for (sequence, request) in [(0x700, Request::EStop(requests::EStop {})), (0x701, motion)] {
        let mut frame = [0; MAX_FRAME];
        let length = request.encode_frame(sequence, &mut frame).unwrap();
        bytes.extend_from_slice(&frame[..length]);
    }
    let since = rig.now_us;
    rig.bytes(&bytes);
    rig.run(10_000);
    assert!(rig.answer(0x700).is_some_and(|answer| answer.is_ok()));
    let tripped = Err(Error::Tripped { axis: 5, reason: TripReason::EStop });
    assert_eq!(rig.answer(0x701), Some(tripped));
    assert!(rig.sent_since(1, since).iter().all(|text| !text.starts_with("142#A2")));
}

#[test]
fn a_reset_between_the_first_stop_and_the_others_forgets_neither_the_e_stop_nor_an_axis() {
    let (mut rig, _) = six();
    rig.take_in(Event::EStopInput { open: true });
    assert!(next(&mut rig, 0).is_some());
    rig.reset();
    bench::hello(&mut rig);
    bench::run_with_host(&mut rig, 50_000);
    for axis in 0..AXES {
        assert_eq!(bench::listed(&mut rig, axis), AxisState::Tripped { confirmed: true });
    }
}

#[test]
fn trips_are_remembered_in_the_order_in_which_they_were_told() {
    let (mut rig, _) = six();
    rig.take_in(Event::EStopInput { open: true });
    assert!(next(&mut rig, 1).is_some());
    assert!(next(&mut rig, 0).is_some());
    rig.run(10_000);
    let latest_first = bench::incidents(&mut rig, 0).incidents;
    let axes = latest_first.iter().filter_map(|incident| match incident {
        Incident::Tripped { axis, .. } => Some(*axis),
        Incident::Started { .. } => None,
    });
    assert_eq!(axes.collect::<Vec<_>>(), [5, 2, 1, 0, 4]);
}
