//! An RMD that holds must keep hearing something, or its own timeout (0xB3) cuts the output and a
//! hanging load drops.

use crate::bench::{self, COAST, HOLD, arm, disarm, listed, output_off, run_with_host};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, NoReplyHint, Protocol, ProtocolSet, Reply, Request,
    StopAction, Value, replies, requests,
};
use std::cell::Cell;
use std::rc::Rc;

/// The motor of axis 0 has heard something every 100 ms, up to now.
fn assert_fed_every_100_ms(rig: &Rig, since_us: u64) {
    let gap = rig.longest_gap_us(0, since_us, "141#");
    assert!(gap <= 100_000, "{gap} µs");
    assert!(rig.now_us - rig.wire.last().unwrap().0 <= 100_000);
}

/// The slowest state polls that can be configured.
fn with_slow_polls(rig: &mut Rig) {
    bench::parameter(rig, 0, AxisParameter::StatePollUs, Value::Unsigned(1_000_000));
    bench::parameter(rig, 0, AxisParameter::FaultPollUs, Value::Unsigned(1_000_000));
}

#[test]
fn a_disarmed_axis_is_polled_at_once_and_within_a_third_of_the_timeout() {
    let (mut rig, _) = bench::rmd_with_timeout(300);
    with_slow_polls(&mut rig);
    let since = rig.now_us;
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    assert_fed_every_100_ms(&rig, since);
}

#[test]
fn an_armed_axis_that_was_given_no_setpoint_is_polled_within_a_third_of_the_timeout() {
    let (mut rig, _) = bench::rmd_with_timeout(300);
    with_slow_polls(&mut rig);
    let since = rig.now_us;
    arm(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    assert_fed_every_100_ms(&rig, since);
}

#[test]
fn an_arming_that_fails_goes_on_holding() {
    let (mut rig, play) = bench::rmd_with_timeout(500);
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 500_000);
    play.borrow_mut().fault = true;
    let since = rig.now_us;
    assert_eq!(
        rig.ask(Request::Arm(requests::Arm { axis: 0 })),
        Err(Error::MotorFault { axis: 0, faults: 2 })
    );
    run_with_host(&mut rig, 2_000_000);
    let gap = rig.longest_gap_us(0, since, "141#");
    assert!(gap <= 500_000 / 3, "{gap} µs");
    assert!(rig.now_us - rig.wire.last().unwrap().0 <= 500_000 / 3);
}

/// Bus 0 awaits replies for so long.
fn with_window(rig: &mut Rig, reply_window_us: u32) -> Result<Reply, Error> {
    rig.ask(Request::ConfigureBus(requests::ConfigureBus {
        bus: 0,
        bitrate: 1_000_000,
        protocols: ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]),
        exclusive: false,
        reply_window_us,
    }))
}

/// The longest time between two requests that the motor hears, where one poll of those that keep
/// it holding is lost.
fn unheard_with_one_poll_lost(rig: &mut Rig) -> u64 {
    const LOST: u32 = 3;
    arm(rig);
    disarm(rig);
    run_with_host(rig, 500_000);
    let polls = Rc::new(Cell::new(0));
    let lost = polls.clone();
    rig.instead(move |text| {
        polls.set(polls.get() + u32::from(text.starts_with("141#")));
        if polls.get() == LOST { Instead::Nothing } else { Instead::AsUsual }
    });
    let since = rig.now_us;
    run_with_host(rig, 3_000_000);
    assert!(lost.get() > LOST);
    let sent = rig.wire.iter().filter(|(at, _, text)| *at >= since && text.starts_with("141#"));
    let mut heard = sent.map(|(at, ..)| *at).collect::<Vec<_>>();
    heard.remove(LOST as usize - 1);
    heard.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap()
}

/// One lost reply costs two of the bus's reply windows: a motor that would let go meanwhile is not
/// told such a timeout, nor are windows so long while one has it.
#[test]
fn one_lost_poll_lets_no_motor_go_however_long_its_bus_waits() {
    /// That of any RMD.
    const SHORTEST_MS: u32 = 20;
    for (window_us, least_ms) in [(5_000, SHORTEST_MS), (6_200, 22), (40_000, 132), (200_000, 652)]
    {
        let (mut rig, _) = bench::rmd_with_timeout(1_000);
        with_slow_polls(&mut rig);
        with_window(&mut rig, window_us).unwrap();
        let too_short = |motor_timeout_ms, least_ms| Error::MotorTimeoutTooShort {
            axis: 0,
            motor_timeout_ms,
            least_ms,
        };
        if least_ms > SHORTEST_MS {
            let refused = bench::provision(&mut rig, least_ms - 1);
            assert_eq!(refused, Err(too_short(least_ms - 1, least_ms)));
        }
        bench::provision(&mut rig, least_ms).unwrap();
        if window_us < 200_000 {
            let refused = with_window(&mut rig, 200_000);
            assert_eq!(refused, Err(too_short(least_ms, 652)));
        }
        let unheard_us = unheard_with_one_poll_lost(&mut rig);
        let acts_after_us = u64::from(least_ms) * 950;
        assert!(unheard_us < acts_after_us, "{window_us} µs, {least_ms} ms: {unheard_us} µs");
    }
}

/// An RMD that holds at node 1 on CAN bus 0.
fn held() -> Rig {
    let (mut rig, _) = bench::rmd_with_timeout(300);
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 300_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    rig
}

#[test]
fn a_stop_takes_the_place_of_letting_go() {
    let mut rig = held();
    rig.cut();
    let request = Request::OutputOff(requests::OutputOff { axis: 0 });
    let asked = rig.send(&request);
    rig.run(100);
    bench::stop(&mut rig);
    rig.run(100);
    let stopped = Error::Aborted { axis: 0, state: AxisState::Stopping };
    assert_eq!(rig.answer(asked), Some(Err(stopped)));
    assert_eq!(rig.held_texts(), [HOLD]);
    let since = rig.now_us;
    rig.mend();
    run_with_host(&mut rig, 100_000);
    assert!(!rig.sent_since(0, since).contains(&COAST));
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
}

/// It has heard 0x80, and its answers were lost.
#[test]
fn a_motor_that_may_have_let_go_is_told_to_hold() {
    let mut rig = held();
    rig.instead(|text| if text == COAST { Instead::Nothing } else { Instead::AsUsual });
    let since = rig.now_us;
    let no_reply = Error::NoReply { axis: 0, hint: NoReplyHint::None };
    assert_eq!(output_off(&mut rig).unwrap_err(), no_reply);
    assert_eq!(listed(&mut rig, 0), AxisState::Stopping);
    run_with_host(&mut rig, 300_000);
    let sent = rig.sent_since(0, since);
    let told: Vec<_> = sent.into_iter().filter(|text| [COAST, HOLD].contains(text)).collect();
    assert_eq!(told, [COAST, COAST, COAST, HOLD, HOLD]);
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
}

#[test]
fn the_same_address_again_is_the_same_motor_and_goes_on_being_held() {
    let mut rig = held();
    for (parameter, value) in
        [(AxisParameter::Bus, 0), (AxisParameter::Protocol, 1), (AxisParameter::Node, 1)]
    {
        bench::parameter(&mut rig, 0, parameter, Value::Unsigned(value));
        assert_eq!(listed(&mut rig, 0), AxisState::Holding, "{parameter:?}");
    }
    let brake = Value::Unsigned(u32::from(StopAction::Brake.number()));
    bench::parameter(&mut rig, 0, AxisParameter::StopAction, brake);
    assert_eq!(listed(&mut rig, 0), AxisState::Holding, "its output is still on");
    let since = rig.now_us;
    run_with_host(&mut rig, 500_000);
    assert!(rig.longest_gap_us(0, since, "141#9C") <= 100_000);
}

#[test]
fn an_arming_that_fails_before_anything_was_sent_leaves_the_axis_as_it_was() {
    let (mut rig, _) = bench::d5();
    rig.instead(|_| Instead::Nothing);
    assert!(matches!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(Error::NoReply { .. })));
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
}

#[test]
fn an_arming_that_fails_under_a_locked_brake_leaves_the_motor_holding() {
    let (mut rig, play) = bench::rmd(StopAction::Brake);
    play.borrow_mut().fault = true;
    assert!(matches!(
        rig.ask(Request::Arm(requests::Arm { axis: 0 })),
        Err(Error::MotorFault { .. })
    ));
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    assert_eq!(output_off(&mut rig), Ok(Reply::OutputOff(replies::Done {})));
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
}

#[test]
fn raw_access_is_refused_where_a_motor_holds() {
    let mut rig = held();
    let open = Request::RawOpen(requests::RawOpen { bus: 0, unsafe_access: false });
    assert_eq!(rig.ask(open.clone()), Err(Error::NotIdle { axis: 0, state: AxisState::Holding }));
    output_off(&mut rig).unwrap();
    assert_eq!(rig.ask(open), Ok(Reply::RawOpen(replies::Done {})));
}

/// While a bus is off nothing is polled, and its motors let go.
#[test]
fn a_motor_that_held_on_a_bus_that_was_off_for_its_own_timeout_is_told_to_hold_again() {
    let mut rig = held();
    let since = rig.now_us;
    rig.shorted = true;
    rig.bus_off(0);
    run_with_host(&mut rig, 500_000);
    rig.shorted = false;
    run_with_host(&mut rig, 1_000_000);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
}

#[test]
fn a_motor_that_was_silent_for_its_own_timeout_is_told_to_hold_again_however_few_replies_it_missed()
{
    let (mut rig, play) = bench::rmd_with_timeout(100);
    bench::parameter(&mut rig, 0, AxisParameter::MissedReplies, Value::Unsigned(20));
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 300_000);
    for (silent_us, is_stopped) in [(50_000, false), (130_000, true)] {
        let since = rig.now_us;
        play.borrow_mut().mute = true;
        run_with_host(&mut rig, silent_us);
        assert_eq!(listed(&mut rig, 0), AxisState::Holding);
        play.borrow_mut().mute = false;
        run_with_host(&mut rig, 300_000);
        assert_eq!(rig.sent_since(0, since).contains(&HOLD), is_stopped, "{silent_us}");
        assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    }
}

/// Nothing is known of its timeout: it is taken to act within 100 ms.
#[test]
fn a_motor_of_unknown_timeout_is_told_to_hold_again_behind_a_bus_that_was_off() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 1_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    let since = rig.now_us;
    rig.shorted = true;
    rig.bus_off(0);
    run_with_host(&mut rig, 110_000);
    rig.shorted = false;
    run_with_host(&mut rig, 1_000_000);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
}

/// Its power was off for too short a time for its silence to be noticed.
#[test]
fn a_motor_that_restarts_while_it_holds_is_told_to_hold_again_within_a_second() {
    let mut rig = held();
    run_with_host(&mut rig, 2_000_000);
    let since = rig.now_us;
    rig.instead(move |text| match text {
        "141#B100000000000000" => Instead::Says("241#B100000014000000"),
        _ => Instead::AsUsual,
    });
    run_with_host(&mut rig, 2_000_000);
    assert!(rig.sent_since(0, since).contains(&HOLD));
    assert_fed_every_100_ms(&rig, since);
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
}

/// Nor does a host that only looks on, and asks again as soon as it is answered.
#[test]
fn questions_keep_no_silent_motor_from_being_told_to_hold_again() {
    let mut rig = held();
    rig.instead(|_| Instead::Nothing);
    let since = rig.now_us;
    while rig.now_us < since + 1_000_000 {
        let read = Request::ReadState(requests::ReadState { axis: 0 });
        let _ = rig.ask_as(1, &read);
        rig.run(100);
    }
    assert!(rig.sent_since(0, since).contains(&HOLD));
}

/// It was seen to turn, so it was not at rest.
#[test]
fn the_stop_of_a_holding_motor_that_turns_and_cannot_be_reached_drops_the_enable_output() {
    let mut rig = held();
    rig.instead(|text| match text.starts_with("141#9C") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let since = rig.now_us;
    while !rig.sent_since(0, since).iter().any(|text| text.starts_with("141#9C")) {
        rig.run(50);
    }
    rig.run(200);
    rig.cut();
    rig.receive(0, "241#9C326400F4012D00");
    assert_eq!(listed(&mut rig, 0), AxisState::Stopping);
    run_with_host(&mut rig, 500_000);
    assert!(matches!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false }));
    assert!(!rig.gateway.enable_output());
}
