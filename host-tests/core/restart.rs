//! Clearing a trip by a restart of the motor (RMD V3.6 §2.25, §8.1): told once, waited out, seen by
//! the run time (§2.28).

use std::cell::Cell;
use std::rc::Rc;

use crate::bench::{self, VELOCITY, listed, move_axis, outcomes, run_with_host};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Event, NoReplyHint, Reply, Request, StopAction, Value,
    replies, requests,
};

/// 20 ms.
const AFTER: Instead = Instead::Says("241#B100000014000000");
const TELL: &str = "141#7600000000000000";
const ASK: &str = "141#B100000000000000";
const RESTART: Request = Request::ClearByRestart(requests::ClearByRestart { axis: 0 });

/// An axis that has tripped and stands confirmed. Its motor, once told to restart, is silent for so
/// many requests and then tells `after` as its run time.
fn tripped(silent_for: u32, after: Instead) -> Rig {
    let (mut rig, _) = bench::rmd_with_timeout(300);
    bench::parameter(&mut rig, 0, AxisParameter::StopsBeforeUnreachable, Value::Unsigned(3));
    move_axis(&mut rig, VELOCITY);
    run_with_host(&mut rig, 500_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    let mut unheard = None;
    rig.instead(move |text| match (text, &mut unheard) {
        (TELL, unheard) => {
            *unheard = Some(0);
            Instead::Nothing
        }
        (_, Some(count)) if *count < silent_for => {
            *count += 1;
            Instead::Nothing
        }
        (ASK, Some(_)) => after,
        _ => Instead::AsUsual,
    });
    rig
}

#[test]
fn a_restart_is_told_once_waited_out_and_seen_and_the_silence_counts_as_no_missed_stop() {
    let mut rig = tripped(40, AFTER);
    let since = rig.now_us;
    let sequence = rig.send(&RESTART);
    run_with_host(&mut rig, 2_900_000);
    assert_eq!(rig.answer(sequence), Some(Ok(Reply::ClearByRestart(replies::Done {}))));
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    let sent = rig.sent_since(0, since);
    let first = |wanted: &str| sent.iter().position(|text| *text == wanted).expect(wanted);
    let (told, cleared) = (first(TELL), first("141#9A00000000000000"));
    assert!(first(ASK) < told && sent[told..cleared].contains(&ASK), "{sent:?}");
    assert_eq!(sent.iter().filter(|text| **text == TELL).count(), 1);
    // It has switched its output off: it holds by a stop that it has heard since.
    let stops = |text: &&&str| **text == bench::HOLD;
    assert!(sent[cleared..].iter().filter(stops).count() >= 2, "{sent:?}");
    let is_unreachable = |event: &Event| matches!(event, Event::AxisUnreachable { .. });
    assert!(!outcomes(&rig).iter().any(is_unreachable));
}

#[test]
fn a_motor_whose_run_time_goes_on_has_not_restarted() {
    let mut rig = tripped(0, Instead::AsUsual);
    let sequence = rig.send(&RESTART);
    run_with_host(&mut rig, 2_900_000);
    assert_eq!(rig.answer(sequence), None);
    run_with_host(&mut rig, 300_000);
    assert_eq!(rig.answer(sequence), Some(Err(Error::NotRestarted { axis: 0 })));
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
}

#[test]
fn a_motor_that_does_not_come_back_is_reported_and_its_missed_stops_count_from_then_on() {
    let mut rig = tripped(u32::MAX, AFTER);
    let sequence = rig.send(&RESTART);
    run_with_host(&mut rig, 3_200_000);
    assert_eq!(
        rig.answer(sequence),
        Some(Err(Error::NoReply { axis: 0, hint: NoReplyHint::None }))
    );
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    run_with_host(&mut rig, 3_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

#[test]
fn only_a_confirmed_trip_of_a_motor_that_can_restart_is_cleared_so() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    assert_eq!(rig.ask(RESTART), Err(Error::NothingToClear { axis: 0 }));
    move_axis(&mut rig, VELOCITY);
    assert_eq!(rig.ask(RESTART), Err(Error::NothingToClear { axis: 0 }));
    rig.instead(
        |text| if text.starts_with("141#81") { Instead::Nothing } else { Instead::AsUsual },
    );
    bench::e_stop(&mut rig);
    assert_eq!(rig.ask(RESTART), Err(Error::StopNotConfirmed { axis: 0 }));
    let (mut rig, _) = bench::thruster();
    move_axis(&mut rig, host_protocol::Setpoint::Signal { fraction: 0.2 });
    run_with_host(&mut rig, 500_000);
    assert_eq!(
        rig.ask(RESTART),
        Err(Error::Unsupported { axis: 0, protocol: host_protocol::Protocol::Thruster })
    );
}

/// What ends the clearing does not end the restart.
#[test]
fn a_stop_or_a_dead_bus_during_a_restart_makes_no_axis_unreachable() {
    let ends: [fn(&mut Rig); 3] = [bench::e_stop, bench::stop, |rig| rig.bus_off(0)];
    for (number, end) in ends.into_iter().enumerate() {
        let mut rig = tripped(u32::MAX, AFTER);
        let since = rig.now_us;
        rig.send(&RESTART);
        run_with_host(&mut rig, 300_000);
        assert!(rig.sent_since(0, since).contains(&TELL));
        end(&mut rig);
        run_with_host(&mut rig, 2_650_000);
        assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true }, "{number}");
        // It has had its time.
        run_with_host(&mut rig, 3_000_000);
        assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false }, "{number}");
    }
}

/// A motor that is seen to be back owes its answers again.
#[test]
fn the_silence_of_a_motor_that_has_restarted_counts() {
    let mut rig = tripped(0, AFTER);
    assert_eq!(rig.ask(RESTART), Ok(Reply::ClearByRestart(replies::Done {})));
    rig.instead(|_| Instead::Nothing);
    bench::stop(&mut rig);
    run_with_host(&mut rig, 1_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

#[test]
fn a_stop_during_a_restart_that_was_asked_natively_makes_no_axis_unreachable() {
    for stopped_after_us in [0, 100_000, 1_000_000] {
        let (mut rig, _) = bench::rmd_with_timeout(300);
        let restarts = Rc::new(Cell::new(false));
        let is_silent = restarts.clone();
        rig.instead(move |text| {
            is_silent.set(is_silent.get() || text == TELL);
            if is_silent.get() { Instead::Nothing } else { Instead::AsUsual }
        });
        let restart = bench::native(&rig, 0, &TELL[4..]);
        rig.ask(restart).unwrap();
        run_with_host(&mut rig, stopped_after_us);
        bench::stop(&mut rig);
        run_with_host(&mut rig, 1_200_000);
        restarts.set(false);
        run_with_host(&mut rig, 200_000);
        assert_eq!(listed(&mut rig, 0), AxisState::Holding, "{stopped_after_us} µs");
        let unheard =
            |event: &Event| matches!(event, Event::AxisUnreachable { .. } | Event::Tripped { .. });
        assert!(!outcomes(&rig).iter().any(unheard));
    }
    // One that was armed since owes its answers.
    let (mut rig, _) = bench::rmd_with_timeout(300);
    let restart = bench::native(&rig, 0, &TELL[4..]);
    rig.ask(restart).unwrap();
    move_axis(&mut rig, VELOCITY);
    rig.instead(|_| Instead::Nothing);
    bench::stop(&mut rig);
    run_with_host(&mut rig, 700_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

/// Both let go, or change what the motor does by itself.
#[test]
fn behind_a_latched_e_stop_no_motor_is_restarted_or_provisioned() {
    let mut rig = tripped(u32::MAX, AFTER);
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 500_000);
    assert_eq!(rig.ask(RESTART), Err(Error::EStopped {}));
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 500_000);
    let since = rig.now_us;
    assert_eq!(bench::provision(&mut rig, 300), Err(Error::EStopped {}));
    assert!(!rig.sent_since(0, since).iter().any(|text| text.starts_with("141#B3")));
}
