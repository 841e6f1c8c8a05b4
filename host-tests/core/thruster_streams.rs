//! What a thruster sends unasked, as ML, MM and SR set it, reaches the hosts (Thruster manual §2.1,
//! §2.5).

use crate::bench::{self, arm, keep_moving, state};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, Event, Quantity, Request, Setpoint, StateField, StateFields, TripReason, Value,
    requests,
};

/// §2.5, frame 1: 300 rpm, 24.0 V, 1.6 A.
const SPEED: &str = "28B#4101012C00F00010";
/// §2.5, frame 2: no fault, 30 °C, 40 °C.
const CONDITION: &str = "28B#41020000001E0028";
/// §2.5, frame 3: two positions, of which the manual does not say how they lie.
const POSITIONS: &str = "28B#4103FC7C00015180";
/// §2.1, what ML and MM send: current and speed as QC and QV have them.
const CURRENT: &str = "28B#5143000000000010";
const RPM_300: &str = "28B#515600000000012C";

/// A thruster that answers nothing, watched by a host.
fn watched() -> Rig {
    let (mut rig, _) = bench::thruster();
    rig.instead(|_| Instead::Nothing);
    let fields = StateFields::of(StateField::ALL);
    rig.ask(Request::Subscribe(requests::Subscribe { axes: 1, fields, period_us: 50_000 }))
        .unwrap();
    rig.run(2_000_000);
    rig.said.clear();
    rig
}

/// Fields of the latest sample, rounded to hundredths.
fn sampled(rig: &Rig, fields: &[StateField]) -> Vec<Option<f32>> {
    let sample = rig.events().into_iter().rfind(|event| event.name() == "Sample").copied().unwrap();
    fields
        .iter()
        .map(|field| sample.reading(*field).map(|seen| (seen.value * 100.0).round() / 100.0))
        .collect()
}

/// The data of the notices that were told, and how many were left out before each.
fn notices(rig: &Rig) -> Vec<(String, u16)> {
    let told = rig.events().into_iter().filter_map(|event| match event {
        Event::MotorNotice { axis: 0, data, length: 8, unreported } => {
            Some((crate::text::hex(data), *unreported))
        }
        _ => None,
    });
    told.collect()
}

#[test]
fn frames_of_sr_are_told_as_samples_and_as_events() {
    use StateField::{Current, DriverTemperature, MotorTemperature, Velocity, Voltage};
    let mut rig = watched();
    for frame in [SPEED, CONDITION, POSITIONS] {
        rig.receive(0, frame);
    }
    rig.run(60_000);
    let fields = [Velocity, Voltage, Current, MotorTemperature, DriverTemperature];
    let values = [31.42, 24.0, 1.6, 30.0, 40.0];
    assert_eq!(sampled(&rig, &fields), values.map(Some));
    let told = [SPEED, CONDITION, POSITIONS].map(|frame| (frame[4..].to_owned(), 0));
    assert_eq!(notices(&rig), told);
}

#[test]
fn current_and_speed_of_ml_and_mm_are_told_as_samples_and_as_events() {
    let mut rig = watched();
    rig.receive(0, CURRENT);
    rig.receive(0, RPM_300);
    rig.run(60_000);
    assert_eq!(
        sampled(&rig, &[StateField::Current, StateField::Velocity]),
        [Some(1.6), Some(31.42)]
    );
    assert_eq!(notices(&rig), [CURRENT, RPM_300].map(|frame| (frame[4..].to_owned(), 0)));
}

/// An interval of 1 ms is allowed (§2.5): three frames each millisecond.
#[test]
fn a_stream_of_3000_frames_a_second_floods_no_host() {
    let mut rig = watched();
    for _ in 0..3_000 {
        for frame in [SPEED, CONDITION, POSITIONS] {
            rig.receive(0, frame);
        }
        rig.run(1_000);
    }
    let told = notices(&rig);
    assert!((9..=12).contains(&told.len()), "{told:?}");
    let unreported: u32 = told.iter().map(|(_, unreported)| u32::from(*unreported)).sum();
    assert!((5_900..9_000).contains(&unreported), "{told:?}");
    let samples = rig.events().iter().filter(|event| event.name() == "Sample").count();
    assert!(samples <= 61, "{samples}");
}

#[test]
fn what_a_stream_tells_is_held_against_the_limits_and_for_a_fault() {
    // 300 rpm are 31.4 rad/s; bit 6 of the status word is a stall, bit 12 only warns.
    let cases = [
        (SPEED, Some("LimitExceeded")),
        ("28B#4102004000000000", Some("MotorFault")),
        ("28B#4102100000000000", None),
        (POSITIONS, None),
    ];
    for (frame, trips) in cases {
        let (mut rig, _) = bench::thruster();
        bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(20.0));
        let epoch = arm(&mut rig);
        keep_moving(&mut rig, &[(0, epoch)], Setpoint::Signal { fraction: 0.1 }, 20_000);
        rig.receive(0, frame);
        let reason = state(&mut rig).trip.map(|trip| trip.reason);
        let name = match reason {
            Some(TripReason::LimitExceeded { quantity: Quantity::Velocity, .. }) => {
                Some("LimitExceeded")
            }
            Some(TripReason::MotorFault { faults: 0x40 }) => Some("MotorFault"),
            None => None,
            other => panic!("{frame}: {other:?}"),
        };
        assert_eq!(name, trips, "{frame}");
    }
}

/// A motor that only streams is silent: nothing that it was asked is answered.
#[test]
fn a_stream_is_no_reply() {
    let (mut rig, play) = bench::thruster();
    let epoch = arm(&mut rig);
    keep_moving(&mut rig, &[(0, epoch)], Setpoint::Signal { fraction: 0.1 }, 20_000);
    play.borrow_mut().mute = true;
    for _ in 0..30 {
        keep_moving(&mut rig, &[(0, epoch)], Setpoint::Signal { fraction: 0.1 }, 10_000);
        rig.receive(0, "28B#4101000000F00000");
    }
    assert_eq!(state(&mut rig).trip.map(|trip| trip.reason), Some(TripReason::MotorSilent));
}
