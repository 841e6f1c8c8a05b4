//! An RMD that holds, or whose load its brake is to take over, hears something in time, whatever goes
//! before: its own timeout would let the load go.

use crate::bench::{
    self, VELOCITY, arm, arm_axis, configure_axis, disarm, hello, keep_moving, listed, parameter,
    provision, run_with_host,
};
use crate::motors::{self, Shared};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Protocol, ProtocolSet, Request, StopAction, Value, requests,
};
use std::cell::Cell;
use std::rc::Rc;

/// Bus 0 carries RMDs and thrusters, and awaits replies for so long.
fn may_have_thrusters(rig: &mut Rig, reply_window_us: u32) {
    let bus = requests::ConfigureBus {
        bus: 0,
        bitrate: 1_000_000,
        protocols: ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]),
        exclusive: false,
        reply_window_us,
    };
    rig.ask(Request::ConfigureBus(bus)).unwrap();
}

/// RMD node 1, told a timeout of its own, and thruster nodes 0x0B and on, on CAN bus 0. The
/// thrusters are mute where `play` says so.
fn rmd_and_thrusters(thrusters: u8, timeout_ms: u32, reply_window_us: u32) -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), Shared::default());
    let (mut rmd, mute) = (motors::rmd(Shared::default()), play.clone());
    rig.motor = Box::new(move |now, bus, text| {
        let (id, data) = text.split_once('#')?;
        let id = u16::from_str_radix(id, 16).ok()?;
        match id {
            0x301..=0x37F if mute.borrow().mute => None,
            0x301..=0x37F => Some(format!("{:03X}#{data:0<16}", id - 0x80)),
            _ => rmd(now, bus, text),
        }
    });
    hello(&mut rig);
    may_have_thrusters(&mut rig, reply_window_us);
    configure_axis(&mut rig, 0, 0, Protocol::Rmd, 1, StopAction::Hold);
    for axis in 1..=thrusters {
        configure_axis(&mut rig, axis, 0, Protocol::Thruster, 0x0A + axis, StopAction::Coast);
    }
    provision(&mut rig, timeout_ms).unwrap();
    (rig, play)
}

/// Ten stops of each, and the time for their replies, bar all else from the bus: 200 ms.
#[test]
fn a_motor_holds_while_four_thrusters_that_are_mute_are_stopped() {
    let (mut rig, play) = rmd_and_thrusters(4, 160, 20_000);
    arm(&mut rig);
    disarm(&mut rig);
    for axis in 1..=4 {
        arm_axis(&mut rig, axis);
    }
    run_with_host(&mut rig, 200_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    let since = rig.now_us - 50_000;
    play.borrow_mut().mute = true;
    rig.send(&Request::ReleaseAuthority(requests::ReleaseAuthority {}));
    run_with_host(&mut rig, 400_000);
    let gap = rig.longest_gap_us(0, since, "141#");
    assert!(gap < 160_000, "its own timeout has let the load go: {gap} µs");
}

/// The same bars its polls.
#[test]
fn the_fault_word_of_an_armed_motor_is_read_while_four_thrusters_that_are_mute_are_stopped() {
    let (mut rig, play) = rmd_and_thrusters(4, 500, 20_000);
    for axis in 0..=4 {
        arm_axis(&mut rig, axis);
    }
    run_with_host(&mut rig, 200_000);
    let since = rig.now_us - 150_000;
    play.borrow_mut().mute = true;
    (1..=4).for_each(|axis| bench::disarm_axis(&mut rig, axis));
    run_with_host(&mut rig, 400_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Armed);
    let gap = rig.longest_gap_us(0, since, "141#9A");
    assert!(gap < 130_000, "{gap} µs");
}

/// The motor holds by its stop until its brake is locked, and lets go before.
#[test]
fn a_brake_is_locked_in_time_while_four_thrusters_that_are_mute_are_stopped() {
    let (mut rig, play) = rmd_and_thrusters(4, 750, 100_000);
    let brake = Value::Unsigned(u32::from(StopAction::Brake.number()));
    parameter(&mut rig, 0, AxisParameter::StopAction, brake);
    for axis in 0..=4 {
        arm_axis(&mut rig, axis);
    }
    run_with_host(&mut rig, 100_000);
    let since = rig.now_us - 50_000;
    play.borrow_mut().mute = true;
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 3_000_000);
    let locked = rig.wire.iter().find(|(at, _, text)| *at > since && text.starts_with("141#78"));
    let locked_at = locked.expect("it is told to lock its brake").0;
    let heard = rig
        .wire
        .iter()
        .filter(|(at, _, text)| (since..=locked_at).contains(at) && text.starts_with("141#"));
    let heard: Vec<u64> = heard.map(|(at, ..)| *at).collect();
    let gap = heard.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
    assert!(gap < 750_000, "its own timeout has let the load go: {gap} µs");
}

/// The steps of the arming are barred for 250 ms, and the polls that keep it holding are not sent.
#[test]
fn a_motor_that_holds_is_armed_while_another_stop_cannot_leave() {
    let (mut rig, _) = rmd_and_thrusters(1, 100, 5_000);
    arm_axis(&mut rig, 1);
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 200_000);
    // Loses to the RMD and wins against the thruster.
    rig.babble(Some(0x2F0));
    let since = rig.now_us;
    bench::disarm_axis(&mut rig, 1);
    rig.run(20_000);
    rig.send(&Request::Arm(requests::Arm { axis: 0 }));
    run_with_host(&mut rig, 400_000);
    let gap = rig.longest_gap_us(0, since, "141#");
    assert!(gap < 100_000, "its own timeout has let the load go: {gap} µs");
}

/// Stops that were missed take turns with what it must hear, however they come together.
#[test]
fn a_motor_holds_while_others_fall_silent_one_after_the_other() {
    for (count, reply_window_us) in [(5, 5_000), (6, 20_000), (8, 5_000), (14, 3_000)] {
        for apart_us in [0, 1_250, 6_800, 20_000] {
            assert_holds_while_others_fall_silent(count, reply_window_us, apart_us);
        }
    }
}

fn assert_holds_while_others_fall_silent(count: u8, reply_window_us: u32, apart_us: u64) {
    let mut rig = bench::rmd_axes(count);
    may_have_thrusters(&mut rig, reply_window_us);
    let refused = provision(&mut rig, 20);
    let Err(Error::MotorTimeoutTooShort { least_ms, .. }) = refused else { panic!("{refused:?}") };
    provision(&mut rig, least_ms).unwrap();
    arm(&mut rig);
    disarm(&mut rig);
    let others: Vec<_> = (1..count).map(|axis| (axis, arm_axis(&mut rig, axis))).collect();
    keep_moving(&mut rig, &others, VELOCITY, 100_000);
    let since = rig.now_us - 50_000;
    let last_mute = Rc::new(Cell::new(0x141));
    let last = last_mute.clone();
    rig.instead(move |text| match u16::from_str_radix(&text[..3], 16) {
        Ok(id) if (0x142..=last.get()).contains(&id) => Instead::Nothing,
        _ => Instead::AsUsual,
    });
    for id in 0x142..=0x140 + u16::from(count) {
        last_mute.set(id);
        keep_moving(&mut rig, &others, VELOCITY, apart_us);
    }
    keep_moving(&mut rig, &others, VELOCITY, 500_000);
    let gap = rig.longest_gap_us(0, since, "141#");
    let within = u64::from(least_ms) * 1_000;
    assert!(gap < within, "{count} motors, {apart_us} µs apart: {gap} µs of {within}");
}

/// What takes its turn waits behind a frame that leaves, and not behind one that cannot.
#[test]
fn stops_that_take_turns_pass_one_that_cannot_leave() {
    let (mut rig, _) = rmd_and_thrusters(1, 160, 5_000);
    arm(&mut rig);
    arm_axis(&mut rig, 1);
    rig.instead(|_| Instead::Nothing);
    bench::e_stop(&mut rig);
    rig.run(16_000);
    // Loses to the RMD and wins against the thruster.
    rig.babble(Some(0x2F0));
    let since = rig.now_us;
    rig.run(60_000);
    let left: Vec<&str> = rig
        .left
        .iter()
        .filter(|(at, ..)| *at >= since + 8_000)
        .map(|(.., text)| text.as_str())
        .collect();
    assert!(left.len() > 3 && left.iter().all(|text| text.starts_with("141#81")), "{left:?}");
}
