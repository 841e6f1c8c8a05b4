//! Axes that share a bus: no motor's slowness delays another's motion, and stops go out in fair
//! turns.

use crate::bench::{self, VELOCITY, arm_axis, e_stop, keep_moving};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Event, Protocol, ProtocolSet, Request, StopAction, Value, requests,
};

#[test]
fn slow_brakes_do_not_starve_the_motion_of_another_axis() {
    let mut rig = bench::rmd_axes(6);
    for axis in 1..6 {
        bench::parameter(&mut rig, axis, AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true));
    }
    rig.instead(|text| if text.contains("#77") { Instead::Nothing } else { Instead::AsUsual });
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 100_000);
    let since = rig.now_us;
    for axis in 1..6 {
        rig.send(&Request::Arm(requests::Arm { axis }));
    }
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 600_000);
    for brake in ["142#77", "143#77", "144#77", "145#77", "146#77"] {
        assert!(rig.sent_since(0, since).iter().any(|text| text.starts_with(brake)), "{brake}");
    }
    let gap = rig.longest_gap_us(0, since, "141#A2");
    assert!(gap <= 20_000, "{gap} µs between motion frames");
}

#[test]
fn every_axis_is_sent_its_first_stop_before_any_is_sent_its_second() {
    let mut rig = bench::rmd_axes(8);
    let moving = [0, 1, 2, 3, 4, 5, 6, 7].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &moving, VELOCITY, 100_000);
    let since = rig.now_us;
    e_stop(&mut rig);
    rig.run(5_000);
    let sent = rig.sent_since(0, since);
    let stops = sent.into_iter().skip_while(|text| !text.ends_with("#8100000000000000"));
    let mut first_8: Vec<_> = stops.take(8).collect();
    first_8.sort_unstable();
    let stop_of_each = [
        "141#8100000000000000",
        "142#8100000000000000",
        "143#8100000000000000",
        "144#8100000000000000",
        "145#8100000000000000",
        "146#8100000000000000",
        "147#8100000000000000",
        "148#8100000000000000",
    ];
    assert_eq!(first_8, stop_of_each);
}

#[test]
fn a_question_that_stays_unanswered_delays_the_setpoint_by_one_reply_window_and_no_more() {
    const WINDOW_US: u64 = 40_000;
    let mut rig = bench::rmd_axes(1);
    rig.ask(Request::ConfigureBus(requests::ConfigureBus {
        bus: 0,
        bitrate: 1_000_000,
        protocols: ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]),
        exclusive: false,
        reply_window_us: 40_000,
    }))
    .unwrap();
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 100_000);
    let since = rig.now_us;
    let mut questions = 0;
    rig.instead(move |text| {
        questions += u32::from(!text.starts_with("141#A2"));
        if questions % 2 == 1 && !text.starts_with("141#A2") {
            Instead::Nothing
        } else {
            Instead::AsUsual
        }
    });
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 1_000_000);
    let gap = rig.longest_gap_us(0, since, "141#A2");
    assert!((WINDOW_US..WINDOW_US + 21_000).contains(&gap), "{gap} µs between motion frames");
}

/// Whoever turns: in any other order the controllers' arbitration could keep the lowest id out
/// (GUARANTEES G4).
#[test]
fn first_stops_go_in_the_order_of_their_ids_and_before_all_second_ones() {
    for moving in 0..4 {
        let mut rig = bench::rmd_axes(4);
        let epoch = arm_axis(&mut rig, moving);
        keep_moving(&mut rig, &[(moving, epoch)], VELOCITY, 55_000);
        let since = rig.now_us;
        e_stop(&mut rig);
        rig.run(5_000);
        let sent = rig.sent_since(0, since);
        let stops: Vec<_> =
            sent.into_iter().filter(|text| text.ends_with("#8100000000000000")).collect();
        assert_eq!(
            stops[..4],
            ["141", "142", "143", "144"].map(|id| format!("{id}#8100000000000000"))
        );
        assert!(stops.len() >= 8, "{stops:?}");
    }
}

#[test]
fn the_fault_word_is_read_at_least_every_100_ms_under_fast_setpoints_on_a_slow_line() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    let epoch = arm_axis(&mut rig, 0);
    let since = rig.now_us;
    for _ in 0..2_400 {
        keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 3_700); // no part of 100 ms
    }
    let gap = rig.longest_gap_us(2, since, "3E01089A");
    assert!((85_000..=100_000).contains(&gap), "{gap} µs between fault words");
}

/// A thruster's stop can lose to so many replies (GUARANTEES G5); one that a stop has displaced is
/// still to come.
#[test]
fn no_more_than_four_replies_are_outstanding_on_a_bus_that_thrusters_share() {
    let mut rig = bench::rmd_axes(8);
    rig.instead(|text| if text.contains("#81") { Instead::AsUsual } else { Instead::Nothing });
    let since = rig.now_us;
    for axis in 0..7 {
        rig.send(&Request::ReadState(requests::ReadState { axis }));
    }
    rig.run(1_000);
    let questions =
        |rig: &Rig| rig.sent_since(0, since).iter().filter(|text| !text.contains("#81")).count();
    assert_eq!(questions(&rig), 4);
    bench::stop(&mut rig);
    rig.run(2_500);
    assert!(rig.sent_since(0, since).iter().filter(|text| text.contains("#81")).count() >= 2);
    assert_eq!(questions(&rig), 4);
    rig.run(5_000); // the windows have closed
    assert!(questions(&rig) > 4);
}

/// Its silence says nothing, and it takes its turn all the same.
#[test]
fn a_motor_that_is_stopped_while_it_restarts_leaves_the_line_to_the_others_in_turn() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    bench::configure_axis(&mut rig, 1, 2, Protocol::Rmd, 2, StopAction::Hold);
    let epoch = arm_axis(&mut rig, 1);
    keep_moving(&mut rig, &[(1, epoch)], VELOCITY, 100_000);
    rig.instead(|text| match text.get(..4) {
        Some("3E01") if text.get(6..8) != Some("80") => Instead::Nothing,
        _ => Instead::AsUsual,
    });
    let restart = bench::native(&rig, 0, "7600000000000000");
    rig.ask(restart).unwrap();
    bench::stop(&mut rig);
    let since = rig.now_us;
    keep_moving(&mut rig, &[(1, epoch)], VELOCITY, 1_000_000);
    assert_eq!(bench::listed(&mut rig, 1), AxisState::Active);
    let gap = rig.longest_gap_us(2, since, "3E02");
    assert!(gap <= 45_000, "{gap} µs in which the motor has heard nothing");
}

/// Two RMDs in motion on a line whose reply window is 200 ms.
fn two_behind_long_windows() -> Rig {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    let request = requests::ConfigureBus {
        bus: 2,
        bitrate: 115_200,
        protocols: ProtocolSet::of(&[Protocol::Rmd]),
        exclusive: false,
        reply_window_us: 200_000,
    };
    rig.ask(Request::ConfigureBus(request)).unwrap();
    bench::configure_axis(&mut rig, 1, 2, Protocol::Rmd, 2, StopAction::Hold);
    let moving = [0, 1].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &moving, VELOCITY, 100_000);
    rig
}

/// What takes its turn leaves late by that.
#[test]
fn stops_that_take_turns_behind_long_windows_are_not_told_as_unsent() {
    let mut rig = two_behind_long_windows();
    rig.instead(|_| Instead::Nothing);
    bench::e_stop(&mut rig);
    bench::run_with_host(&mut rig, 3_000_000);
    let unsent =
        |event: &Event| matches!(event, Event::AxisUnreachable { stop_transmitted: false, .. });
    let told = bench::outcomes(&rig);
    assert!(!told.iter().any(unsent), "{told:?}");
}

/// Whose timeout is not known is not taken to have let go each time that others have had the line:
/// half of the time it is confirmed.
#[test]
fn a_motor_that_answers_is_confirmed_beside_one_that_does_not_behind_long_windows() {
    const LOOKS: usize = 200;
    let mut rig = two_behind_long_windows();
    rig.instead(|text| match text.starts_with("3E02") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    bench::e_stop(&mut rig);
    let mut confirmed = 0;
    for _ in 0..LOOKS {
        bench::run_with_host(&mut rig, 10_000);
        let is_confirmed = bench::listed(&mut rig, 0) == AxisState::Tripped { confirmed: true };
        confirmed += usize::from(is_confirmed);
        assert_eq!(bench::listed(&mut rig, 1), AxisState::Tripped { confirmed: false });
    }
    assert!(confirmed * 2 >= LOOKS, "in {confirmed} of {LOOKS} looks");
}

/// On a line nothing leaves while an answer may come, so stops without a pause would take all of it
/// until the motor is given up.
#[test]
fn a_motor_that_misses_its_stops_leaves_the_line_to_the_others_in_turn() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    bench::provision(&mut rig, 90).unwrap();
    for axis in [1, 2] {
        bench::configure_axis(&mut rig, axis, 2, Protocol::Rmd, axis + 1, StopAction::Hold);
    }
    let moving = [0, 1, 2].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &moving, VELOCITY, 100_000);
    let since = rig.now_us;
    rig.instead(|text| match text.get(..4) {
        Some("3E02" | "3E03") => Instead::Nothing,
        _ => Instead::AsUsual,
    });
    keep_moving(&mut rig, &moving[..1], VELOCITY, 300_000);
    for axis in [1, 2] {
        assert_eq!(bench::listed(&mut rig, axis), AxisState::Tripped { confirmed: false });
    }
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Active);
    let gap = rig.longest_gap_us(2, since, "3E01");
    assert!(gap <= 35_000, "{gap} µs in which the motor has heard nothing");
    let stops = rig.sent_since(2, since).into_iter().filter(|text| text.starts_with("3E020881"));
    assert!(stops.count() >= 10);
}
