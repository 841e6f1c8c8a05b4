//! Motors that no stop reaches. One that answers and turns on is left alone but for two stops
//! between silences, so that its own timeout can act, and nobody can break the silence; one that
//! does not answer is sent its stop every 500 ms, and whenever it is asked for (GUARANTEES G4).

use crate::bench::{
    self, D5_VELOCITY, HOLD, VELOCITY, assert_tripped, listed, move_axis, outcomes, run_with_host,
    state, stop,
};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Event as HostEvent, Incident, Protocol, ProtocolSet, Reply,
    Request, Setpoint, StopAction, StopTarget, TripReason, Value, requests,
};

const TIMEOUT_MS: u32 = 400;
/// 1.5 × the motor's own timeout.
const SILENCE_US: u64 = 600_000;

/// Times between frames on bus 0 that are longer than a reply window, µs.
fn silences(rig: &Rig, bus: u8, since_us: u64) -> Vec<u64> {
    let times: Vec<u64> = rig
        .wire
        .iter()
        .filter(|(at, on, _)| *at >= since_us && *on == bus)
        .map(|(at, ..)| *at)
        .collect();
    times.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 30_000).collect()
}

#[test]
fn a_motor_that_acknowledges_stops_and_turns_on_is_unreachable_after_5_s_and_then_left_alone() {
    let (mut rig, play) = bench::rmd_with_timeout(TIMEOUT_MS);
    move_axis(&mut rig, VELOCITY);
    rig.run(1_000);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    run_with_host(&mut rig, 4_900_000);
    assert_eq!((listed(&mut rig, 0), outcomes(&rig)), (AxisState::Stopping, vec![]));
    run_with_host(&mut rig, 200_000);
    assert_tripped(&mut rig, TripReason::StopUnconfirmed, false);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }]);
    let since = rig.now_us;
    run_with_host(&mut rig, 10_000_000);
    // It answers, so that each time it is given another chance to be seen at rest; it is reported
    // once.
    let silences = silences(&rig, 0, since);
    assert!(
        silences.len() >= 3 && silences.iter().all(|gap| gap.abs_diff(SILENCE_US) < 10_000),
        "{silences:?}"
    );
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }]);
    assert!(state(&mut rig).trip.unwrap().unreachable);
    play.borrow_mut().turning = false;
    run_with_host(&mut rig, 1_000_000);
    assert_tripped(&mut rig, TripReason::StopUnconfirmed, true);
    assert!(!state(&mut rig).trip.unwrap().unreachable);
}

/// A stop that lets the motor coast is confirmed as soon as it is acknowledged (GUARANTEES G4).
#[test]
fn a_motor_that_acknowledges_that_it_coasts_and_turns_on_is_left_to_its_own_timeout() {
    const LONG_MS: u32 = 1_000;
    const LONG_SILENCE_US: u64 = 1_500_000;
    const QUESTION: &str = "9C00000000000000";
    for asks in [false, true] {
        let (mut rig, play) = bench::rmd(StopAction::Coast);
        bench::provision(&mut rig, LONG_MS).unwrap();
        move_axis(&mut rig, VELOCITY);
        rig.run(1_000);
        play.borrow_mut().turning = true;
        bench::e_stop(&mut rig);
        run_with_host(&mut rig, 4_900_000);
        assert_tripped(&mut rig, TripReason::EStop, true);
        assert!(silences(&rig, 0, 0).iter().all(|gap| *gap < 510_000), "repeated until then");
        run_with_host(&mut rig, 700_000);
        let since = rig.now_us;
        for _ in 0..100 {
            run_with_host(&mut rig, 100_000);
            if asks {
                state(&mut rig);
                let native = bench::native(&rig, 0, QUESTION);
                rig.send(&native);
                rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
            }
        }
        let silences = silences(&rig, 0, since);
        let long = silences.iter().filter(|gap| **gap + 10_000 >= LONG_SILENCE_US).count();
        assert!(long >= if asks { 3 } else { 6 }, "asks: {asks}: {silences:?}");
        // Who asks for a stop has one sent in each silence.
        assert!(silences.len() <= 2 * long + 2, "asks: {asks}: {silences:?}");
        assert_tripped(&mut rig, TripReason::EStop, true);
        play.borrow_mut().turning = false;
        run_with_host(&mut rig, 2_000_000);
        let since = rig.now_us;
        run_with_host(&mut rig, 2_000_000);
        assert!(self::silences(&rig, 0, since).iter().all(|gap| *gap < 510_000), "at rest");
    }
}

/// The motor's own timeout has had its time to act: nothing bars the next stop that is asked for.
#[test]
fn a_stop_that_is_asked_for_after_a_silence_or_of_a_motor_at_rest_is_sent_at_once() {
    const COAST: &str = "141#8000000000000000";
    for (timeout_ms, stands, pause_us) in [(100, false, 250_000), (10_000, true, 300_000)] {
        let (mut rig, play) = bench::rmd(StopAction::Coast);
        bench::provision(&mut rig, timeout_ms).unwrap();
        move_axis(&mut rig, VELOCITY);
        rig.run(1_000);
        play.borrow_mut().turning = true;
        bench::e_stop(&mut rig);
        run_with_host(&mut rig, 5_200_000);
        let ask = |rig: &mut Rig| {
            let since = rig.now_us;
            rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
            run_with_host(rig, 10_000);
            rig.sent_since(0, since).contains(&COAST)
        };
        if stands {
            play.borrow_mut().turning = false;
        }
        ask(&mut rig);
        for _ in 0..3 {
            let in_the_silence = [ask(&mut rig), ask(&mut rig)];
            assert!(stands || !in_the_silence[1], "{timeout_ms} ms: one in each silence");
            run_with_host(&mut rig, pause_us);
            assert!(ask(&mut rig), "{timeout_ms} ms: nothing bars it");
        }
    }
}

/// Its stop was acknowledged, so its axis is idle.
#[test]
fn nobody_who_reads_keeps_an_idle_motor_that_turns_from_stopping_by_its_own_timeout() {
    let (mut rig, play) = bench::rmd(StopAction::Coast);
    bench::provision(&mut rig, TIMEOUT_MS).unwrap();
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    run_with_host(&mut rig, 10_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
    let since = rig.now_us;
    for turn in 0..60 {
        run_with_host(&mut rig, 50_000);
        if turn % 2 == 0 {
            assert!(state(&mut rig).velocity_rad_s.is_some(), "what is known is told");
        } else {
            let asked = bench::native(&rig, 0, "9C00000000000000");
            let velocity = state(&mut rig).velocity_rad_s.unwrap();
            let told = Err(Error::NotStandstill { axis: 0, velocity_rad_s: velocity.value });
            let answer = rig.ask(asked);
            assert!(velocity.age_us < 60_000 || answer == told, "{answer:?} {velocity:?}");
        }
    }
    let silences = silences(&rig, 0, since);
    let long = silences.iter().filter(|gap| **gap + 10_000 >= SILENCE_US).count();
    assert!(long >= 4, "{silences:?}");
}

/// What its own timeout counts from is the last request that it has heard, answered or not.
#[test]
fn a_question_of_many_reads_ends_before_the_pause_of_an_idle_motor_that_turns_begins() {
    const SHORT_MS: u32 = 100;
    const PAUSE_US: u64 = 150_000;
    const WINDOW_US: u64 = 20_000;
    let (mut rig, play) = bench::rmd(StopAction::Coast);
    let slow = requests::ConfigureBus {
        bus: 0,
        bitrate: 1_000_000,
        protocols: ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]),
        exclusive: false,
        reply_window_us: 20_000,
    };
    rig.ask(Request::ConfigureBus(slow)).unwrap();
    bench::provision(&mut rig, SHORT_MS).unwrap();
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    run_with_host(&mut rig, 10_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
    rig.instead(
        |text| {
            if text.starts_with("141#9A") { Instead::Nothing } else { Instead::AsUsual }
        },
    );
    let since = rig.now_us;
    for _ in 0..100 {
        rig.send(&Request::ReadState(requests::ReadState { axis: 0 }));
        run_with_host(&mut rig, 10_000);
    }
    // But for the windows of what is not answered.
    let pauses = silences(&rig, 0, since).into_iter().filter(|gap| *gap > 3 * WINDOW_US);
    let pauses = pauses.collect::<Vec<_>>();
    assert!(pauses.len() >= 4 && pauses.iter().all(|gap| *gap >= PAUSE_US), "{pauses:?}");
}

/// A motor that hears every stop and refuses it.
#[test]
fn a_host_that_asks_for_stops_all_the_time_does_not_keep_the_motor_s_own_timeout_from_acting() {
    let (mut rig, _) = bench::thruster();
    bench::provision(&mut rig, TIMEOUT_MS).unwrap();
    move_axis(&mut rig, Setpoint::Signal { fraction: 0.1 });
    rig.run(5_000);
    rig.instead(|text| match &text[..8] {
        "30B#5443" => Instead::Says("28B#544300000000EEEE"),
        _ => Instead::AsUsual,
    });
    bench::assert_becomes_unreachable(&mut rig);
    let since = rig.now_us;
    for _ in 0..500 {
        rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
        rig.run(10_000);
    }
    let silences = silences(&rig, 0, since);
    assert!(
        silences.iter().filter(|gap| **gap >= SILENCE_US - 20_000).count() >= 5,
        "{silences:?}"
    );
}

/// A motor that is out of reach for a moment: ten stops are over in that time.
#[test]
fn a_motor_that_answers_nothing_for_60_ms_is_stopped_soon_after_that() {
    for timeout_ms in [TIMEOUT_MS, 10_000, 60_000] {
        let (mut rig, play) = bench::rmd_with_timeout(timeout_ms);
        move_axis(&mut rig, VELOCITY);
        rig.run(1_000);
        play.borrow_mut().mute = true;
        stop(&mut rig);
        run_with_host(&mut rig, 60_000);
        play.borrow_mut().mute = false;
        assert_eq!(
            outcomes(&rig),
            [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }],
            "{timeout_ms} ms"
        );
        run_with_host(&mut rig, 520_000);
        assert_tripped(&mut rig, TripReason::StopUnconfirmed, true);
    }
}

#[test]
fn every_stop_that_is_asked_for_of_a_motor_that_answers_nothing_is_sent() {
    let (mut rig, play) = bench::rmd_with_timeout(10_000);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    bench::assert_becomes_unreachable(&mut rig);
    for at in 0..30 {
        run_with_host(&mut rig, 70_000);
        let since = rig.now_us;
        let stop = Request::Stop(requests::Stop { target: StopTarget::Axis(0) });
        rig.send(&if at % 2 == 0 { stop } else { Request::EStop(requests::EStop {}) });
        rig.run(8_000);
        assert_eq!(rig.sent_since(0, since).first().map(|text| &**text), Some(HOLD), "stop {at}");
    }
}

#[test]
fn a_stop_that_a_host_asks_for_goes_to_an_unreachable_motor_at_once() {
    let (mut rig, play) = bench::rmd_with_timeout(TIMEOUT_MS);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 2_000_000);
    run_with_host(&mut rig, 100_000);
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(100);
    assert_eq!(rig.sent_since(0, since), [HOLD]);
}

#[test]
fn a_mute_d5_that_answers_reads_only_is_left_alone_too() {
    let mut rig = bench::d5_that_answers_reads_only();
    move_axis(&mut rig, D5_VELOCITY);
    rig.run(10_000);
    rig.instead(|_| Instead::Nothing);
    run_with_host(&mut rig, 3_000_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }]);
    let since = rig.now_us;
    run_with_host(&mut rig, 5_000_000);
    let silences = silences(&rig, 1, since);
    assert!(silences.len() >= 8 && silences.iter().all(|gap| *gap >= 480_000), "{silences:?}");
}

#[test]
fn a_position_device_that_refuses_its_second_stop_command_is_not_confirmed_and_asked_in_measured_steps()
 {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(true));
    move_axis(&mut rig, Setpoint::Signal { fraction: 0.1 });
    rig.run(5_000);
    rig.instead(|text| match &text[..8] {
        "30B#4C53" => Instead::Says("28B#4C5300000000EEEE"),
        _ => Instead::AsUsual,
    });
    let since = rig.now_us;
    stop(&mut rig);
    run_with_host(&mut rig, 1_000_000);
    assert_eq!(outcomes(&rig), []);
    let refused =
        rig.sent_since(0, since).iter().filter(|text| text.starts_with("30B#4C53")).count();
    assert!((10..=50).contains(&refused), "{refused} refusals in 1 s");
    run_with_host(&mut rig, 4_100_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }]);
    assert_eq!(bench::clear(&mut rig), Err(Error::StopNotConfirmed { axis: 0 }));
}

/// What was handed over and did not leave has fed no timeout: it begins no silence.
#[test]
fn stops_that_two_failures_of_the_bus_took_back_wait_for_it_again() {
    let (mut rig, play) = bench::rmd_with_timeout(TIMEOUT_MS);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    bench::assert_becomes_unreachable(&mut rig);
    rig.cut();
    run_with_host(&mut rig, SILENCE_US + 100_000);
    for _ in 0..2 {
        assert_eq!(rig.held_texts(), [HOLD]);
        rig.bus_off(0);
        run_with_host(&mut rig, 210_000);
    }
    assert_eq!(rig.held_texts(), [HOLD]);
}

/// Where a host gives the motor up in the same moment.
#[test]
fn a_motor_that_has_just_become_unreachable_is_in_the_history_although_it_is_cleared() {
    let (mut rig, play) = bench::rmd_with_timeout(TIMEOUT_MS);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    // Nothing but the request itself wakes the core when the motor's 5 s are over.
    run_with_host(&mut rig, 4_990_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Stopping);
    rig.now_us += 100_000;
    rig.ask(Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 })).unwrap();
    let Ok(Reply::ReadIncidents(page)) =
        rig.ask(Request::ReadIncidents(requests::ReadIncidents { first: 0 }))
    else {
        panic!()
    };
    assert!(
        matches!(page.incidents[0], Incident::Tripped { axis: 0, trip, .. }
            if trip.reason == TripReason::StopUnconfirmed && trip.unreachable),
        "{page:?}"
    );
}
