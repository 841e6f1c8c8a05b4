//! Subscriptions: the state of chosen axes, told at a period.

use crate::bench::{self, run_with_host};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Event, Protocol, Quantity, Request, StateField, StateFields,
    StopAction, TripReason, Value, requests,
};

const FIELDS: StateFields = StateFields::of(&[StateField::Position, StateField::Faults]);

fn subscribe(rig: &mut Rig, axes: u32, period_us: u32) -> Result<(), Error> {
    rig.ask(Request::Subscribe(requests::Subscribe { axes, fields: FIELDS, period_us })).map(drop)
}

/// The samples told since there were so many events.
fn samples(rig: &Rig, since: usize) -> Vec<Event> {
    let events = rig.events().into_iter().skip(since);
    events.filter(|event| matches!(event, Event::Sample { .. })).copied().collect()
}

#[test]
fn an_idle_axis_is_read_and_told_of_at_the_period() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    let since = rig.now_us;
    run_with_host(&mut rig, 200_000);
    assert_eq!(rig.sent_since(0, since).len(), 0); // nobody wants to know
    subscribe(&mut rig, 1, 20_000).unwrap();
    run_with_host(&mut rig, 300_000);
    let (since, events) = (rig.now_us, rig.events().len());
    run_with_host(&mut rig, 200_000);
    let told = samples(&rig, events);
    assert_eq!(told.len(), 10);
    let Event::Sample { axis, state, position_rad, velocity_rad_s, faults, .. } = told[9] else {
        panic!("no sample");
    };
    // It has not subscribed to the velocity.
    assert_eq!((axis, state, velocity_rad_s), (0, AxisState::Idle, None));
    assert_eq!(position_rad.map(|reading| reading.value), Some(core::f32::consts::TAU));
    assert_eq!(faults.map(|reading| reading.word), Some(0));
    // In each state_poll_us of 50 ms the position, and one of the others in turn.
    let sent = rig.sent_since(0, since);
    let count = |of: &str| sent.iter().filter(|text| text.starts_with(of)).count();
    assert!((8..=9).contains(&sent.len()), "{sent:?}");
    assert!((4..=5).contains(&count("141#92")), "{sent:?}");
    assert_eq!((count("141#9C"), count("141#9A")), (2, 2));
}

#[test]
fn an_armed_axis_is_told_of_without_further_requests() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    bench::arm(&mut rig);
    let since = rig.now_us;
    run_with_host(&mut rig, 500_000);
    let alone = rig.sent_since(0, since).len();
    subscribe(&mut rig, 1, 5_000).unwrap();
    let (since, events) = (rig.now_us, rig.events().len());
    run_with_host(&mut rig, 500_000);
    let watched = rig.sent_since(0, since).len();
    assert!(watched.abs_diff(alone) <= 2, "{alone} frames alone, {watched} watched");
    assert!((99..=101).contains(&samples(&rig, events).len()));
}

#[test]
fn a_period_out_of_range_is_refused_and_the_subscription_stays() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    subscribe(&mut rig, 1, 20_000).unwrap();
    assert_eq!(
        subscribe(&mut rig, 1, 999),
        Err(Error::OutOfRange {
            quantity: Quantity::Period,
            value: 999.0,
            min: 1_000.0,
            max: 10_000_000.0
        })
    );
    let events = rig.events().len();
    run_with_host(&mut rig, 100_000);
    assert_eq!(samples(&rig, events).len(), 5);
}

#[test]
fn watching_keeps_out_of_the_way_of_raw_access() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    subscribe(&mut rig, 1, 20_000).unwrap();
    rig.ask(Request::RawOpen(requests::RawOpen { bus: 0, unsafe_access: false })).unwrap();
    rig.run(10_000);
    let since = rig.now_us;
    run_with_host(&mut rig, 300_000);
    assert_eq!(rig.sent_since(0, since).len(), 0);
    rig.ask(Request::RawClose(requests::RawClose { bus: 0 })).unwrap();
    run_with_host(&mut rig, 300_000);
    assert!(rig.sent_since(0, since).len() >= 5);
}

#[test]
fn a_held_motor_is_still_watched_for_turning() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    bench::arm(&mut rig);
    bench::disarm(&mut rig);
    run_with_host(&mut rig, 100_000);
    subscribe(&mut rig, 1, 20_000).unwrap();
    run_with_host(&mut rig, 200_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Holding);
    play.borrow_mut().turning = true;
    run_with_host(&mut rig, 50_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Stopping);
}

#[test]
fn a_watched_motor_that_something_else_turns_is_left_alone_so_that_its_own_timeout_can_act() {
    let longest_pause_ms = |timeout_ms: Option<u32>| {
        let (mut rig, play) = bench::rmd(StopAction::Coast);
        if let Some(timeout_ms) = timeout_ms {
            bench::provision(&mut rig, timeout_ms).unwrap();
        }
        subscribe(&mut rig, 1, 20_000).unwrap();
        run_with_host(&mut rig, 300_000);
        let since = rig.now_us;
        play.borrow_mut().turning = true;
        run_with_host(&mut rig, 12_000_000);
        rig.longest_gap_us(0, since, "141#") / 1_000
    };
    assert_eq!(longest_pause_ms(Some(400)), 600);
    assert_eq!(longest_pause_ms(None), 5_000);
}

#[test]
fn a_host_that_has_not_said_hello_is_told_nothing() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    let request =
        Request::Subscribe(requests::Subscribe { axes: 1, fields: FIELDS, period_us: 1_000 });
    rig.ask_as(1, &request).unwrap();
    run_with_host(&mut rig, 20_000);
    let mut out = [0; host_protocol::MAX_FRAME];
    assert_eq!(rig.gateway.poll_host(1, &mut out, &mut |_, _| {}), None);
}

#[test]
fn an_armed_axis_is_read_for_what_a_limit_or_a_watcher_asks_for() {
    let (mut rig, _) = bench::thruster();
    let fields = StateFields::of(&[StateField::Voltage, StateField::MotorTemperature]);
    let request = requests::Subscribe { axes: 1, fields, period_us: 50_000 };
    rig.ask(Request::Subscribe(request)).unwrap();
    bench::arm(&mut rig);
    run_with_host(&mut rig, 3_000_000);
    let events = rig.events();
    let Some(Event::Sample {
        voltage_v: Some(voltage),
        motor_temperature_c: Some(temperature),
        ..
    }) = events.iter().rev().find(|event| matches!(event, Event::Sample { .. }))
    else {
        panic!("no sample");
    };
    assert!(
        voltage.age_us < 1_000_000 && temperature.age_us < 1_000_000,
        "{voltage:?} {temperature:?}"
    );

    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::TemperatureLimitC, Value::Float(60.0));
    let hot = |text: &str| text.contains("#5154");
    rig.instead(
        move |text| {
            if hot(text) { Instead::Says("28B#515400000000005A") } else { Instead::AsUsual }
        },
    );
    bench::arm(&mut rig);
    run_with_host(&mut rig, 1_000_000);
    let reason = bench::state(&mut rig).trip.map(|trip| trip.reason);
    assert!(
        matches!(reason, Some(TripReason::LimitExceeded { quantity: Quantity::Temperature, .. })),
        "{reason:?}"
    );
}

#[test]
fn an_axis_that_is_removed_and_configured_anew_is_still_watched() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    subscribe(&mut rig, 1, 50_000).unwrap();
    run_with_host(&mut rig, 100_000);
    rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 0 })).unwrap();
    bench::configure_axis(&mut rig, 0, 0, Protocol::Rmd, 1, StopAction::Coast);
    run_with_host(&mut rig, 100_000);
    let since = rig.now_us;
    run_with_host(&mut rig, 500_000);
    assert!(rig.sent_since(0, since).len() >= 8);
}
