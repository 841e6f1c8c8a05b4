//! Everything that must stop a motor, stops it.

use crate::bench::{
    self, COAST, HOLD, VELOCITY, arm, assert_tripped, clear, e_stop, keep_moving, listed,
    move_axis, run_with_host, setpoint, state, stop,
};
use crate::rig::{Instead, Rig, Said};
use host_protocol::{
    AuthorityLossReason, AxisParameter, AxisState, ClearTarget, Error, Event as HostEvent,
    Protocol, Quantity, Request, Setpoint, StopAction, StopTarget, TripReason, Value, requests,
};

/// Reads the speed (RMD V3.6 §2.13).
const SPEED: &str = "141#9C00000000000000";

#[test]
fn an_expired_setpoint_trips_and_the_stop_goes_out_at_once() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    let expiry = rig.now_us + 80_000;
    run_with_host(&mut rig, 200_000);
    assert_tripped(&mut rig, TripReason::SetpointExpired, true);
    let (at, _, _) =
        rig.wire.iter().find(|(at, _, text)| *at + 200 >= expiry && text == HOLD).unwrap();
    assert!(at.abs_diff(expiry) <= 200, "stop at {at}, expiry about {expiry}");
    let stops = rig.sent_since(0, expiry - 200).iter().filter(|text| **text == HOLD).count();
    assert!(stops >= 2);
}

#[test]
fn a_silent_host_trips_what_moves() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::TtlUs, Value::Unsigned(10_000_000));
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 5_000_000, VELOCITY);
    rig.ask(request).unwrap();
    let last = rig.now_us;
    rig.run(400_000);
    let (at, _, _) = rig.wire.iter().find(|(at, _, text)| *at > last && text == HOLD).unwrap();
    assert!(*at <= last + 250_000 + 200, "stop at {at}, last frame at {last}");
    assert_tripped(&mut rig, TripReason::HostSilent, true);
}

#[test]
fn a_silent_host_disarms_what_is_armed() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    arm(&mut rig);
    rig.run(400_000);
    let state = state(&mut rig);
    assert_eq!((state.state, state.trip), (AxisState::Holding, None));
    assert!(rig.events().iter().any(|event| matches!(event, HostEvent::AuthorityLost { .. })));
}

#[test]
fn a_silent_motor_trips_and_the_stop_is_repeated_until_it_answers() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    let epoch = move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    let muted = rig.now_us;
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 150_000);
    assert_tripped(&mut rig, TripReason::MotorSilent, false);
    let stops = rig.sent_since(0, muted).iter().filter(|text| **text == HOLD).count();
    assert!(stops >= 3, "{stops} stops");
    play.borrow_mut().mute = false;
    run_with_host(&mut rig, 700_000);
    assert_tripped(&mut rig, TripReason::MotorSilent, true);
}

#[test]
fn an_unreachable_motor_is_reported_and_left_only_by_the_unsafe_way() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 2_000_000);
    assert!(rig.events().iter().any(|event| matches!(
        event,
        HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }
    )));
    assert!(state(&mut rig).trip.unwrap().unreachable);
    assert_eq!(clear(&mut rig), Err(Error::StopNotConfirmed { axis: 0 }));
    rig.ask(Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 })).unwrap();
}

#[test]
fn a_fault_bit_trips_and_clearing_waits_for_it_to_go() {
    let (mut rig, play) = bench::rmd(StopAction::Coast);
    let epoch = move_axis(&mut rig, VELOCITY);
    play.borrow_mut().fault = true;
    let since = rig.now_us;
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 150_000);
    let reason = TripReason::MotorFault { faults: 2 };
    assert_tripped(&mut rig, reason, true);
    assert!(rig.sent_since(0, since).contains(&COAST));
    assert_eq!(clear(&mut rig), Err(Error::CauseRemains { axis: 0, reason }));
    play.borrow_mut().fault = false;
    clear(&mut rig).unwrap();
    assert_eq!(state(&mut rig).state, AxisState::Idle);
}

#[test]
fn a_refusing_thruster_trips_and_its_stop_is_not_confirmed_by_the_refusal() {
    let (mut rig, play) = bench::thruster();
    let epoch = arm(&mut rig);
    play.borrow_mut().refuses = true;
    let since = rig.now_us;
    let request = setpoint(&rig, epoch, 80_000, Setpoint::Signal { fraction: 0.5 });
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 100_000);
    assert_tripped(&mut rig, TripReason::CommandRefused { faults: Some(0) }, false);
    let sent = rig.sent_since(0, since);
    let stop = sent.iter().position(|text| *text == "30B#5443000000000000").unwrap();
    assert_eq!(sent.get(stop + 1..stop + 3), Some(&["30B#45460000", "30B#51560000"][..])); // EF, QV
    play.borrow_mut().refuses = false;
    run_with_host(&mut rig, 100_000);
    assert_tripped(&mut rig, TripReason::CommandRefused { faults: Some(0) }, true);
}

#[test]
fn a_command_thrown_back_twice_trips() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    play.borrow_mut().refuses = true;
    let request = setpoint(&rig, epoch, 80_000, VELOCITY);
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 60_000);
    assert_tripped(&mut rig, TripReason::CommandRefused { faults: Some(0) }, true);
}

#[test]
fn a_measured_speed_beyond_the_limit_trips() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(5.0));
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true; // 500 °/s = 8.7 rad/s
    run_with_host(&mut rig, 70_000);
    let state = state(&mut rig);
    let Some(TripReason::LimitExceeded { quantity: Quantity::Velocity, value, .. }) =
        state.trip.map(|trip| trip.reason)
    else {
        panic!("{state:?}");
    };
    assert_eq!(value, 8.726_646);
}

#[test]
fn holding_is_confirmed_only_by_two_readings_of_standstill() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    run_with_host(&mut rig, 300_000);
    assert_eq!(state(&mut rig).state, AxisState::Stopping);
    play.borrow_mut().turning = false;
    let since = rig.now_us;
    run_with_host(&mut rig, 60_000);
    assert_eq!(state(&mut rig).state, AxisState::Holding);
    let readings =
        rig.sent_since(0, since).iter().filter(|text| text.starts_with("141#9C")).count();
    assert!(readings >= 2);
    let confirmed =
        |said: &Said| matches!(said, Said::Event(HostEvent::StopConfirmed { axis: 0, .. }));
    assert_eq!(rig.said.iter().filter(|said| confirmed(said)).count(), 1);
}

#[test]
fn a_confirmed_stop_is_repeated_while_tripped() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    run_with_host(&mut rig, 300_000);
    assert_tripped(&mut rig, TripReason::SetpointExpired, true);
    let since = rig.now_us;
    run_with_host(&mut rig, 2_000_000);
    let stops = rig.sent_since(0, since).iter().filter(|text| **text == HOLD).count();
    assert!((3..=5).contains(&stops), "{stops} stops in 2 s");
}

#[test]
fn e_stop_stops_everything_and_nothing_is_armed_until_it_is_cleared() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    let since = rig.now_us;
    e_stop(&mut rig);
    run_with_host(&mut rig, 100_000);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert_tripped(&mut rig, TripReason::EStop, true);
    let remains = Error::CauseRemains { axis: 0, reason: TripReason::EStop };
    assert_eq!(clear(&mut rig), Err(remains));
    rig.ask(Request::Clear(requests::Clear { target: ClearTarget::Gateway })).unwrap();
    clear(&mut rig).unwrap();
    arm(&mut rig);
}

#[test]
fn a_late_reply_to_motion_is_not_taken_for_the_stops() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    rig.run(20_500); // a refresh is under way, unanswered
    let since = rig.now_us;
    stop(&mut rig);
    rig.receive(0, "241#A2326400F4012D00");
    rig.run(300);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert!(!state(&mut rig).stop_acknowledged);
}

#[test]
fn a_late_reply_to_a_setpoint_of_0_is_not_taken_for_that_of_the_same_stop() {
    let (mut rig, _) = bench::thruster_that_owes_the_reply_to_a_setpoint_of_0();
    rig.run(5_200); // the reply window has closed
    stop(&mut rig);
    rig.run(200);
    let tc_0 = "30B#5443000000000000";
    assert_eq!(
        rig.wire.iter().filter(|(at, _, text)| *at + 6_000 > rig.now_us && text == tc_0).count(),
        2
    );
    rig.receive(0, "28B#5443000000000000");
    assert!(!state(&mut rig).stop_acknowledged);
}

#[test]
fn fault_words_that_are_not_answered_trip_although_motion_is() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    rig.instead(
        |text| if text.starts_with("141#9A") { Instead::Nothing } else { Instead::AsUsual },
    );
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 600_000);
    assert_tripped(&mut rig, TripReason::MotorSilent, true);
}

#[test]
fn a_stop_that_is_acknowledged_but_never_stands_still_trips() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    run_with_host(&mut rig, 10_000_000);
    assert_tripped(&mut rig, TripReason::StopUnconfirmed, false);
}

#[test]
fn giving_back_authority_stops_and_disarms_without_a_trip() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    let since = rig.now_us;
    rig.ask(Request::ReleaseAuthority(requests::ReleaseAuthority {})).unwrap();
    assert_eq!(listed(&mut rig, 0), AxisState::Stopping);
    run_with_host(&mut rig, 100_000);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    let state = state(&mut rig);
    assert_eq!((state.state, state.trip, state.epoch), (AxisState::Holding, None, None));
    let released = HostEvent::AuthorityLost { reason: AuthorityLossReason::Released };
    assert!(rig.events().contains(&&released));
}

#[test]
fn stopping_all_leaves_an_axis_alone_whose_bus_does_not_run() {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    bench::configure_axis(&mut rig, 0, 0, Protocol::Rmd, 1, StopAction::Hold);
    rig.ask(Request::Stop(requests::Stop { target: StopTarget::All })).unwrap();
    run_with_host(&mut rig, 1_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
}

/// How often the speed is still read until the stop is confirmed, when the answer to the second
/// reading is `late`.
fn readings_after(late: &str) -> usize {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(1_000);
    let mut polls = 0;
    rig.instead(move |text| {
        polls += u32::from(text == SPEED);
        if text == SPEED && polls == 2 { Instead::Nothing } else { Instead::AsUsual }
    });
    let stopped_at = rig.now_us;
    stop(&mut rig);
    while rig.sent_since(0, stopped_at).iter().filter(|text| **text == SPEED).count() < 2 {
        rig.run(100);
    }
    // Its window of 5 ms closes.
    rig.run(5_500);
    rig.receive(0, late);
    let since = rig.now_us;
    while bench::outcomes(&rig).is_empty() {
        rig.run(100);
        assert!(rig.now_us < since + 30_000);
    }
    rig.sent_since(0, since).iter().filter(|text| **text == SPEED).count()
}

/// What was read before does not count if a late answer says that the motor turned.
#[test]
fn a_late_reading_shows_no_standstill_and_can_show_that_there_is_none() {
    let stands = readings_after("241#9C1E0A0000000000");
    let turns = readings_after("241#9C1E0A0064000000");
    assert_eq!(turns, stands + 1);
}
