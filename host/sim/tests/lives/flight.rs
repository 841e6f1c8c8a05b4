//! The flight recorder of a simulated board, read over a host link.

use std::ops::ControlFlow;
use std::time::Duration;

use flight_recorder::Recording;
use host_protocol::{BootReason, ClearTarget, Error, StopTarget, Trip, TripReason};
use mgw_client::{Client, ClientError, Hold};
use mgw_sim::Wiring;

use crate::four_motors::Rig;

/// A host that falls silent while axes move: what is kept then, and of which trip.
fn tripped(rig: &mut Rig) -> (Vec<u8>, (u8, Trip)) {
    rig.move_for(Duration::from_millis(50));
    rig.silence(1_000);
    let file = rig.client.flight_record().unwrap().expect("it has kept the trip");
    let trip = Recording::read_file(&file).unwrap().trip.expect("of an axis");
    (file, trip)
}

#[test]
fn what_led_to_a_trip_is_read_until_an_axis_is_armed_again() {
    let mut rig = Rig::new(Wiring::four_motors());
    assert_eq!(rig.client.flight_record().unwrap(), None, "nothing has moved yet");
    let (file, (axis, trip)) = tripped(&mut rig);
    assert_eq!(trip.reason, TripReason::SetpointExpired);
    assert_eq!(
        Some(trip.time_us),
        rig.client.read_state(axis).unwrap().trip.map(|trip| trip.time_us)
    );
    // It is read again as it was, whatever came since, also after a reset.
    rig.silence(1_000);
    assert_eq!(rig.client.flight_record().unwrap(), Some(file.clone()));
    rig.world.borrow_mut().reset(BootReason::Watchdog, "");
    rig.silence(1_000);
    rig.client.reconnect().unwrap();
    assert_eq!(rig.client.flight_record().unwrap(), Some(file.clone()));

    for axis in 0..4 {
        rig.client.clear(ClearTarget::Axis(axis)).unwrap();
    }
    rig.client.arm(0).unwrap();
    let error = rig.client.flight_record().unwrap_err();
    assert!(matches!(error, ClientError::Gateway(Error::FlightRecording {})), "{error}");
    rig.client.stop(StopTarget::All).unwrap();
    rig.client.pause(Duration::from_millis(500)).unwrap();
    assert_eq!(rig.client.flight_record().unwrap(), None, "nothing has tripped since");
    let (other, _) = tripped(&mut rig);
    assert_ne!(other, file);
}

#[test]
fn what_may_still_trip_is_recorded_to_its_end() {
    let mut rig = Rig::new(Wiring::four_motors());
    let holds = rig.arm();
    let hold = |holds: &[Hold], client: &mut Client<_>, ms| {
        let time = Duration::from_millis(ms);
        client.hold_setpoints(holds, time, |_| Ok(ControlFlow::Continue(()))).unwrap();
    };
    hold(&holds, &mut rig.client, 50);
    // Axis 0 is given no setpoints any more and trips; the others go on, and may trip later.
    hold(&holds[1..], &mut rig.client, 300);
    assert!(rig.client.read_state(0).unwrap().trip.is_some());
    let error = rig.client.flight_record().unwrap_err();
    assert!(matches!(error, ClientError::Gateway(Error::FlightRecording {})), "{error}");
    rig.client.stop(StopTarget::All).unwrap();
    rig.client.pause(Duration::from_millis(500)).unwrap();
    let file = rig.client.flight_record().unwrap().expect("it has kept the trip");
    let trip = Recording::read_file(&file).unwrap().trip;
    assert_eq!(trip.map(|(axis, _)| axis), Some(0));
    // What stops was not armed: it stays, whoever stops what stands, and however often.
    rig.client.stop(StopTarget::All).unwrap();
    rig.client.pause(Duration::from_millis(500)).unwrap();
    assert_eq!(rig.client.flight_record().unwrap(), Some(file.clone()));
    rig.world.borrow_mut().reset(BootReason::Watchdog, "");
    rig.silence(1_000);
    rig.client.reconnect().unwrap();
    rig.client.stop(StopTarget::All).unwrap();
    rig.client.pause(Duration::from_millis(500)).unwrap();
    assert_eq!(rig.client.flight_record().unwrap(), Some(file));
    rig.world.borrow_mut().reset(BootReason::PowerOn, "");
    rig.silence(1_000);
    rig.client.reconnect().unwrap();
    assert_eq!(rig.client.flight_record().unwrap(), None);
}
