//! A setpoint that was accepted is on the wire in time, or its axis trips, whatever kept it
//! (GUARANTEES G2).

use crate::bench::{self, D5_VELOCITY, VELOCITY, arm_axis, configure_axis, keep_moving};
use crate::motors;
use crate::rig::Rig;
use host_protocol::{AxisState, Event as HostEvent, Protocol, StopAction, TripReason};

/// Refresh, unless configured otherwise.
const REFRESH_US: u64 = 20_000;

/// One RMD axis on a line at 115200 baud, whose frames take 1129 us and whose pause takes 174 us: a
/// stop, twice the window of the motor, four exchanges.
const BOUND_US: u64 =
    100 + (2 * 1_129 + 1_000 + 174 + 1_129) + 2 * 5_000 + 4 * (2 * 1_129 + 174 + 5_000);

fn rig() -> Rig {
    let mut rig = Rig::new();
    rig.motor = Box::new(motors::rmd(std::rc::Rc::default()));
    bench::hello(&mut rig);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
    configure_axis(&mut rig, 0, 0, Protocol::Rmd, 1, StopAction::Hold);
    configure_axis(&mut rig, 1, 0, Protocol::Rmd, 0x14, StopAction::Hold);
    rig
}

fn trip(rig: &Rig) -> Option<(TripReason, u64)> {
    rig.events().into_iter().find_map(|event| match event {
        HostEvent::Tripped { axis: 0, trip } => Some((trip.reason, trip.time_us)),
        _ => None,
    })
}

/// Noise leaves the line no pause: setpoints are accepted, and none is sent.
#[test]
fn setpoints_that_never_find_the_line_free_trip_however_often_they_are_replaced() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 55_000);
    rig.run(7_000); // what was under way is answered
    let accepted = rig.now_us;
    let noisy = |rig: &mut Rig, us: u64| {
        for _ in 0..us / 100 {
            rig.receive(2, "55");
            rig.run(100);
        }
    };
    for turn in 0..15 {
        let value = if turn % 2 == 0 { D5_VELOCITY } else { VELOCITY };
        rig.receive(2, "55");
        keep_moving(&mut rig, &[(0, epoch)], value, 100);
        noisy(&mut rig, 5_000);
    }
    let (reason, at) = trip(&rig).expect("a trip");
    assert_eq!(reason, TripReason::NotDelivered);
    assert_eq!(at, accepted + REFRESH_US + BOUND_US);
    let sent = rig.sent_since(2, accepted);
    assert!(sent.first().is_some_and(|text| text.starts_with("3E010881")), "{sent:?}");
}

/// Where the bus has taken it and nobody acknowledges, that is the reason: it comes first.
#[test]
fn a_setpoint_that_nobody_acknowledges_trips_as_such() {
    let mut rig = rig();
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 55_000);
    rig.cut();
    keep_moving(&mut rig, &[(0, epoch)], D5_VELOCITY, 50_000);
    assert_eq!(trip(&rig).map(|(reason, _)| reason), Some(TripReason::NotAcknowledged));
}

#[test]
fn setpoints_that_are_delivered_do_not_trip() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 2_000_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Active);
}
