//! Frames that a stop or a newer setpoint has replaced while they waited in a CAN controller
//! (GUARANTEES G2, G4).

use crate::bench::{self, HOLD, VELOCITY, arm, run_with_host, setpoint, stop};
use crate::rig::Rig;
use host_protocol::{
    CanFrame, Error, Event, NoReplyHint, RawFrame, Reply, Request, Setpoint, StopAction,
    TripReason, requests,
};

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

/// The setpoint expires in the moment in which the reply to one before comes again.
#[test]
fn a_reply_that_comes_twice_does_not_keep_motion_in_the_controller() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    rig.run(10_000);
    rig.cut();
    let request = setpoint(&rig, epoch, 5_000, VELOCITY);
    rig.ask(request).unwrap();
    assert_eq!(rig.held_texts(), [FAST]);
    rig.now_us += 6_000;
    rig.receive(0, "241#A21E0A0000000000");
    assert_eq!(rig.held_texts(), [HOLD]);
}

#[test]
fn what_was_given_up_does_not_leave_when_nobody_expects_it_any_more() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    rig.cut();
    let release_brake = bench::native(&rig, 0, "7700000000000000");
    let sequence = rig.send(&release_brake);
    run_with_host(&mut rig, 100_000);
    let hint = NoReplyHint::NotAcknowledged;
    assert_eq!(rig.answer(sequence), Some(Err(Error::NoReply { axis: 0, hint })));
    assert_eq!(rig.held_texts(), Vec::<&str>::new());
    // A stop of the same id finds its place free.
    stop(&mut rig);
    run_with_host(&mut rig, 10_000);
    assert_eq!(rig.held_texts(), [HOLD]);
}

#[test]
fn a_raw_frame_does_not_outlive_the_raw_access() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.ask(Request::RawOpen(requests::RawOpen { bus: 0, unsafe_access: false })).unwrap();
    rig.cut();
    let frame = CanFrame::standard(0x149, &crate::text::unhex("9C00000000000000")).unwrap();
    rig.ask(Request::RawSend(requests::RawSend { bus: 0, frame: RawFrame::Can(frame) })).unwrap();
    assert_eq!(rig.held_texts(), ["149#9C00000000000000"]);
    rig.run(1_000_000); // the host is silent: its authority is lost, and with it the raw access
    assert_eq!(rig.held_texts(), Vec::<&str>::new());
}

/// A motor that answers its stop and turns on is given up after 5 s; a stop that is asked for just
/// before that waits behind the frames of others.
#[test]
fn a_stop_that_waits_is_not_taken_back_when_its_motor_is_given_up() {
    let (mut rig, play) = bench::rmd_with_timeout(400);
    bench::move_axis(&mut rig, VELOCITY);
    rig.run(1_000);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    let began = rig.now_us;
    run_with_host(&mut rig, 4_970_000);
    rig.babble(Some(0));
    bench::e_stop(&mut rig);
    rig.run(15_000);
    assert_eq!((rig.held_texts(), bench::outcomes(&rig)), (vec![HOLD], vec![]));
    rig.run(began + 5_010_000 - rig.now_us);
    assert_eq!(bench::outcomes(&rig), [Event::AxisUnreachable { axis: 0, stop_transmitted: true }]);
    assert_eq!(rig.held_texts(), [HOLD]);
    let since = rig.left.len();
    rig.babble(None);
    run_with_host(&mut rig, 10_000);
    assert_eq!(rig.left[since].2, HOLD);
}

/// 20 ms and 4 frame times after the first setpoint that nobody acknowledged; that one may come 10
/// ms after the cut: a reply that is missing closes its window first, and the next setpoint its
/// period.
#[test]
fn changing_setpoints_do_not_put_off_the_missing_acknowledgement() {
    for phase in 0..50 {
        let (mut rig, _) = bench::rmd(StopAction::Hold);
        let epoch = arm(&mut rig);
        let mut velocity_rad_s = 1.0;
        let mut go_on = |rig: &mut Rig, us| {
            velocity_rad_s += 0.001;
            let request = setpoint(rig, epoch, 80_000, Setpoint::Velocity { velocity_rad_s });
            rig.send(&request);
            rig.run(us);
        };
        (0..30).for_each(|_| go_on(&mut rig, 5_000));
        go_on(&mut rig, phase * 100);
        rig.cut();
        let cut_at = rig.now_us;
        (0..20).for_each(|_| go_on(&mut rig, 5_000));
        let trip_of = |event: &Event| match event {
            Event::Tripped { trip, .. } => Some((trip.reason, trip.time_us - cut_at)),
            _ => None,
        };
        let (reason, after_us) = rig.events().into_iter().find_map(trip_of).expect("a trip");
        assert_eq!(reason, TripReason::NotAcknowledged);
        assert!(after_us <= 31_000, "{after_us} µs after the cut");
    }
}
