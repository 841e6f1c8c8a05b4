//! Frames that the port of a serial line keeps until the reply to the one before has come: no time
//! passes between the two, and nothing is kept from going before them.

use crate::bench::{self, VELOCITY, arm_axis, keep_moving};
use crate::rig::{Echo, FRAME_US, Instead, MOTOR_US, Rig};
use crate::text::unhex;
use gateway::{Event, Then};
use host_protocol::{
    AxisParameter, AxisState, Protocol, Request, Setpoint, StopAction, StopTarget, Value, requests,
};

/// The reply window of the line, µs.
const WINDOW_US: u64 = 5_000;
/// 20 bits at 115200 baud, rounded up, µs.
const PAUSE_US: u64 = 174;

/// Two RMDs on one line that move.
fn two_that_move() -> (Rig, [(u8, u32); 2]) {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    bench::configure_axis(&mut rig, 1, 2, Protocol::Rmd, 2, StopAction::Hold);
    let moving = [0, 1].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &moving, VELOCITY, 100_000);
    (rig, moving)
}

/// The second motor answers nothing; a frame to it has left, and one to the first waits for its
/// reply. Returns until when.
fn one_waits(rig: &mut Rig) -> u64 {
    rig.instead(|text| match text.starts_with("3E02") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let waits = |rig: &Rig| rig.behind_reply().is_some_and(|text| text.starts_with("3E01"));
    let until = rig.now_us + 50_000;
    while !waits(rig) {
        assert!(rig.now_us < until, "nothing waits");
        rig.run(10);
    }
    let (at, _, text) = rig.wire.last().unwrap();
    assert!(text.starts_with("3E02"), "{text}");
    at + FRAME_US + WINDOW_US
}

#[test]
fn the_next_motor_is_asked_as_soon_as_the_one_before_has_answered() {
    let (mut rig, moving) = two_that_move();
    let since = rig.now_us;
    keep_moving(&mut rig, &moving, VELOCITY, 100_000);
    let times: Vec<(u64, String)> = rig
        .wire
        .iter()
        .filter(|(at, bus, _)| *bus == 2 && *at >= since)
        .map(|(at, _, text)| (*at, text[..4].into()))
        .collect();
    let exchange_us = 2 * FRAME_US + MOTOR_US;
    let other = |pair: &&[(u64, String)]| pair[0].1 != pair[1].1;
    let gaps: Vec<u64> = times.windows(2).filter(other).map(|pair| pair[1].0 - pair[0].0).collect();
    let at_once = gaps.iter().filter(|gap| **gap == exchange_us).count();
    assert!(at_once >= 5, "{gaps:?}");
    // Without one that waits there is a pause.
    assert!(gaps.iter().all(|gap| *gap == exchange_us || *gap >= exchange_us + PAUSE_US));
}

#[test]
fn what_waits_in_vain_is_given_back_and_keeps_its_turn() {
    let (mut rig, _) = two_that_move();
    let until = one_waits(&mut rig);
    let since = rig.now_us;
    let waited = rig.behind_reply().map(str::to_owned);
    rig.run(until - since - 10);
    assert_eq!(rig.sent_since(2, since), [""; 0]);
    assert_eq!(rig.behind_reply().map(str::to_owned), waited);
    rig.run(200);
    // Which frame it is then is chosen anew.
    let sent = rig.sent_since(2, since);
    assert!(sent.len() == 1 && sent[0].starts_with("3E01"), "{sent:?}");
}

#[test]
fn a_stop_takes_back_what_waits_and_goes_before_it() {
    for axis in [0, 1] {
        let (mut rig, _) = two_that_move();
        one_waits(&mut rig);
        let since = rig.now_us;
        rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(axis) }));
        assert_eq!(rig.behind_reply(), None);
        // A stop waits for 1 ms of the window.
        rig.run(1_100);
        let stop = format!("3E0{}0881", axis + 1);
        let sent = rig.sent_since(2, since);
        assert!(sent.first().is_some_and(|text| text.starts_with(&stop)), "{sent:?}");
    }
}

#[test]
fn a_newer_setpoint_takes_the_place_of_the_one_that_waits() {
    let (mut rig, moving) = two_that_move();
    one_waits(&mut rig);
    let (axis, epoch) = moving[0];
    let newer = Setpoint::Velocity { velocity_rad_s: 2.0 };
    let request = bench::axis_setpoint(&rig, axis, epoch, bench::TTL_US, newer);
    rig.ask(request).unwrap();
    let since = rig.now_us;
    rig.instead(|_| Instead::AsUsual);
    rig.run(WINDOW_US + 1_000);
    // 2 rad/s are 11459 hundredths of a degree a second: C3 2C.
    let setpoints = rig.sent_since(2, since);
    let to_it: Vec<&&str> = setpoints.iter().filter(|text| text.starts_with("3E0108A2")).collect();
    assert!(to_it.iter().all(|text| text.contains("C32C0000")) && !to_it.is_empty(), "{to_it:?}");
}

/// Its expiry is a stop.
#[test]
fn a_setpoint_that_expires_while_it_waits_is_taken_back() {
    let (mut rig, _) = two_that_move();
    let ends_us = rig.now_us + bench::TTL_US;
    rig.instead(|text| match text.starts_with("3E02") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    rig.run(bench::TTL_US + 10_000);
    let moves = |text: &&str| text.starts_with("3E0108A2") || text.starts_with("3E0208A2");
    let late: Vec<&str> = rig.sent_since(2, ends_us).into_iter().filter(moves).collect();
    assert_eq!(late, [""; 0]);
    for axis in [0, 1] {
        assert!(matches!(bench::listed(&mut rig, axis), AxisState::Tripped { .. }));
    }
}

/// A byte of noise in each exchange: the port counts in vain, and gives each frame back.
#[test]
fn a_poll_that_is_given_back_is_the_next_one_again() {
    const AXES: u8 = 6;
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    bench::configure_bus(&mut rig, 2, 2_000_000, &[Protocol::Rmd]);
    for axis in 0..AXES {
        bench::configure_axis(&mut rig, axis, 2, Protocol::Rmd, axis + 1, StopAction::Hold);
        bench::parameter(&mut rig, axis, AxisParameter::StatePollUs, Value::Unsigned(10_000));
    }
    let moving: Vec<(u8, u32)> = (0..AXES).map(|axis| (axis, arm_axis(&mut rig, axis))).collect();
    let mut longest_us = Vec::new();
    for echo in [Echo::Clean, Echo::BehindNoise] {
        rig.echo = echo;
        let since = rig.now_us;
        keep_moving(&mut rig, &moving, VELOCITY, 8_000_000);
        let gaps = (1..=AXES).map(|node| rig.longest_gap_us(2, since, &format!("3E0{node}08B1")));
        longest_us.push(gaps.max().unwrap());
    }
    assert!(longest_us[1] < longest_us[0] * 3 / 2, "{longest_us:?}");
}

/// The port has begun it and lost it: no longer than any other it keeps a stop from the line.
#[test]
fn a_frame_that_has_begun_behind_a_reply_and_never_leaves_is_given_up_as_any_other() {
    let (mut rig, _) = two_that_move();
    one_waits(&mut rig);
    let reply = unhex(&rig.wire.last().unwrap().2);
    rig.handle(Event::SerialReceived { bus: 2, bytes: &reply, then: Then::Frame });
    let since = rig.now_us;
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
    rig.run(40_000);
    let stop = rig.wire.iter().find(|(at, _, text)| *at >= since && text.starts_with("3E010881"));
    assert!(stop.is_some_and(|(at, ..)| at - since < 26_000), "{stop:?}");
}
