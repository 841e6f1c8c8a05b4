//! Impedance setpoints: RMD motion mode (RMD V3.6 §5).

use crate::bench::{self, arm, run_with_host, setpoint};
use crate::rig::Instead;
use host_protocol::{
    AxisParameter, Error, Protocol, Quantity, Request, Setpoint, StateField, StateFields,
    StopAction, TripReason, Value, requests,
};

fn impedance(position_rad: f32, torque_nm: f32) -> Setpoint {
    Setpoint::Impedance {
        position_rad,
        velocity_rad_s: 1.0,
        stiffness_nm_per_rad: 10.0,
        damping_nm_s_per_rad: 1.0,
        torque_nm,
    }
}

/// RMD V3.6 §5.4, request and reply.
const REQUEST: &str = "401#E66682E052333B55";
const REPLY: &str = "501#01E66582EB550000";

#[test]
fn motion_mode_is_sent_as_the_manual_prints_it_and_refreshed() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.instead(|text| if text == REQUEST { Instead::Says(REPLY) } else { Instead::AsUsual });
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = setpoint(&rig, epoch, 80_000, impedance(10.0, 10.0));
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 70_000);
    assert_eq!(rig.sent_since(0, since).iter().filter(|text| **text == REQUEST).count(), 4);
    // Answered all the time: it ends by its expiry, not by silence.
    run_with_host(&mut rig, 100_000);
    assert_eq!(
        bench::state(&mut rig).trip.map(|trip| trip.reason),
        Some(TripReason::SetpointExpired)
    );
    assert!(rig.sent_since(0, since).contains(&bench::HOLD));
}

#[test]
fn values_beyond_limit_or_range_are_refused_by_name() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::TorqueLimitNm, Value::Float(12.0));
    bench::parameter(&mut rig, 0, AxisParameter::MotionPositionRad, Value::Float(6.0));
    let epoch = arm(&mut rig);
    let refusals = [
        (impedance(0.0, 12.5), Quantity::Torque, 12.5, 12.0),
        (impedance(7.0, 0.0), Quantity::Position, 7.0, 6.0),
    ];
    for (value, quantity, asked, end) in refusals {
        let request = setpoint(&rig, epoch, 80_000, value);
        assert_eq!(
            rig.ask(request),
            Err(Error::OutOfRange { quantity, value: asked, min: -end, max: end })
        );
    }
    let negative = Setpoint::Impedance {
        position_rad: 0.0,
        velocity_rad_s: 0.0,
        stiffness_nm_per_rad: -1.0,
        damping_nm_s_per_rad: 0.0,
        torque_nm: 0.0,
    };
    let request = setpoint(&rig, epoch, 80_000, negative);
    assert!(matches!(
        rig.ask(request),
        Err(Error::OutOfRange { quantity: Quantity::Stiffness, .. })
    ));
    let request = setpoint(&rig, epoch, 80_000, impedance(0.0, f32::NAN));
    assert_eq!(rig.ask(request), Err(Error::NotANumber { quantity: Quantity::Torque }));
}

#[test]
fn a_torque_beyond_the_limit_trips() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::TorqueLimitNm, Value::Float(5.0));
    // The motor reports 10 N·m.
    rig.instead(
        |text| if text.starts_with("401#") { Instead::Says(REPLY) } else { Instead::AsUsual },
    );
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 80_000, impedance(0.0, 4.0));
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 10_000);
    let reason = bench::state(&mut rig).trip.map(|trip| trip.reason);
    assert!(
        matches!(reason, Some(TripReason::LimitExceeded { quantity: Quantity::Torque, .. })),
        "{reason:?}"
    );
}

#[test]
fn there_is_no_motion_mode_on_rs485() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 80_000, impedance(0.0, 0.0));
    assert_eq!(rig.ask(request), Err(Error::Unsupported { axis: 0, protocol: Protocol::Rmd }));
}

/// In motion mode the motor tells velocity and torque (§5.4): its current is read all the same,
/// however often it answers.
#[test]
fn the_current_of_a_motor_in_motion_mode_is_read_and_limited() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::CurrentLimitA, Value::Float(2.0));
    let epoch = arm(&mut rig);
    rig.instead(|text| if text == REQUEST { Instead::Says(REPLY) } else { Instead::AsUsual });
    bench::keep_moving(&mut rig, &[(0, epoch)], impedance(10.0, 10.0), 300_000);
    // 20 A (§2.13).
    rig.instead(|text| match text {
        "141#9C00000000000000" => Instead::Says("241#9C32D00700000000"),
        _ => Instead::AsUsual,
    });
    bench::keep_moving(&mut rig, &[(0, epoch)], impedance(10.0, 10.0), 300_000);
    let reason = bench::state(&mut rig).trip.map(|trip| trip.reason);
    let exceeded = matches!(
        reason,
        Some(TripReason::LimitExceeded { quantity: Quantity::Current, value, .. }) if value == 20.0
    );
    assert!(exceeded, "{reason:?}");
}

/// A free-running cycle reads what the reply to the setpoint does not tell.
#[test]
fn a_cycle_reads_the_current_of_a_motor_in_motion_mode_in_each_period() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.instead(|text| if text == REQUEST { Instead::Says(REPLY) } else { Instead::AsUsual });
    let epoch = arm(&mut rig);
    let fields = StateFields::of(&[StateField::Current]);
    let cycle = requests::RunCycle { axes: 1, fields, period_us: 5_000 };
    rig.ask(Request::RunCycle(cycle)).unwrap();
    let since = rig.now_us;
    bench::keep_moving(&mut rig, &[(0, epoch)], impedance(10.0, 10.0), 100_000);
    let sent = rig.sent_since(0, since);
    let count = |wanted: &str| sent.iter().filter(|text| **text == wanted).count();
    assert!((18..=22).contains(&count(REQUEST)), "{sent:?}");
    assert!((18..=22).contains(&count("141#9C00000000000000")), "{sent:?}");
}
