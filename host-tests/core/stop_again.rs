//! What happens to a stop under way, or confirmed, when something else happens: nothing makes the
//! gateway forget it.

use crate::bench::{
    self, HOLD, VELOCITY, arm, assert_tripped, clear, e_stop, listed, move_axis, outcomes,
    run_with_host, setpoint, state, stop,
};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, ClearTarget, Error, Event as HostEvent, MAX_FRAME, Protocol, Request,
    Setpoint, StopAction, StopTarget, TripReason, Value, requests,
};
use std::cell::Cell;
use std::rc::Rc;

fn send_clear(rig: &mut Rig) -> u16 {
    rig.send(&Request::Clear(requests::Clear { target: ClearTarget::Axis(0) }))
}

fn send_stop(rig: &mut Rig) {
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
}

/// An RMD that holds and has tripped, its stop confirmed.
fn tripped() -> (Rig, crate::motors::Shared) {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    run_with_host(&mut rig, 300_000);
    assert_tripped(&mut rig, TripReason::SetpointExpired, true);
    (rig, play)
}

#[test]
fn a_clearing_ends_when_the_motor_turns_again() {
    let (mut rig, play) = tripped();
    let has_turned = Rc::new(Cell::new(false));
    let turned = has_turned.clone();
    // The last question of the clearing is answered once the watch over the held motor has seen it
    // turn.
    rig.instead(move |text| match &text[..6] {
        "141#92" if !turned.get() => Instead::Nothing,
        "141#9C" if play.borrow().turning => {
            turned.set(true);
            Instead::AsUsual
        }
        "141#9C" => {
            play.borrow_mut().turning = true;
            Instead::Says("241#9C32640000002D00")
        }
        _ => Instead::AsUsual,
    });
    let clearing = send_clear(&mut rig);
    run_with_host(&mut rig, 200_000);
    assert!(has_turned.get());
    assert_eq!(rig.answer(clearing), Some(Err(Error::StopNotConfirmed { axis: 0 })));
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

/// The motor was silent for longer than its own timeout may last; then it answers a poll, while a
/// stop that was asked for waits for its answer.
#[test]
fn a_stop_that_begins_anew_waits_for_no_answer() {
    let (mut rig, play) = tripped();
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 110_000);
    let since = rig.now_us;
    while !rig.sent_since(0, since).iter().any(|text| text.starts_with("141#9C")) {
        rig.run(10);
    }
    rig.run(200);
    send_stop(&mut rig);
    rig.run(200);
    assert_eq!(rig.wire.last().unwrap().2, HOLD);
    let since = rig.now_us;
    rig.receive(0, "241#9C32640000006801");
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
    rig.run(1_000);
    assert_eq!(rig.sent_since(0, since), [HOLD]);
}

#[test]
fn an_e_stop_while_clearing_is_sent_and_ends_the_clearing() {
    let (mut rig, _) = tripped();
    let clearing = send_clear(&mut rig);
    rig.run(50);
    let since = rig.now_us;
    e_stop(&mut rig);
    run_with_host(&mut rig, 100_000);
    let stopped = Error::Aborted { axis: 0, state: AxisState::Tripped { confirmed: true } };
    assert_eq!(rig.answer(clearing), Some(Err(stopped)));
    assert_eq!(rig.sent_since(0, since).first(), Some(&HOLD));
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
}

#[test]
fn an_axis_that_becomes_unreachable_while_it_is_cleared_stays_tripped() {
    let (mut rig, play) = tripped();
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 4_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    while !outcomes(&rig).contains(&HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true })
    {
        let clearing = send_clear(&mut rig);
        run_with_host(&mut rig, 100_000);
        assert!(matches!(rig.answer(clearing), Some(Err(_))));
    }
    let since = rig.now_us;
    run_with_host(&mut rig, 2_000_000);
    assert!(
        rig.sent_since(0, since).iter().all(|text| *text == HOLD),
        "{:?}",
        rig.sent_since(0, since)
    );
    assert_eq!(clear(&mut rig), Err(Error::StopNotConfirmed { axis: 0 }));
}

#[test]
fn a_stop_that_went_down_with_its_bus_does_not_count_as_sent() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(1_000);
    send_stop(&mut rig);
    assert_eq!(rig.wire.last().unwrap().2, HOLD); // in the controller
    rig.bus_off(0);
    run_with_host(&mut rig, 99_000);
    let since = rig.now_us;
    run_with_host(&mut rig, 100_000);
    assert_tripped(&mut rig, TripReason::BusOff, true);
    let sent = rig.sent_since(0, since);
    assert_eq!(sent[..2], [HOLD, HOLD]);
}

#[test]
fn an_e_stop_while_stopping_is_sent_at_once() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    stop(&mut rig);
    for phase_us in (0..5_000).step_by(90) {
        run_with_host(&mut rig, 20_000 + phase_us);
        let since = rig.now_us;
        e_stop(&mut rig);
        rig.run(300);
        let at = rig
            .wire
            .iter()
            .find(|(at, _, text)| *at >= since && text == HOLD)
            .map(|(at, ..)| at - since);
        // At most one frame of ours is on the wire already.
        assert!(at.is_some_and(|at| at <= 130), "phase {phase_us}: {at:?}");
    }
    assert_tripped(&mut rig, TripReason::EStop, false);
}

#[test]
fn a_host_that_asks_for_stops_without_a_pause_does_not_keep_them_from_being_confirmed() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    for _ in 0..200 {
        send_stop(&mut rig);
        rig.run(1_000);
    }
    assert!(outcomes(&rig).iter().any(|event| matches!(event, HostEvent::StopConfirmed { .. })));
}

#[test]
fn the_late_reply_to_a_setpoint_of_0_that_was_given_up_does_not_acknowledge_the_stop() {
    let (mut rig, _) = bench::thruster_that_owes_the_reply_to_a_setpoint_of_0();
    let since = rig.now_us;
    // The window of the setpoint has closed, and a poll is under way.
    while rig.sent_since(0, since).is_empty() {
        rig.run(50);
    }
    rig.run(200);
    let since = rig.now_us;
    stop(&mut rig);
    rig.run(400);
    assert_eq!(rig.sent_since(0, since).first(), Some(&"30B#5443000000000000"));
    rig.receive(0, "28B#5443000000000000");
    rig.run(400);
    assert!(!state(&mut rig).stop_acknowledged);
}

#[test]
fn a_setpoint_that_has_expired_is_not_handed_out_even_before_the_core_is_told_the_time() {
    const REFRESH_US: u64 = 20_000;
    for (ttl_us, goes_out) in [(REFRESH_US + 1_000, true), (REFRESH_US - 1_000, false)] {
        let (mut rig, _) = bench::rmd(StopAction::Coast);
        bench::parameter(&mut rig, 0, AxisParameter::StatePollUs, Value::Unsigned(1_000_000));
        bench::parameter(&mut rig, 0, AxisParameter::FaultPollUs, Value::Unsigned(1_000_000));
        let epoch = arm(&mut rig);
        let request = setpoint(&rig, epoch, ttl_us, VELOCITY);
        rig.send(&request);
        assert!(
            rig.wire
                .last()
                .is_some_and(|(at, _, text)| *at == rig.now_us && text.starts_with("141#A2"))
        );
        let due = rig.now() + gateway::Duration::from_micros(REFRESH_US);
        rig.run(2_000);
        let refreshed = rig.gateway.poll_transmit(due, 0);
        assert_eq!(refreshed.is_some(), goes_out, "{refreshed:?}");
    }
}

/// Nor is a native motion, which is a job of its axis.
#[test]
fn a_native_motion_that_has_expired_is_not_handed_out() {
    for (late_us, goes_out) in [(0, true), (81_000, false)] {
        let (mut rig, _) = bench::rmd(StopAction::Coast);
        bench::parameter(&mut rig, 0, AxisParameter::StatePollUs, Value::Unsigned(1_000_000));
        bench::parameter(&mut rig, 0, AxisParameter::FaultPollUs, Value::Unsigned(1_000_000));
        let epoch = arm(&mut rig);
        let mut frame = [0; MAX_FRAME];
        let request = bench::native(&rig, epoch, "A200000010270000");
        let length = request.encode_frame(0x7000, &mut frame).unwrap();
        rig.take_in(gateway::Event::HostBytes { link: 0, bytes: &frame[..length] });
        let later = rig.now() + gateway::Duration::from_micros(late_us);
        let handed = rig.gateway.poll_transmit(later, 0);
        assert_eq!(handed.is_some(), goes_out, "{handed:?}");
    }
}

#[test]
fn what_a_poll_has_seen_of_the_time_no_earlier_event_takes_back() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    move_axis(&mut rig, VELOCITY);
    let later = rig.now() + gateway::Duration::from_micros(200_000);
    let _ = rig.gateway.poll_transmit(later, 0);
    // The setpoint has expired then.
    let _ = rig.gateway.handle(rig.now(), gateway::Event::Tick, &mut |_, _| {});
    assert_eq!(rig.gateway.tripped(), gateway::Set::of(0u8));
    run_with_host(&mut rig, 300_000);
    assert_tripped(&mut rig, TripReason::SetpointExpired, true);
}

/// Makes a rig with a motor.
type Make = fn() -> (Rig, crate::motors::Shared);
/// Axes whose next frame waits for the reply to the one before, with their bus and their stop.
type Waits = (Make, u8, &'static str);
const THAT_WAIT: [Waits; 2] = [
    (bench::d5, 1, "00B#D50B050320000033"),
    (|| bench::rmd_serial(StopAction::Hold), 2, "3E01088100"),
];

/// An e-stop, and another one some time after it. The motor is mute from the first on, or answers.
fn assert_two_e_stops_send_two_stops((make, bus, text): Waits, after_us: u64, mute: bool) {
    let (mut rig, play) = make();
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = mute;
    e_stop(&mut rig);
    rig.run(after_us);
    let since = rig.now_us + 1;
    e_stop(&mut rig);
    let at_once =
        rig.wire.last().is_some_and(|(at, _, last)| at + 1 == since && last.starts_with(text));
    rig.run(11_000);
    let sent = rig.sent_since(bus, since);
    let is_sent = at_once || sent.iter().any(|sent| sent.starts_with(text));
    assert!(is_sent, "bus {bus}, after {after_us} µs: {sent:?}");
}

#[test]
fn a_stop_asked_for_while_another_is_confirmed_is_sent() {
    for case in THAT_WAIT {
        for after_us in (0..60_000).step_by(250) {
            assert_two_e_stops_send_two_stops(case, after_us, false);
        }
    }
}

#[test]
fn a_stop_asked_for_in_the_reply_window_of_another_is_sent() {
    for case in THAT_WAIT {
        for after_us in (1_000_000..2_200_000).step_by(1_900) {
            assert_two_e_stops_send_two_stops(case, after_us, true);
        }
    }
}

#[test]
fn the_stop_of_a_tripped_axis_is_repeated_in_time_while_its_clearing_waits_for_the_bus() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    bench::configure_axis(&mut rig, 1, 0, Protocol::Rmd, 3, StopAction::Coast);
    move_axis(&mut rig, VELOCITY);
    run_with_host(&mut rig, 300_000);
    assert_tripped(&mut rig, TripReason::SetpointExpired, true);
    // Between the ids of the two: the first stop of the second axis cannot leave.
    rig.babble(Some(0x142));
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(1) }));
    rig.run(100_000);
    send_clear(&mut rig);
    rig.run(2_000_000);
    assert!(rig.longest_gap_us(0, 0, "141#80") <= 502_000);
}

#[test]
fn a_stop_whose_replies_may_be_late_ones_leaves_the_line_to_others() {
    for (mut rig, _) in [bench::rmd(StopAction::Hold), bench::rmd_serial(StopAction::Hold)] {
        let are_lost = Rc::new(Cell::new(true));
        let lost = are_lost.clone();
        rig.instead(move |_| if lost.get() { Instead::Nothing } else { Instead::AsUsual });
        let arming = rig.ask(Request::Arm(requests::Arm { axis: 0 }));
        assert!(matches!(arming, Err(Error::NoReply { axis: 0, .. })), "{arming:?}");
        are_lost.set(false);
        let since = rig.now_us;
        e_stop(&mut rig);
        run_with_host(&mut rig, 100_000);
        let bus = rig.wire.last().unwrap().1;
        let sent = rig.sent_since(bus, since);
        // Two at once, then one every 5 ms.
        assert!((18..=23).contains(&sent.len()), "{}: {sent:?}", sent.len());
        let is_confirmed = |event: &HostEvent| matches!(event, HostEvent::StopConfirmed { .. });
        assert!(!outcomes(&rig).iter().any(is_confirmed));
        run_with_host(&mut rig, 300_000);
        assert!(outcomes(&rig).iter().any(is_confirmed));
    }
}

#[test]
fn a_stop_that_is_asked_for_again_and_goes_down_with_its_bus_is_owed() {
    for after in [0, 20, 50, 80] {
        let (mut rig, _) = tripped();
        send_stop(&mut rig);
        rig.run(after);
        assert!(rig.left.iter().all(|(at, ..)| *at + after < rig.now_us));
        let since = rig.now_us;
        rig.bus_off(0);
        run_with_host(&mut rig, 300_000);
        let is_stop = |(at, _, text): &&(u64, u8, String)| *at >= since && text.contains("#8");
        assert!(rig.left.iter().any(|left| is_stop(&left)), "{after} µs");
    }
}

/// However shortly before the first one is confirmed.
#[test]
fn a_stop_that_is_asked_for_again_while_one_is_under_way_is_sent() {
    let mut again = 0;
    for stop in [StopAction::Hold, StopAction::Coast] {
        for gap in (100..20_000).step_by(100) {
            let (mut rig, _) = bench::rmd(stop);
            move_axis(&mut rig, VELOCITY);
            rig.run(5_000);
            send_stop(&mut rig);
            rig.run(gap);
            if bench::listed(&mut rig, 0) != AxisState::Stopping {
                break;
            }
            let since = rig.now_us;
            send_stop(&mut rig);
            rig.run(100_000);
            let sent = rig.sent_since(0, since);
            assert!(sent.iter().any(|text| text.contains("#8")), "{stop:?} {gap} µs: {sent:?}");
            assert!(matches!(bench::listed(&mut rig, 0), AxisState::Idle | AxisState::Holding));
            again += 1;
        }
    }
    assert!(again > 20, "{again}");
}

/// A host that asks without a pause puts no end off for ever.
#[test]
fn a_stop_that_is_asked_for_all_the_time_comes_to_its_end() {
    let signal = Setpoint::Signal { fraction: 0.1 };
    let cases: [(Make, Setpoint); 6] = [
        (|| bench::rmd(StopAction::Hold), VELOCITY),
        (|| bench::rmd(StopAction::Coast), VELOCITY),
        (|| bench::rmd(StopAction::Brake), VELOCITY),
        (|| bench::rmd_serial(StopAction::Hold), VELOCITY),
        (bench::thruster, signal),
        (bench::d5, VELOCITY),
    ];
    for (case, (make, setpoint)) in cases.into_iter().enumerate() {
        for every in [110, 300, 700, 1_500, 4_000, 9_900] {
            let (mut rig, _) = make();
            move_axis(&mut rig, setpoint);
            for _ in 0..200_000 / every {
                send_stop(&mut rig);
                rig.run(every);
            }
            let is_confirmed = |event: &HostEvent| matches!(event, HostEvent::StopConfirmed { .. });
            let events = outcomes(&rig);
            assert!(events.iter().any(is_confirmed), "case {case}, every {every} µs: {events:?}");
        }
    }
}
