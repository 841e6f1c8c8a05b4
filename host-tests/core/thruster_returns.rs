//! A thruster whose VM is set: what it returns for TC and VC instead of the echo (Thruster manual
//! §2.4).

use crate::bench::{self, arm, run_with_host, setpoint, state};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, NoReplyHint, Reply, Request, Setpoint, TripReason, Value,
    requests,
};

/// §2.4, frame 1: 1000 rpm, 24.0 V, 1.0 A.
const MOTION: &str = "28B#540103E800F0000A";
/// The same at rest.
const AT_REST: &str = "28B#5401000000F00000";
/// §2.4, the same of a VC.
const OF_SPEED: &str = "28B#5601000000F00000";
/// §2.4, frame 2: no fault, 30 °C, 40 °C.
const CONDITION: &str = "28B#54020000001E0028";
/// §2.4, without a header: 0 rpm, 24.0 V, 0 A, status 0.
const HEADERLESS: &str = "28B#000000F000000000";
const SIGNAL: Setpoint = Setpoint::Signal { fraction: 0.2 };
const TTL_US: u64 = 80_000;

/// An axis that says bytes 6 and 7 of its device's VM, and a device that answers TC and VC so.
fn thruster(return_mode: u32, tc: &'static str, vc: &'static str) -> Rig {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::ReturnMode, Value::Unsigned(return_mode));
    rig.instead(move |text| match text.get(..8) {
        Some("30B#5443") => Instead::Says(tc),
        Some("30B#5643") => Instead::Says(vc),
        _ => Instead::AsUsual,
    });
    rig
}

fn try_arm(rig: &mut Rig) -> Result<Reply, Error> {
    rig.ask(Request::Arm(requests::Arm { axis: 0 }))
}

const NO_REPLY: Result<Reply, Error> = Err(Error::NoReply { axis: 0, hint: NoReplyHint::None });

#[test]
fn a_returned_frame_acknowledges_and_tells_speed_voltage_and_current() {
    let mut rig = thruster(0x0001, MOTION, OF_SPEED);
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, TTL_US, SIGNAL);
    rig.ask(request).unwrap();
    rig.run(10_000);
    assert!(rig.left.iter().any(|(_, bus, text)| *bus == 0 && text == "30B#5443000000000014"));
    let seen = state(&mut rig);
    assert_eq!(seen.state, AxisState::Active);
    bench::stop(&mut rig);
    rig.run(20_000);
    assert!(bench::outcomes(&rig).iter().any(|event| event.name() == "StopConfirmed"));
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
}

#[test]
fn a_value_beyond_a_limit_in_a_returned_frame_trips() {
    let mut rig = thruster(0x0001, MOTION, OF_SPEED);
    // 1000 rpm are 104.7 rad/s.
    bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(90.0));
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, TTL_US, SIGNAL);
    rig.ask(request).unwrap();
    rig.run(2_000);
    let reason = state(&mut rig).trip.map(|trip| trip.reason);
    assert!(matches!(reason, Some(TripReason::LimitExceeded { .. })), "{reason:?}");
}

#[test]
fn vc_is_acknowledged_by_its_own_header_only() {
    for (vc, armed) in [(OF_SPEED, true), (AT_REST, false)] {
        let mut rig = thruster(0x0001, AT_REST, vc);
        let epoch = arm(&mut rig);
        // 300 rpm
        bench::keep_moving(
            &mut rig,
            &[(0, epoch)],
            Setpoint::Velocity { velocity_rad_s: 31.42 },
            300_000,
        );
        let reason = state(&mut rig).trip.map(|trip| trip.reason);
        assert_eq!(reason, (!armed).then_some(TripReason::MotorSilent), "{vc}");
    }
}

/// With several frames for one command, the lowest that VM asks for acknowledges and no other: it
/// comes once for each command.
#[test]
fn one_frame_of_several_acknowledges() {
    for (mode, frame, arms) in [
        (0x0001, CONDITION, false),
        (0x0003, AT_REST, true),
        (0x0003, CONDITION, false),
        (0x0006, CONDITION, true),
        (0x0004, "28B#5403000000000000", true),
        (0x0007, "28B#5403000000000000", false),
    ] {
        let mut rig = thruster(mode, frame, OF_SPEED);
        let result = try_arm(&mut rig);
        if arms {
            assert!(result.is_ok(), "{mode:#06x}")
        } else {
            assert_eq!(result, NO_REPLY, "{mode:#06x}")
        }
    }
}

#[test]
fn a_frame_that_the_axis_does_not_expect_acknowledges_nothing() {
    for frame in [AT_REST, HEADERLESS] {
        let mut rig = thruster(0, frame, OF_SPEED);
        assert_eq!(try_arm(&mut rig), NO_REPLY, "{frame}");
    }
    let mut rig = thruster(0x0001, HEADERLESS, OF_SPEED);
    assert_eq!(try_arm(&mut rig), NO_REPLY);
}

/// A device that echoes all the same says more than one that returns frames.
#[test]
fn the_echo_acknowledges_in_every_mode() {
    for mode in [0x0001, 0x0007, 0x0200] {
        let (mut rig, _) = bench::thruster();
        bench::parameter(&mut rig, 0, AxisParameter::ReturnMode, Value::Unsigned(mode));
        arm(&mut rig);
    }
}

#[test]
fn a_frame_without_header_is_read_only_while_tc_or_vc_waits() {
    let mut rig = thruster(0x0200, HEADERLESS, HEADERLESS);
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, TTL_US, SIGNAL);
    rig.ask(request).unwrap();
    rig.run(5_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Active);
    // 1000 rpm and a stall (bit 6) that nobody asked for: eight bytes without a name.
    rig.receive(0, "28B#03E800F0000A0040");
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Active);
    // The same in answer to a signal: the status word is that of EF.
    rig.instead(|text| match text.get(..8) {
        Some("30B#5443") => Instead::Says("28B#03E800F0000A0040"),
        _ => Instead::AsUsual,
    });
    rig.run(30_000);
    assert_eq!(
        state(&mut rig).trip.map(|trip| trip.reason),
        Some(TripReason::MotorFault { faults: 0x40 })
    );
}

#[test]
fn the_late_answer_to_a_query_is_not_taken_for_a_frame_without_header() {
    // QV −5 rpm comes in answer to TC (§2.1): its first bytes would be 20 822 rpm.
    let mut rig = thruster(0x0200, "28B#515600000000FFFB", HEADERLESS);
    assert_eq!(try_arm(&mut rig), NO_REPLY);
}

#[test]
fn a_refusal_is_one_in_every_mode() {
    for mode in [0x0001, 0x0200] {
        let (mut rig, play) = bench::thruster();
        bench::parameter(&mut rig, 0, AxisParameter::ReturnMode, Value::Unsigned(mode));
        let epoch = arm(&mut rig);
        play.borrow_mut().refuses = true;
        let request = setpoint(&rig, epoch, TTL_US, SIGNAL);
        rig.ask(request).unwrap();
        rig.run(5_000);
        let reason = state(&mut rig).trip.map(|trip| trip.reason);
        assert!(
            matches!(reason, Some(TripReason::CommandRefused { .. })),
            "{mode:#06x} {reason:?}"
        );
    }
}

/// A returned frame does not say the value that was taken: while that of a signal is due, none
/// acknowledges a stop.
#[test]
fn the_frames_of_a_signal_do_not_acknowledge_the_stop_that_follows() {
    for (mode, frame) in [(0x0001, MOTION), (0x0200, "28B#03E800F0000A0000")] {
        let mut rig = thruster(mode, AT_REST, OF_SPEED);
        rig.instead(move |text| match text {
            _ if mode == 0x0200 && text.starts_with("30B#5443") => Instead::Says(HEADERLESS),
            _ => Instead::AsUsual,
        });
        let epoch = arm(&mut rig);
        rig.instead(
            |text| if text.starts_with("30B#5443") { Instead::Nothing } else { Instead::AsUsual },
        );
        let request = setpoint(&rig, epoch, TTL_US, SIGNAL);
        rig.ask(request).unwrap();
        rig.run(300);
        rig.send(&Request::EStop(requests::EStop {}));
        rig.run(300);
        assert!(
            rig.left.iter().any(|(_, _, text)| text == "30B#5443000000000014"),
            "{:?}",
            rig.left
        );
        assert_eq!(rig.left.last().map(|(_, _, text)| text.as_str()), Some("30B#5443000000000000"));
        // Twice: one may be that of a signal that was given up long before.
        rig.receive(0, frame);
        rig.receive(0, frame);
        assert!(!state(&mut rig).stop_acknowledged, "{mode:#06x}");
        run_with_host(&mut rig, 40_000);
        assert_eq!(
            bench::listed(&mut rig, 0),
            AxisState::Tripped { confirmed: false },
            "{mode:#06x}"
        );
        // Nothing older is due any more: from here on one frame acknowledges.
        rig.instead(move |text| {
            if text.starts_with("30B#5443") { Instead::Says(frame) } else { Instead::AsUsual }
        });
        run_with_host(&mut rig, 200_000);
        assert_eq!(
            bench::listed(&mut rig, 0),
            AxisState::Tripped { confirmed: true },
            "{mode:#06x}"
        );
    }
}

#[test]
fn a_device_that_returns_nothing_is_not_armed() {
    for mode in [0x0100, 0x0101, 0x0300] {
        let mut rig = thruster(mode, AT_REST, OF_SPEED);
        assert_eq!(try_arm(&mut rig), Err(Error::CannotConfirm { axis: 0 }), "{mode:#06x}");
    }
}

/// §2.4: bits 2 to 7 of byte 6 and 3 to 7 of byte 7 are reserved.
#[test]
fn a_mode_with_reserved_bits_is_refused() {
    let (mut rig, _) = bench::thruster();
    for mode in [0x0008, 0x0080, 0x0208] {
        let value = Value::Unsigned(mode);
        let parameter = AxisParameter::ReturnMode.number();
        let result =
            rig.ask(Request::ConfigureAxis(requests::ConfigureAxis { axis: 0, parameter, value }));
        assert!(matches!(result, Err(Error::OutOfRange { .. })), "{mode:#06x} {result:?}");
    }
}

/// The row of the axis.
fn return_mode(rig: &mut Rig) -> Option<Value> {
    let parameter = AxisParameter::ReturnMode.number();
    match rig.ask(Request::ReadAxisParameter(requests::ReadAxisParameter { axis: 0, parameter })) {
        Ok(Reply::ReadAxisParameter(read)) => read.value,
        other => panic!("{other:?}"),
    }
}

/// A device that is told a VM answers TC by `tc` from then on.
fn told(vm: &str, tc: &'static str) -> (Rig, Result<Reply, Error>) {
    let (mut rig, _) = bench::thruster();
    let mut is_told = false;
    rig.instead(move |text| {
        is_told |= text.starts_with("30B#564D");
        if is_told && text.starts_with("30B#5443") { Instead::Says(tc) } else { Instead::AsUsual }
    });
    let request = bench::native(&rig, 0, vm);
    let told = rig.ask(request);
    (rig, told)
}

#[test]
fn a_native_vm_that_the_device_takes_is_that_of_the_axis() {
    for (vm, tc, mode) in [
        ("564D000000000001", AT_REST, 0x0001),
        ("564D000000000007", AT_REST, 0x0007),
        ("564D000000000002", CONDITION, 0x0002),
        ("564D000000000200", HEADERLESS, 0x0200),
    ] {
        let (mut rig, told) = told(vm, tc);
        assert!(told.is_ok(), "{vm} {told:?}");
        assert_eq!(return_mode(&mut rig), Some(Value::Unsigned(mode)));
        bench::stop(&mut rig);
        rig.run(500_000);
        assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle, "{vm}");
        arm(&mut rig);
    }
}

#[test]
fn a_native_vm_after_which_no_stop_could_be_confirmed_is_not_sent() {
    for vm in ["564D000000000100", "564D000000000107", "564D000000000300"] {
        let (mut rig, told) = told(vm, AT_REST);
        assert_eq!(told, Err(Error::CannotConfirm { axis: 0 }), "{vm}");
        assert!(!rig.left.iter().any(|(_, _, text)| text.starts_with("30B#564D")), "{vm}");
        assert_eq!(return_mode(&mut rig), Some(Value::Unsigned(0)), "{vm}");
    }
}

/// Whether the device has taken it is not known then.
#[test]
fn a_native_vm_that_is_not_answered_changes_nothing_of_the_axis() {
    let (mut rig, play) = bench::thruster();
    play.borrow_mut().mute = true;
    let request = bench::native(&rig, 0, "564D000000000001");
    assert_eq!(rig.ask(request), NO_REPLY);
    assert_eq!(return_mode(&mut rig), Some(Value::Unsigned(0)));
    play.borrow_mut().mute = false;
    arm(&mut rig);
}
