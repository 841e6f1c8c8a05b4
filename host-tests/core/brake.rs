//! Stopping an RMD by its holding brake: 0x81, standstill or 1 s, 0x78, 0x9A byte 3 = 0, 0x80.

use crate::bench::{
    self, COAST, HOLD, VELOCITY, assert_tripped, e_stop, listed, move_axis, outcomes,
    run_with_host, stop,
};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Event as HostEvent, Request, StopAction, StopTarget,
    TripReason, Value, requests,
};

const LOCK: &str = "141#7800000000000000";
const RELEASE: &str = "141#7700000000000000";

#[test]
fn behind_a_locked_brake_only_switching_off_is_repeated() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    move_axis(&mut rig, VELOCITY);
    run_with_host(&mut rig, 500_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    let since = rig.now_us;
    run_with_host(&mut rig, 2_000_000);
    let sent = rig.sent_since(0, since);
    assert!(!sent.contains(&HOLD), "{sent:?}");
    assert!((3..=5).contains(&sent.iter().filter(|text| **text == COAST).count()), "{sent:?}");
}

#[test]
fn a_locked_brake_confirms_nothing_while_the_motor_turns() {
    let (mut rig, play) = bench::rmd(StopAction::Brake);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    e_stop(&mut rig);
    run_with_host(&mut rig, 3_000_000);
    assert!(rig.sent_since(0, 0).contains(&LOCK));
    assert_eq!(outcomes(&rig), []);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

#[test]
fn a_motor_that_falls_silent_once_the_brake_is_locked_is_noticed() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    let mut locked = false;
    rig.instead(move |text| {
        if locked {
            return Instead::Nothing;
        }
        locked = text == LOCK;
        Instead::AsUsual
    });
    move_axis(&mut rig, VELOCITY);
    stop(&mut rig);
    run_with_host(&mut rig, 10_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }]);
}

#[test]
fn a_motor_out_of_reach_behind_its_locked_brake_is_confirmed_when_it_is_back() {
    let (mut rig, play) = bench::rmd(StopAction::Brake);
    move_axis(&mut rig, VELOCITY);
    stop(&mut rig);
    while !rig.sent_since(0, 0).contains(&COAST) {
        rig.run(10);
    }
    rig.run(300); // the answer to 0x80 has come
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }]);
    play.borrow_mut().mute = false;
    let since = rig.now_us;
    run_with_host(&mut rig, 2_000_000);
    let repeats = rig.sent_since(0, since).iter().filter(|text| **text == COAST).count();
    assert!(repeats <= 10, "{repeats} times 0x80 in 2 s");
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
}

#[test]
fn a_brake_that_never_locks_is_noticed() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    let free = "241#9A320001E5010000";
    rig.instead(
        move |text| if text.starts_with("141#9A") { Instead::Says(free) } else { Instead::AsUsual },
    );
    move_axis(&mut rig, VELOCITY);
    stop(&mut rig);
    run_with_host(&mut rig, 10_000_000);
    assert_tripped(&mut rig, TripReason::StopUnconfirmed, false);
}

#[test]
fn an_arming_that_fails_after_the_brake_was_freed_locks_it_again() {
    let (mut rig, play) = bench::rmd(StopAction::Brake);
    bench::parameter(&mut rig, 0, AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true));
    play.borrow_mut().turning = true; // the load drops as the brake opens
    let arming = rig.ask(Request::Arm(requests::Arm { axis: 0 }));
    assert!(matches!(arming, Err(Error::NotStandstill { axis: 0, .. })), "{arming:?}");
    run_with_host(&mut rig, 2_000_000);
    let sent = rig.sent_since(0, 0);
    let position = |wanted: &str| sent.iter().position(|text| *text == wanted).expect(wanted);
    assert!(position(RELEASE) < position(LOCK), "{sent:?}");
}

/// RMD V3.6 §2.12.3: byte 3 is 0 while the brake is locked, 1 once it was released.
const LOCKED: &str = "241#9A320000E5010000";

#[test]
fn a_locked_brake_bars_arming_of_an_axis_that_has_one() {
    for (action, frees, armed) in [
        (StopAction::Coast, false, true),
        (StopAction::Hold, false, true),
        (StopAction::Hold, true, false),
        (StopAction::Brake, false, false),
        (StopAction::Brake, true, false),
    ] {
        let (mut rig, _) = bench::rmd(action);
        rig.instead(|text| {
            if text.starts_with("141#9A") { Instead::Says(LOCKED) } else { Instead::AsUsual }
        });
        bench::parameter(&mut rig, 0, AxisParameter::ReleaseBrakeWhenArming, Value::Bool(frees));
        let arming = rig.ask(Request::Arm(requests::Arm { axis: 0 }));
        assert_eq!(arming.is_ok(), armed, "{action:?} {frees} {arming:?}");
        assert!(armed || arming == Err(Error::BrakeLocked { axis: 0 }), "{arming:?}");
        assert_eq!(rig.sent_since(0, 0).contains(&RELEASE), frees);
    }
}

#[test]
fn coast_is_refused_where_arming_frees_the_brake() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    let set = |parameter: AxisParameter, value| {
        Request::ConfigureAxis(requests::ConfigureAxis {
            axis: 0,
            parameter: parameter.number(),
            value,
        })
    };
    let frees = set(AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true));
    assert_eq!(rig.ask(frees.clone()), Err(Error::BrakeStaysOpen { axis: 0 }));
    let action = |action: StopAction| {
        set(AxisParameter::StopAction, Value::Unsigned(action.number().into()))
    };
    rig.ask(action(StopAction::Brake)).unwrap();
    rig.ask(frees).unwrap();
    assert_eq!(rig.ask(action(StopAction::Coast)), Err(Error::BrakeStaysOpen { axis: 0 }));
}

#[test]
fn a_brake_that_does_not_show_it_counts_by_its_echoes_and_a_second_and_the_host_is_told() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    rig.instead(
        |text| if text.starts_with("141#9A") { Instead::Says(LOCKED) } else { Instead::AsUsual },
    );
    bench::parameter(&mut rig, 0, AxisParameter::AllowUnverifiedBrake, Value::Bool(true));
    // Nobody has freed it.
    let arm = Request::Arm(requests::Arm { axis: 0 });
    assert_eq!(rig.ask(arm.clone()), Err(Error::BrakeLocked { axis: 0 }));
    bench::parameter(&mut rig, 0, AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true));
    rig.ask(arm).unwrap();
    let since = rig.now_us;
    stop(&mut rig);
    run_with_host(&mut rig, 950_000);
    let sent = |rig: &crate::rig::Rig, wanted| rig.sent_since(0, since).contains(&wanted);
    assert!(sent(&rig, LOCK) && !sent(&rig, COAST));
    assert_eq!(listed(&mut rig, 0), AxisState::Stopping);
    run_with_host(&mut rig, 200_000);
    assert!(sent(&rig, COAST));
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
    for locked in [false, true] {
        assert!(
            rig.events()
                .into_iter()
                .any(|event| *event == HostEvent::BrakeUnverified { axis: 0, locked })
        );
    }
}

/// Behind the lock a stop would switch the output on again.
#[test]
fn a_stop_that_was_asked_for_before_the_brake_locks_is_not_sent_behind_that() {
    for every in (300..12_000).step_by(130) {
        let (mut rig, _) = bench::rmd(StopAction::Brake);
        bench::parameter(&mut rig, 0, AxisParameter::AllowUnverifiedBrake, Value::Bool(true));
        move_axis(&mut rig, VELOCITY);
        let since = rig.now_us;
        // While the brake counts as unlocked for a second.
        for _ in 0..500_000 / every {
            rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
            rig.run(every);
        }
        let sent = rig.sent_since(0, since);
        let lock = sent.iter().position(|text| *text == LOCK).expect("locked");
        assert!(!sent[lock..].contains(&HOLD), "every {every} µs: {sent:?}");
    }
}

/// Meanwhile the motor holds by what it hears: its own timeout would drop the load.
#[test]
fn a_brake_command_that_is_not_answered_is_followed_by_the_stop_in_less_than_200_ms() {
    for answers_the_second in [true, false] {
        let (mut rig, _) = bench::rmd(StopAction::Brake);
        let mut locks = 0;
        rig.instead(move |text| {
            locks += u8::from(text == LOCK);
            let is_answered = text != LOCK || answers_the_second && locks > 1;
            if is_answered { Instead::AsUsual } else { Instead::Nothing }
        });
        move_axis(&mut rig, VELOCITY);
        let since = rig.now_us;
        stop(&mut rig);
        run_with_host(&mut rig, 250_000);
        let sent = rig.sent_since(0, since);
        let lock = sent.iter().position(|text| *text == LOCK).expect("locked");
        assert_eq!(sent[lock + 1], HOLD, "{sent:?}");
        assert!(rig.longest_gap_us(0, since, "") < 200_000);
        run_with_host(&mut rig, 1_750_000);
        // A confirmed stop is repeated less often.
        assert!(answers_the_second || rig.longest_gap_us(0, since, "") < 200_000);
        let is_confirmed = matches!(outcomes(&rig)[..], [HostEvent::StopConfirmed { axis: 0, .. }]);
        assert_eq!(is_confirmed, answers_the_second, "{:?}", outcomes(&rig));
    }
}

/// Moves the motor and stops it, until its brake has been told to lock.
fn stop_until_locking(rig: &mut Rig) {
    move_axis(rig, VELOCITY);
    stop(rig);
    while !rig.sent_since(0, 0).contains(&LOCK) {
        rig.run(1_000);
    }
}

#[test]
fn an_e_stop_while_the_brake_is_being_locked_is_sent_in_less_than_200_ms() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    rig.instead(|text| if text == LOCK { Instead::Nothing } else { Instead::AsUsual });
    stop_until_locking(&mut rig);
    rig.run(1_000);
    let since = rig.now_us;
    e_stop(&mut rig);
    run_with_host(&mut rig, 200_000);
    assert_eq!(rig.sent_since(0, since).first(), Some(&HOLD));
}

/// It holds by 0x81 meanwhile, which its own timeout would end; and a stop that is asked for again
/// tells the brake again, at most twice.
#[test]
fn a_brake_that_locks_unseen_is_told_again_and_its_motor_asked_all_the_time() {
    for presses in [0, 1, 4] {
        let (mut rig, _) = bench::rmd(StopAction::Brake);
        bench::parameter(&mut rig, 0, AxisParameter::AllowUnverifiedBrake, Value::Bool(true));
        stop_until_locking(&mut rig);
        rig.run(5_000);
        let since = rig.now_us;
        for press in 0..presses {
            let pressed = rig.now_us;
            e_stop(&mut rig);
            rig.run(2_000);
            let is_told = rig.sent_since(0, pressed).contains(&LOCK);
            assert_eq!(is_told, press < 2, "press {press}");
            run_with_host(&mut rig, 100_000);
        }
        let locked_by = rig.now_us + 1_100_000;
        while !rig.sent_since(0, since).contains(&COAST) && rig.now_us < locked_by {
            run_with_host(&mut rig, 1_000);
        }
        let sent = rig.sent_since(0, since);
        let told = sent.iter().filter(|text| **text == LOCK).count();
        assert_eq!(told, presses.min(2), "{sent:?}");
        assert!(!sent.contains(&HOLD) && sent.contains(&COAST), "{sent:?}");
        let gap = rig.longest_gap_us(0, since, "");
        assert!(gap < 30_000, "{presses}: {gap} µs in which the motor hears nothing");
    }
}

/// The brake answers 0x78 and shows itself open (§2.12.3), or does not show itself at all.
#[test]
fn a_brake_that_is_not_seen_to_lock_is_followed_by_the_stop_in_less_than_200_ms() {
    for shows in [Instead::Says("241#9A320001E5010000"), Instead::Nothing] {
        let (mut rig, _) = bench::rmd(StopAction::Brake);
        let answer =
            move |text: &str| if text.starts_with("141#9A") { shows } else { Instead::AsUsual };
        move_axis(&mut rig, VELOCITY);
        rig.instead(answer);
        let since = rig.now_us;
        stop(&mut rig);
        run_with_host(&mut rig, 400_000);
        let sent = rig.sent_since(0, since);
        assert!(sent.iter().filter(|text| **text == LOCK).count() > 1, "{sent:?}");
        let gap = rig.longest_gap_us(0, since, HOLD);
        assert!(gap < 200_000, "{shows:?}: {gap} µs without the stop: {sent:?}");
        // An e-stop in between adds nothing that comes later than that.
        let since = rig.now_us;
        e_stop(&mut rig);
        run_with_host(&mut rig, 200_000);
        assert!(rig.sent_since(0, since).contains(&HOLD));
    }
}

/// The brake takes up to 150 ms: the motor hears nothing meanwhile, and its own timeout would leave
/// an open brake and no output.
#[test]
fn a_timeout_that_would_act_while_the_brake_opens_or_locks_is_refused() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let releases = |rig: &mut Rig, so| {
        bench::parameter(rig, 0, AxisParameter::ReleaseBrakeWhenArming, Value::Bool(so));
    };
    // What a brake may take and what its motor may wait behind that, and its clock a twentieth fast.
    let least_ms = 180;
    let too_short = Error::MotorTimeoutTooShort { axis: 0, motor_timeout_ms: 60, least_ms };
    assert_eq!(bench::provision(&mut bench::rmd(StopAction::Brake).0, 60), Err(too_short));
    releases(&mut rig, true);
    assert_eq!(bench::provision(&mut rig, 60), Err(too_short));
    releases(&mut rig, false);
    bench::provision(&mut rig, 60).unwrap();
    let (releasing, locking) = (
        (AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true)),
        (AxisParameter::StopAction, Value::Unsigned(StopAction::Brake.into())),
    );
    for (parameter, value) in [releasing, locking] {
        let request = requests::ConfigureAxis { axis: 0, parameter: parameter.number(), value };
        assert_eq!(rig.ask(Request::ConfigureAxis(request)), Err(too_short));
    }
    bench::provision(&mut rig, least_ms).unwrap();
    releases(&mut rig, true);
    bench::arm(&mut rig);
}

#[test]
fn an_armed_axis_with_a_brake_is_polled_within_a_third_of_the_timeout() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    bench::provision(&mut rig, 300).unwrap();
    for poll in [AxisParameter::StatePollUs, AxisParameter::FaultPollUs] {
        bench::parameter(&mut rig, 0, poll, Value::Unsigned(1_000_000));
    }
    bench::arm(&mut rig);
    let since = rig.now_us;
    run_with_host(&mut rig, 2_000_000);
    let gap = rig.longest_gap_us(0, since, "141#");
    assert!(gap <= 100_000, "{gap} µs in which its motor could lock the brake");
}
