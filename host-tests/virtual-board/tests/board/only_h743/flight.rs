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

#[test]
fn what_led_to_a_trip_of_each_kind_is_played_again_to_the_same_microsecond() {
    let inject = |axis: u8, injection: Injection| {
        move |lab: &mut Lab| {
            lab.outside.inject(&mut lab.machine.borrow_mut(), axis.into(), injection);
        }
    };
    for axis in AXES {
        let found = tripped(inject(axis, Injection::Mute(true)));
        assert_eq!(found, (axis, TripReason::MotorSilent));
    }
    let (_, reason) = tripped(|lab| lab.client.estop().expect("stopped"));
    assert_eq!(reason, TripReason::EStop);
    let (_, reason) = tripped(|lab| lab.stay(STOP));
    assert_eq!(reason, TripReason::SetpointExpired);
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
    lab.keep(&holds, Duration::from_secs(4));
    lab.client.estop().expect("stopped");
    lab.stay(STOP);
    let (halves, replayed_one) = replayed(&mut lab);
    assert_eq!(halves, 2, "{replayed_one:?}");
    let (from, to) = replayed_one.span_us;
    println!("the last {} ms of it, {} calls", (to - from) / 1_000, replayed_one.calls);
    assert!(to - from > 300_000, "{replayed_one:?}");
    // It stays until an axis is armed again.
    assert_eq!(replayed(&mut lab), (halves, replayed_one));
    lab.client.clear(ClearTarget::Gateway).expect("cleared");
    lab.client.clear(ClearTarget::Axis(RMD_RS485)).expect("cleared");
    lab.arm(&[RMD_RS485]);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(STOP);
    assert_eq!(lab.client.flight_record().expect("it is read"), None);
}
