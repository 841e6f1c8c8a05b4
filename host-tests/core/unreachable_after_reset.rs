//! A reset while a motor is unreachable, and what is known of its own timeout afterwards
//! (GUARANTEES G1, G4, G6).

use crate::bench::{
    self, HOLD, VELOCITY, clear, e_stop, listed, move_axis, parameter, provision, run_with_host,
    state,
};
use crate::motors::Shared;
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, MotorTimeout, Reply, Request, Setpoint, StopAction, Value,
    requests,
};

const TIMEOUT_MS: u32 = 400;
/// Of a motor that does not answer.
const SILENCE_US: u64 = 500_000;
/// The two stops between silences.
const BOTH_US: u64 = 20_000;
/// The data of a thruster's stop.
const THRUSTER_STOP: &str = "30B#5443000000000000";

fn arm(rig: &mut Rig) -> Result<Reply, Error> {
    rig.ask(Request::Arm(requests::Arm { axis: 0 }))
}

/// With a timeout that was told to the motor, and that arming wants to know.
fn provisioned((mut rig, play): (Rig, Shared)) -> (Rig, Shared) {
    parameter(&mut rig, 0, AxisParameter::AllowUnknownMotorTimeout, Value::Bool(false));
    provision(&mut rig, TIMEOUT_MS).unwrap();
    (rig, play)
}

/// Its motor has fallen silent in motion and confirmed no stop.
fn unreachable((mut rig, play): (Rig, Shared), setpoint: Setpoint) -> (Rig, Shared) {
    move_axis(&mut rig, setpoint);
    play.borrow_mut().mute = true;
    bench::assert_becomes_unreachable(&mut rig);
    assert!(!rig.gateway.enable_output());
    (rig, play)
}

fn unreachable_rmd() -> (Rig, Shared) {
    unreachable(provisioned(bench::rmd(StopAction::Hold)), VELOCITY)
}

/// Resets the gateway, whose enable output must be inactive from the start.
fn reset(rig: &mut Rig) {
    rig.reset();
    assert!(!rig.gateway.enable_output());
}

/// When each frame on bus 0 went out; all of them are `stop`.
fn stops(rig: &Rig, stop: &str) -> Vec<u64> {
    rig.wire
        .iter()
        .map(|(at, bus, text)| (*bus, text.as_str(), *at))
        .map(|(bus, text, at)| {
            assert_eq!((bus, text), (0, stop), "at {at}");
            at
        })
        .collect()
}

/// Two stops at once, and then two after each silence.
fn assert_rhythm(rig: &Rig, stop: &str) {
    let times = stops(rig, stop);
    let pairs: Vec<_> = times.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    assert!(pairs.len() >= 3 && pairs[0].0 < 1_000, "{times:?}");
    assert!(pairs.iter().all(|(first, second)| second - first < BOTH_US), "{times:?}");
    let silences: Vec<_> = pairs.windows(2).map(|two| two[1].0 - two[0].1).collect();
    assert!(silences.iter().all(|silence| silence.abs_diff(SILENCE_US) < BOTH_US), "{silences:?}");
}

#[test]
fn a_stop_that_is_confirmed_after_the_reset_ends_it() {
    let (mut rig, play) = unreachable_rmd();
    reset(&mut rig);
    bench::hello(&mut rig);
    play.borrow_mut().mute = false;
    run_with_host(&mut rig, 1_000_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    assert!(rig.gateway.enable_output());
    clear(&mut rig).unwrap();
    rig.reset();
    assert!(rig.gateway.enable_output());
}

#[test]
fn the_unsafe_clearing_ends_it_after_the_reset_too() {
    let (mut rig, _) = unreachable_rmd();
    reset(&mut rig);
    bench::hello(&mut rig);
    rig.ask(Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 })).unwrap();
    assert!(rig.gateway.enable_output());
    rig.reset();
    assert!(rig.gateway.enable_output());
}

#[test]
fn an_e_stop_after_the_reset_is_sent_and_ends_nothing() {
    let (mut rig, _) = unreachable_rmd();
    reset(&mut rig);
    bench::hello(&mut rig);
    rig.run(100_000);
    let since = rig.now_us;
    e_stop(&mut rig);
    assert_eq!(rig.sent_since(0, since), [HOLD]);
    rig.run(3_000_000);
    assert!(!rig.gateway.enable_output());
}

#[test]
fn what_an_rmd_was_told_is_believed_after_a_reset() {
    let (mut rig, _) = provisioned(bench::rmd(StopAction::Hold));
    for _ in 0..2 {
        rig.reset();
        bench::hello(&mut rig);
        run_with_host(&mut rig, 50_000);
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Written { timeout_ms: TIMEOUT_MS });
    }
    arm(&mut rig).unwrap();
}

#[test]
fn what_a_thruster_was_told_is_told_again_when_it_is_armed() {
    let signal = Setpoint::Signal { fraction: 0.1 };
    let (mut rig, play) = unreachable(provisioned(bench::thruster()), signal);
    reset(&mut rig);
    rig.run(2_500_000);
    assert_rhythm(&rig, THRUSTER_STOP);
    // Its manual does not say that it keeps the time without power.
    play.borrow_mut().mute = false;
    bench::hello(&mut rig);
    run_with_host(&mut rig, 1_000_000);
    clear(&mut rig).unwrap();
    assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown);
    let since = rig.now_us;
    arm(&mut rig).unwrap();
    assert!(rig.sent_since(0, since).contains(&"30B#5354000000000190"));
    assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Written { timeout_ms: TIMEOUT_MS });
}

#[test]
fn what_the_motor_has_not_confirmed_is_not_known_with_or_without_a_reset() {
    let (mut rig, _) = provisioned(bench::rmd(StopAction::Hold));
    rig.instead(
        |text| if text.starts_with("141#B3") { Instead::Nothing } else { Instead::AsUsual },
    );
    // It may have taken it, or not.
    assert!(matches!(provision(&mut rig, 300), Err(Error::NoReply { axis: 0, .. })));
    assert_eq!(arm(&mut rig), Err(Error::MotorTimeoutUnknown { axis: 0 }));
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(arm(&mut rig), Err(Error::MotorTimeoutUnknown { axis: 0 }));
}

#[test]
fn what_was_told_to_another_motor_is_not_known_after_a_reset() {
    let (mut rig, _) = provisioned(bench::rmd(StopAction::Hold));
    parameter(&mut rig, 0, AxisParameter::Node, Value::Unsigned(2));
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(arm(&mut rig), Err(Error::MotorTimeoutUnknown { axis: 0 }));
}
