//! Everything that must stop a motor, stops it.

use crate::bench::{self, arm, move_axis, setpoint};
use crate::rig::{Rig, Said};
use gateway::Event;
use host_protocol::{
    AxisParameter, AxisState, BusState, ClearTarget, Error, Event as HostEvent, Quantity, Reply, Request,
    Setpoint, StopAction, StopTarget, TripReason, Value, replies, requests,
};

const VELOCITY: Setpoint = Setpoint::Velocity { velocity_rad_s: 1.745_329_3 };
const HOLD: &str = "141#8100000000000000";
const COAST: &str = "141#8000000000000000";

fn state(rig: &mut Rig) -> replies::AxisReport {
    match rig.ask(Request::ReadState(requests::ReadState { axis: 0 })) {
        Ok(Reply::ReadState(state)) => state,
        other => panic!("{other:?}"),
    }
}

fn assert_tripped(rig: &mut Rig, reason: TripReason, confirmed: bool) {
    let state = state(rig);
    assert_eq!(state.trip.map(|trip| trip.reason), Some(reason));
    assert_eq!(state.state, AxisState::Tripped { confirmed });
}

/// Runs with pings, so that the link is not silent.
fn run_with_host(rig: &mut Rig, us: u64) {
    let end = rig.now_us + us;
    while rig.now_us < end {
        rig.send(&Request::Ping(requests::Ping {}));
        rig.run(50_000.min(end - rig.now_us));
    }
}

#[test]
fn an_expired_setpoint_trips_and_the_stop_goes_out_at_once() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    let expiry = rig.now_us + 80_000;
    run_with_host(&mut rig, 200_000);
    assert_tripped(&mut rig, TripReason::SetpointExpired, true);
    let (at, _, _) = rig.wire.iter().find(|(at, _, text)| *at + 200 >= expiry && text == HOLD).unwrap();
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
    assert_eq!((state.state, state.trip), (AxisState::Idle, None));
    assert!(rig.events().iter().any(|event| matches!(event, HostEvent::AuthorityLost { .. })));
}

#[test]
fn a_silent_motor_trips_and_the_stop_is_repeated_until_it_answers() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    let muted = rig.now_us;
    bench_refresh(&mut rig, 150_000);
    assert_tripped(&mut rig, TripReason::MotorSilent, false);
    let stops = rig.sent_since(0, muted).iter().filter(|text| **text == HOLD).count();
    assert!(stops >= 3, "{stops} stops");
    play.borrow_mut().mute = false;
    run_with_host(&mut rig, 700_000);
    assert_tripped(&mut rig, TripReason::MotorSilent, true);
}

/// Keeps a setpoint fresh for a while.
fn bench_refresh(rig: &mut Rig, us: u64) {
    let end = rig.now_us + us;
    while rig.now_us < end {
        let request = setpoint(rig, 1, 80_000, VELOCITY);
        rig.send(&request);
        rig.run(10_000);
    }
}

#[test]
fn an_unreachable_motor_is_reported_and_left_only_by_the_unsafe_way() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 2_000_000);
    assert!(rig.events().iter().any(|event| matches!(event, HostEvent::AxisUnreachable { axis: 0 })));
    assert!(state(&mut rig).trip.unwrap().unreachable);
    let clear = Request::Clear(requests::Clear { target: ClearTarget::Axis(0) });
    assert_eq!(rig.ask(clear), Err(Error::StopNotConfirmed { axis: 0 }));
    rig.ask(Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 })).unwrap();
}

#[test]
fn a_fault_bit_trips_and_clearing_waits_for_it_to_go() {
    let (mut rig, play) = bench::rmd(StopAction::Coast);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().fault = true;
    let since = rig.now_us;
    bench_refresh(&mut rig, 150_000);
    let reason = TripReason::MotorFault { faults: 2 };
    assert_tripped(&mut rig, reason, true);
    assert!(rig.sent_since(0, since).contains(&COAST));
    let clear = Request::Clear(requests::Clear { target: ClearTarget::Axis(0) });
    assert_eq!(rig.ask(clear.clone()), Err(Error::CauseRemains { axis: 0, reason }));
    play.borrow_mut().fault = false;
    rig.ask(clear).unwrap();
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
fn motion_that_nobody_acknowledges_trips() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    rig.acknowledge = false;
    let request = setpoint(&rig, epoch, 80_000, VELOCITY);
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 50_000);
    assert_tripped(&mut rig, TripReason::NotAcknowledged, false);
}

#[test]
fn bus_off_trips_and_the_stop_follows_when_the_bus_is_back() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    let off = Event::BusState { bus: 0, state: BusState::BusOff, transmit_errors: 256, receive_errors: 0 };
    rig.handle(off);
    let since = rig.now_us;
    run_with_host(&mut rig, 100_000);
    assert_eq!(rig.sent_since(0, since + 1), Vec::<&str>::new());
    assert_tripped(&mut rig, TripReason::BusOff, false);
    let on = Event::BusState { bus: 0, state: BusState::Active, transmit_errors: 0, receive_errors: 0 };
    let since = rig.now_us;
    rig.handle(on);
    run_with_host(&mut rig, 50_000);
    assert_eq!(rig.sent_since(0, since).first(), Some(&HOLD));
    assert_tripped(&mut rig, TripReason::BusOff, true);
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
    rig.ask(Request::Stop(requests::Stop { target: StopTarget::Axis(0) })).unwrap();
    run_with_host(&mut rig, 300_000);
    assert_eq!(state(&mut rig).state, AxisState::Stopping);
    play.borrow_mut().turning = false;
    let since = rig.now_us;
    run_with_host(&mut rig, 60_000);
    assert_eq!(state(&mut rig).state, AxisState::Idle);
    let readings = rig.sent_since(0, since).iter().filter(|text| text.starts_with("141#9C")).count();
    assert!(readings >= 2);
    let confirmed = |said: &Said| matches!(said, Said::Event(HostEvent::StopConfirmed { axis: 0, .. }));
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
    rig.ask(Request::EStop(requests::EStop {})).unwrap();
    run_with_host(&mut rig, 100_000);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert_tripped(&mut rig, TripReason::EStop, true);
    let clear_axis = Request::Clear(requests::Clear { target: ClearTarget::Axis(0) });
    let remains = Error::CauseRemains { axis: 0, reason: TripReason::EStop };
    assert_eq!(rig.ask(clear_axis.clone()), Err(remains));
    rig.ask(Request::Clear(requests::Clear { target: ClearTarget::Gateway })).unwrap();
    rig.ask(clear_axis).unwrap();
    arm(&mut rig);
}

#[test]
fn the_brake_stop_holds_locks_verifies_and_switches_off() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    let motor = std::mem::replace(&mut rig.motor, Box::new(|_, _, _| None));
    let mut motor = motor;
    let mut locked = false;
    rig.motor = Box::new(move |now, bus, text| {
        locked |= text.starts_with("141#78");
        match text.get(..6) {
            Some("141#9A") if locked => Some("241#9A320000E5010000".into()),
            _ => motor(now, bus, text),
        }
    });
    move_axis(&mut rig, VELOCITY);
    let since = rig.now_us;
    rig.ask(Request::Stop(requests::Stop { target: StopTarget::All })).unwrap();
    run_with_host(&mut rig, 200_000);
    assert_eq!(state(&mut rig).state, AxisState::Idle);
    let sent = rig.sent_since(0, since);
    let position = |wanted: &str| sent.iter().position(|text| text.starts_with(wanted)).expect(wanted);
    let order = ["141#81", "141#9C", "141#78", "141#9A", "141#80"].map(position);
    assert!(order.is_sorted(), "{sent:?}");
}

#[test]
fn a_d5_that_answers_reads_only_confirms_by_reading_back() {
    let (mut rig, _) = bench::d5();
    bench::parameter(&mut rig, 0, AxisParameter::D5AckLevel, Value::Unsigned(1));
    let mut motor = std::mem::replace(&mut rig.motor, Box::new(|_, _, _| None));
    rig.motor = Box::new(move |now, bus, text| match text.get(10..12)? {
        "03" => None,
        "02" if text.get(12..14) == Some("10") => Some("00B#5D0B040210010022".into()),
        _ => motor(now, bus, text),
    });
    move_axis(&mut rig, Setpoint::Velocity { velocity_rad_s: 10.471_976 });
    rig.run(1_000);
    let since = rig.now_us;
    rig.ask(Request::Stop(requests::Stop { target: StopTarget::Axis(0) })).unwrap();
    run_with_host(&mut rig, 100_000);
    assert_eq!(state(&mut rig).state, AxisState::Idle);
    let sent = rig.sent_since(1, since);
    assert_eq!(sent.first(), Some(&"00B#D50B050320000033"));
    assert_eq!(sent.get(1), Some(&"00B#D50B050220000032"));
}

#[test]
fn a_late_reply_to_motion_is_not_taken_for_the_stops() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    rig.run(20_500); // a refresh is under way, unanswered
    let since = rig.now_us;
    rig.ask(Request::Stop(requests::Stop { target: StopTarget::Axis(0) })).unwrap();
    rig.receive(0, "241#A2326400F4012D00");
    rig.run(300);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert!(!state(&mut rig).stop_acknowledged);
}
