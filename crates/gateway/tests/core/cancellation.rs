//! Frames that a stop or a newer setpoint has replaced while they waited in a CAN controller (GUARANTEES G2, G4).

use crate::bench::{self, HOLD, VELOCITY, arm, run_with_host, setpoint, stop};
use crate::rig::Rig;
use host_protocol::{Reply, Request, Setpoint, StopAction, requests};

/// The setpoints of the bench and a slower one, on the wire (RMD V3.6 §2.18).
const FAST: &str = "141#A200000010270000";
const SLOW: &str = "141#A2000000E8030000"; // 10 °/s
const SLOW_VELOCITY: Setpoint = Setpoint::Velocity { velocity_rad_s: 0.174_532_93 };

/// An axis with a setpoint that waits in the controller of a cut bus.
fn waiting() -> (Rig, u32) {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    rig.run(10_000);
    rig.cut();
    let request = setpoint(&rig, epoch, 80_000, VELOCITY);
    rig.ask(request).unwrap();
    (rig, epoch)
}

fn cancelled(rig: &mut Rig) -> u32 {
    match rig.ask(Request::BusStatus(requests::BusStatus { bus: 0 })) {
        Ok(Reply::BusStatus(report)) => report.counters.cancelled,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_stop_takes_the_place_of_motion_that_has_not_left() {
    let (mut rig, _) = waiting();
    rig.run(10);
    let since = rig.now_us;
    stop(&mut rig);
    assert_eq!(rig.sent_since(0, since), [HOLD]);
    assert_eq!(rig.held_texts(), [HOLD]);
    assert_eq!(cancelled(&mut rig), 1);
}

#[test]
fn a_newer_setpoint_takes_the_place_of_one_that_has_not_left() {
    let (mut rig, epoch) = waiting();
    assert_eq!(rig.held_texts(), [FAST]);
    let request = setpoint(&rig, epoch, 80_000, SLOW_VELOCITY);
    rig.ask(request).unwrap();
    assert_eq!(rig.held_texts(), [SLOW]);
    assert_eq!(cancelled(&mut rig), 1);
    // The same again asks for nothing new.
    let request = setpoint(&rig, epoch, 80_000, SLOW_VELOCITY);
    rig.ask(request).unwrap();
    assert_eq!(cancelled(&mut rig), 1);
}

#[test]
fn a_frame_that_is_already_on_the_wire_goes_on_and_the_stop_follows() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    rig.run(10_000);
    let since = rig.now_us;
    let request = setpoint(&rig, epoch, 80_000, VELOCITY);
    rig.send(&request);
    stop(&mut rig);
    run_with_host(&mut rig, 20_000);
    assert_eq!(rig.sent_since(0, since)[..2], [FAST, HOLD]);
    assert_eq!(cancelled(&mut rig), 0);
}

#[test]
fn a_controller_that_does_not_report_is_started_again() {
    let (mut rig, _) = waiting();
    rig.stubborn = true;
    let before = rig.gateway.bus_setup(0).unwrap().generation;
    stop(&mut rig);
    rig.run(9_000);
    assert_eq!(rig.gateway.bus_setup(0).unwrap().generation, before);
    rig.run(3_000);
    assert_eq!(rig.gateway.bus_setup(0).unwrap().generation, before + 1);
    assert_eq!(rig.held_texts(), [HOLD]);
}
