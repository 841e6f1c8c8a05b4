//! The flight recorder: what the board has kept of a trip is read over a host link, and played again
//! by the core of a computer.

use std::time::Duration;

use flight_recorder::Recording;
use host_protocol::{ClearTarget, Error, StopTarget, TripReason};
use mgw_cli::flight::{Replayed, play};
use mgw_client::ClientError;
use mgw_sim::Injection;
use virtual_board::machine::CanPort;
use virtual_stm32::fdcan::Wiring;

use crate::lab::{AXES, D5, Lab, RMD, RMD_RS485, THRUSTER};

/// Enough for a stop and its confirmation, where there is one.
const STOP: Duration = Duration::from_millis(300);

/// What a computer makes of what the board has kept.
#[track_caller]
fn replayed(lab: &mut Lab) -> (usize, Replayed) {
    let file = lab.client.flight_record().expect("it is read").expect("a trip was kept");
    let recording = Recording::read_file(&file).expect("a recording");
    let replayed = play(&recording, |_, _| {}).expect("a core of this build");
    assert!(replayed.is_same(), "{replayed:?}");
    (recording.halves.len(), replayed)
}

/// Has an axis trip in mid-motion. Returns why it did when that was played again.
#[track_caller]
fn tripped(fault: impl FnOnce(&mut Lab)) -> (u8, TripReason) {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    fault(&mut lab);
    lab.keep(&holds, STOP);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(STOP);
    let (_, replayed) = replayed(&mut lab);
    let (axis, recorded) = replayed.recorded.expect("a trip");
    let (from, to) = replayed.span_us;
    assert!(from < recorded.time_us && recorded.time_us < to, "{replayed:?}");
    let told = lab.report(axis).trip.map(|trip| (trip.reason, trip.time_us));
    assert_eq!(told, Some((recorded.reason, recorded.time_us)));
    (axis, recorded.reason)
}

fn inject(axis: u8, injection: Injection) -> impl FnOnce(&mut Lab) {
    move |lab| lab.outside.inject(&mut lab.machine.borrow_mut(), axis.into(), injection)
}

#[test]
fn what_led_to_a_trip_is_played_again_to_the_same_microsecond() {
    let found = tripped(inject(RMD_RS485, Injection::Mute(true)));
    assert_eq!(found, (RMD_RS485, TripReason::MotorSilent));
    let (_, reason) = tripped(|lab| lab.stay(STOP));
    assert_eq!(reason, TripReason::SetpointExpired);
}

/// A minute of a processor: by hand, with `-- --ignored`.
#[test]
#[ignore = "the kinds of trips that the test before leaves out"]
fn what_led_to_a_trip_of_other_kinds_is_played_again_to_the_same_microsecond() {
    for axis in [RMD, THRUSTER, D5] {
        let found = tripped(inject(axis, Injection::Mute(true)));
        assert_eq!(found, (axis, TripReason::MotorSilent));
    }
    let (_, reason) = tripped(|lab| lab.client.estop().expect("stopped"));
    assert_eq!(reason, TripReason::EStop);
    let (axis, reason) =
        tripped(|lab| lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Shorted));
    assert!(axis == RMD || axis == THRUSTER, "{axis}");
    assert_eq!(reason, TripReason::BusOff);
    let (axis, reason) = tripped(inject(D5, Injection::Unplugged(true)));
    assert_eq!(axis, D5, "{reason:?}");
}

#[test]
fn a_long_motion_keeps_the_latest_of_it_in_two_halves() {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    let error = lab.client.flight_record().expect_err("an axis moves");
    assert!(matches!(error, ClientError::Gateway(Error::FlightRecording {})), "{error:?}");
    for _ in 0..4 {
        lab.keep(&holds, Duration::from_secs(1));
        // It is told why this run was started, which the next one must not know otherwise.
        drop(lab.second_client());
    }
    lab.client.estop().expect("stopped");
    lab.stay(STOP);
    let first = &replayed(&mut lab);
    let (halves, kept) = first;
    assert_eq!(*halves, 2, "{kept:?}");
    let (from, to) = kept.span_us;
    println!("the last {} ms of it, {} calls", (to - from) / 1_000, kept.calls);
    assert!(to - from > 300_000, "{kept:?}");
    // It stays until an axis is armed again, also over a reset.
    assert_eq!(&replayed(&mut lab), first);
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_millis(500));
    lab.client.reconnect().expect("hello");
    assert_eq!(&replayed(&mut lab), first);
    lab.client.clear(ClearTarget::Gateway).expect("cleared");
    lab.client.clear(ClearTarget::Axis(RMD_RS485)).expect("cleared");
    lab.arm(&[RMD_RS485]);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(STOP);
    assert_eq!(lab.client.flight_record().expect("it is read"), None);
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_millis(500));
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.flight_record().expect("it is read"), None);
}
