//! What is known of the motor's own timeout, and what takes it away (GUARANTEES G1).

use crate::bench::{self, native, parameter, provision, run_with_host, state};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, Error, MotorTimeout, NoReplyHint, Protocol, Reply, Request, StopAction, Value,
    requests,
};

const ST_400: &str = "30B#5354000000000190";
const KNOWN: MotorTimeout = MotorTimeout::Written { timeout_ms: 400 };

fn arm(rig: &mut Rig) -> Result<MotorTimeout, Error> {
    match rig.ask(Request::Arm(requests::Arm { axis: 0 })) {
        Ok(Reply::Arm(armed)) => {
            bench::disarm(rig);
            run_with_host(rig, 100_000);
            Ok(armed.motor_timeout)
        }
        other => Err(other.unwrap_err()),
    }
}

/// What arming says where only an unknown timeout is allowed, and where only none at all is.
fn arm_allowing(rig: &mut Rig, unknown: bool, none: bool) -> Result<MotorTimeout, Error> {
    parameter(rig, 0, AxisParameter::AllowUnknownMotorTimeout, Value::Bool(unknown));
    parameter(rig, 0, AxisParameter::AllowNoMotorTimeout, Value::Bool(none));
    arm(rig)
}

#[test]
fn off_and_unknown_have_each_a_permission_of_its_own() {
    let unknown = Err(Error::MotorTimeoutUnknown { axis: 0 });
    let off = Err(Error::MotorTimeoutOff { axis: 0 });
    for mut rig in [bench::rmd(StopAction::Hold).0, bench::thruster().0] {
        assert_eq!(arm_allowing(&mut rig, false, true), unknown);
        assert_eq!(arm_allowing(&mut rig, true, false), Ok(MotorTimeout::Unknown));
        provision(&mut rig, 0).unwrap();
        assert_eq!(arm_allowing(&mut rig, true, false), off);
        assert_eq!(arm_allowing(&mut rig, false, true), Ok(MotorTimeout::Off));
        provision(&mut rig, 400).unwrap();
        assert_eq!(arm_allowing(&mut rig, false, false), Ok(KNOWN));
    }
    let (mut rig, _) = bench::d5();
    assert_eq!(arm_allowing(&mut rig, false, false), Ok(MotorTimeout::Verified));
    provision(&mut rig, 0).unwrap();
    assert_eq!(arm_allowing(&mut rig, true, false), off);
    assert_eq!(arm_allowing(&mut rig, false, true), Ok(MotorTimeout::Off));
}

#[test]
fn a_timeout_that_cannot_act_within_60_s_counts_as_off() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    provision(&mut rig, 60_000).unwrap();
    assert_eq!(
        arm_allowing(&mut rig, false, false),
        Ok(MotorTimeout::Written { timeout_ms: 60_000 })
    );
    for too_long in [60_001, u32::MAX] {
        provision(&mut rig, too_long).unwrap();
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Off);
        assert_eq!(arm_allowing(&mut rig, true, false), Err(Error::MotorTimeoutOff { axis: 0 }));
    }
}

/// A motor without a timeout is none whose timeout is not known: the one permission is not the
/// other's.
#[test]
fn a_timeout_that_is_off_is_off_after_a_reset_of_the_gateway_as_well() {
    let motors = [(bench::rmd(StopAction::Hold).0, &[0, 60_001][..]), (bench::thruster().0, &[0])];
    for (mut rig, as_good_as_none) in motors {
        for off in as_good_as_none.iter().copied() {
            provision(&mut rig, 400).unwrap();
            provision(&mut rig, off).unwrap();
            rig.reset();
            bench::hello(&mut rig);
            run_with_host(&mut rig, 50_000);
            assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Off);
            let refused = Err(Error::MotorTimeoutOff { axis: 0 });
            assert_eq!(arm_allowing(&mut rig, true, false), refused);
        }
        provision(&mut rig, 400).unwrap();
        rig.reset();
        bench::hello(&mut rig);
        run_with_host(&mut rig, 50_000);
        assert_ne!(state(&mut rig).motor_timeout, MotorTimeout::Off);
    }
}

/// RMD V3.6 §2.30, thruster manual §2.2: the motor may have carried out what it did not answer.
#[test]
fn a_timeout_whose_end_is_not_answered_counts_as_off() {
    for (mut rig, write) in
        [(bench::rmd_with_timeout(400).0, "141#B3"), (bench::thruster().0, "30B#5354")]
    {
        rig.instead(
            move |text| if text.starts_with(write) { Instead::Nothing } else { Instead::AsUsual },
        );
        assert!(provision(&mut rig, 0).is_err());
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Off);
        assert_eq!(arm_allowing(&mut rig, true, false), Err(Error::MotorTimeoutOff { axis: 0 }));
    }
}

#[test]
fn a_thruster_that_was_silent_for_1_s_is_told_again_when_it_is_armed() {
    let (mut rig, _) = bench::thruster();
    provision(&mut rig, 400).unwrap();
    run_with_host(&mut rig, 990_000);
    assert_eq!(state(&mut rig).motor_timeout, KNOWN);
    run_with_host(&mut rig, 1_010_000);
    assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown);
    // It has been heard since, which brings nothing back.
    assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown);
    let since = rig.now_us;
    assert_eq!(arm_allowing(&mut rig, false, false), Ok(KNOWN));
    let sent = rig.sent_since(0, since);
    assert_eq!(
        sent[..6],
        [
            "30B#45460000",
            "30B#46520000",
            "30B#5443000000000000",
            ST_400,
            "30B#45460000",
            "30B#51560000"
        ]
    );
    // Not so a motor that keeps the time without power.
    let (mut rig, _) = bench::rmd_with_timeout(400);
    run_with_host(&mut rig, 3_000_000);
    assert_eq!(state(&mut rig).motor_timeout, KNOWN);
}

/// Thruster manual §2.3: whether it keeps the 0 that it was told without power is not printed. Who
/// allows an unknown timeout alone arms none that may be off.
#[test]
fn a_thruster_that_was_told_0_has_no_timeout_however_long_it_is_silent() {
    let (mut rig, _) = bench::thruster();
    provision(&mut rig, 0).unwrap();
    run_with_host(&mut rig, 3_000_000);
    assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Off);
    assert_eq!(arm_allowing(&mut rig, true, false), Err(Error::MotorTimeoutOff { axis: 0 }));
    assert_eq!(arm_allowing(&mut rig, false, true), Ok(MotorTimeout::Off));
}

#[test]
fn a_thruster_that_does_not_take_its_timeout_again_is_not_armed() {
    let answers: [(&'static str, Error); 3] = [
        // Another value: it acknowledges another request.
        ("28B#5354000000000064", Error::NoReply { axis: 0, hint: NoReplyHint::None }),
        ("", Error::NoReply { axis: 0, hint: NoReplyHint::None }),
        ("28B#535400000000EEEE", Error::Refused { axis: 0, faults: Some(0) }),
    ];
    for (answer, error) in answers {
        let (mut rig, _) = bench::thruster();
        provision(&mut rig, 400).unwrap();
        rig.instead(move |text| match (text.starts_with("30B#5354"), answer) {
            (true, "") => Instead::Nothing,
            (true, answer) => Instead::Says(answer),
            _ => Instead::AsUsual,
        });
        assert_eq!(arm(&mut rig), Err(error));
        assert!(matches!(provision(&mut rig, 300), Err(found) if found == error), "{error:?}");
    }
}

/// RMD V3.6 §2.25: a restart does not lose what §2.30 has written to ROM.
#[test]
fn a_native_restart_leaves_the_timeout_known() {
    let (mut rig, _) = bench::rmd_with_timeout(400);
    let request = native(&rig, 0, "7600000000000000");
    rig.ask(request).unwrap();
    assert_eq!(state(&mut rig).motor_timeout, KNOWN);
}

/// RMD V3.6 §2.30, §2.31, §7.3, and the D5 manual, common rows 1 and 7.
#[test]
fn what_may_have_changed_the_motor_makes_it_unknown() {
    for data in ["B3000000D0070000", "B400000000000001"] {
        let (mut rig, _) = bench::rmd_with_timeout(400);
        assert_eq!(state(&mut rig).motor_timeout, KNOWN);
        let request = native(&rig, 0, data);
        rig.ask(request).unwrap();
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown, "{data}");
    }
    for data in ["53540000000003E8", "434900000000000C", "43420000000001F4", "5350000000000001"] {
        let (mut rig, _) = bench::thruster();
        provision(&mut rig, 400).unwrap();
        let request = native(&rig, 0, data);
        let _ = rig.ask(request);
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown, "{data}");
        assert_eq!(
            arm_allowing(&mut rig, false, false),
            Err(Error::MotorTimeoutUnknown { axis: 0 }),
            "{data}"
        );
    }
    for data in ["D50B040311000023", "D50B0503030C0022"] {
        let (mut rig, _) = bench::d5();
        arm(&mut rig).unwrap();
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Verified);
        let request = native(&rig, 0, data);
        let _ = rig.ask(request);
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown, "{data}");
    }
}

/// Whoever allows an unknown one does not allow none (GUARANTEES G1).
#[test]
fn a_timeout_that_a_native_command_switches_off_is_known_to_be_off() {
    // 0 ms, 60 001 ms.
    for data in ["B300000000000000", "B300000061EA0000"] {
        let (mut rig, _) = bench::rmd_with_timeout(400);
        let request = native(&rig, 0, data);
        rig.ask(request).unwrap();
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Off, "{data}");
        let off = Err(Error::MotorTimeoutOff { axis: 0 });
        assert_eq!(arm_allowing(&mut rig, true, false), off);
        // What switches it on again is not measured by anybody.
        let request = native(&rig, 0, "B3000000D0070000");
        rig.ask(request).unwrap();
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown);
    }
    let (mut rig, _) = bench::thruster();
    provision(&mut rig, 400).unwrap();
    let request = native(&rig, 0, "5354000000000000");
    rig.ask(request).unwrap();
    assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Off);
}

/// A command that is not answered may have been heard.
#[test]
fn a_timeout_that_may_have_been_switched_off_counts_as_off() {
    let (mut rig, _) = bench::rmd_with_timeout(400);
    rig.instead(|text| if text.contains("#B3") { Instead::Nothing } else { Instead::AsUsual });
    let request = native(&rig, 0, "B300000000000000");
    rig.ask(request).unwrap_err();
    assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Off);
}

#[test]
fn another_address_is_another_motor() {
    let unknown = Err(Error::MotorTimeoutUnknown { axis: 0 });
    for (changed, value, expected) in [
        (AxisParameter::Node, 2, unknown),
        (AxisParameter::Bus, 1, unknown),
        // It is the same motor.
        (AxisParameter::Node, 1, Ok(KNOWN)),
        (AxisParameter::Bus, 0, Ok(KNOWN)),
        (AxisParameter::Protocol, Protocol::Rmd.number().into(), Ok(KNOWN)),
    ] {
        let (mut rig, _) = bench::rmd_with_timeout(400);
        bench::configure_bus(&mut rig, 1, 1_000_000, &[Protocol::Rmd]);
        parameter(&mut rig, 0, changed, Value::Unsigned(value));
        assert_eq!(arm_allowing(&mut rig, false, false), expected, "{changed:?} {value}");
    }
    for changed in [AxisParameter::D5RequestId, AxisParameter::D5ReplyId] {
        let (mut rig, _) = bench::d5();
        arm(&mut rig).unwrap();
        parameter(&mut rig, 0, changed, Value::Unsigned(0x0B));
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown, "{changed:?}");
    }
}

#[test]
fn a_motor_that_was_unreachable_may_be_another_one() {
    for (rig, after) in [
        (bench::rmd(StopAction::Hold), Err(Error::MotorTimeoutUnknown { axis: 0 })),
        // It is told again.
        (bench::thruster(), Ok(KNOWN)),
    ] {
        let (mut rig, play) = rig;
        provision(&mut rig, 400).unwrap();
        bench::arm(&mut rig);
        play.borrow_mut().mute = true;
        bench::stop(&mut rig);
        run_with_host(&mut rig, 8_000_000);
        play.borrow_mut().mute = false;
        let cleared = rig.ask(Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 }));
        assert!(cleared.is_ok(), "{cleared:?}");
        run_with_host(&mut rig, 100_000);
        assert_eq!(state(&mut rig).motor_timeout, MotorTimeout::Unknown);
        assert_eq!(arm_allowing(&mut rig, false, false), after);
    }
}

/// At level 0 the motor answers nothing, not even a reading of its switch.
#[test]
fn a_timeout_that_nothing_reads_back_is_not_verified() {
    let (mut rig, _) = bench::d5();
    let report = |timeout| {
        let report = host_protocol::replies::MotorTimeoutReport { timeout };
        Ok(Reply::ProvisionMotorTimeout(report))
    };
    assert_eq!(provision(&mut rig, 1), report(MotorTimeout::Verified));
    parameter(&mut rig, 0, AxisParameter::D5AckLevel, Value::Unsigned(0));
    rig.instead(|_| Instead::Nothing);
    assert_eq!(provision(&mut rig, 1), report(MotorTimeout::Unknown));
    assert_eq!(provision(&mut rig, 0), report(MotorTimeout::Off));
}

/// An RMD is told it behind a 0x80, and a stop comes between: it has what it had.
#[test]
fn a_timeout_that_a_stop_keeps_from_being_told_is_unknown_and_not_off() {
    for (timeout_ms, told) in [(0, false), (70_000, false), (0, true)] {
        let (mut rig, _) = bench::rmd_with_timeout(300);
        let since = rig.now_us;
        if told {
            rig.instead(|text| match text.starts_with("141#B3") {
                true => Instead::Nothing,
                false => Instead::AsUsual,
            });
        }
        let request = requests::ProvisionMotorTimeout { axis: 0, timeout_ms };
        rig.send(&Request::ProvisionMotorTimeout(request));
        rig.run(if told { 5_000 } else { 0 });
        bench::stop(&mut rig);
        run_with_host(&mut rig, 100_000);
        bench::output_off(&mut rig).unwrap();
        let was_told = rig.sent_since(0, since).iter().any(|text| text.starts_with("141#B3"));
        assert_eq!(was_told, told);
        let refused = match told {
            true => Error::MotorTimeoutOff { axis: 0 },
            false => Error::MotorTimeoutUnknown { axis: 0 },
        };
        assert_eq!(arm_allowing(&mut rig, told, !told), Err(refused), "{timeout_ms}");
    }
}

/// Whatever is to take its place: the motor has not been told it, or has not said so.
#[test]
fn a_timeout_that_is_off_is_off_until_the_motor_has_taken_another() {
    for (timeout_ms, after) in [(300, 0), (300, 5_000), (0, 0), (0, 5_000)] {
        let (mut rig, _) = bench::rmd_with_timeout(300);
        provision(&mut rig, 0).unwrap();
        rig.instead(|text| match text.starts_with("141#B3") {
            true => Instead::Nothing,
            false => Instead::AsUsual,
        });
        let request = requests::ProvisionMotorTimeout { axis: 0, timeout_ms };
        rig.send(&Request::ProvisionMotorTimeout(request));
        rig.run(after);
        bench::stop(&mut rig);
        run_with_host(&mut rig, 100_000);
        bench::output_off(&mut rig).unwrap();
        let refused = Err(Error::MotorTimeoutOff { axis: 0 });
        assert_eq!(arm_allowing(&mut rig, true, false), refused, "{timeout_ms} after {after} µs");
    }
}

/// What another motor answers.
#[derive(Clone, Copy)]
enum Told {
    Says(&'static str),
    Nothing,
}
use Told::{Nothing, Says};

/// The firmware and the model that an RMD tells: what it answers to each read instead of what the
/// one before did.
const OTHERS: [(u32, &str, Told); 7] = [
    (1, "B2", Says("241#B20000002E893401")),
    (1, "B2", Nothing),
    (1, "B5", Says("241#B558385332563131")),
    (1, "B5", Nothing),
    (6, "B50101", Says("241#B50101524D442D59")),
    (6, "B50102", Says("241#B50102342D503337")),
    (6, "B50103", Says("241#B501032D33370000")),
];

/// What an RMD can be told, ms, and what is known of it then.
const TOLD: [(u32, MotorTimeout); 2] = [(400, KNOWN), (0, MotorTimeout::Off)];

/// An RMD that was told a timeout, or none, its own dialect stated; none is allowed.
fn told(dialect: u32, timeout_ms: u32) -> Rig {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    play.borrow_mut().dialect = dialect;
    parameter(&mut rig, 0, AxisParameter::RmdDialect, Value::Unsigned(dialect));
    parameter(&mut rig, 0, AxisParameter::AllowUnknownMotorTimeout, Value::Bool(false));
    parameter(&mut rig, 0, AxisParameter::AllowNoMotorTimeout, Value::Bool(true));
    provision(&mut rig, timeout_ms).unwrap();
    rig
}

impl Told {
    /// The motor answers this to the reads that begin so.
    fn to(self, rig: &mut Rig, read: &'static str) {
        rig.instead(move |text| match (text[4..].starts_with(read), self) {
            (false, _) => Instead::AsUsual,
            (true, Says(reply)) => Instead::Says(reply),
            (true, Nothing) => Instead::Nothing,
        });
    }
}

#[test]
fn another_rmd_in_the_place_of_the_one_that_was_told_its_timeout_is_not_armed_on_it() {
    for (resets, (timeout_ms, known)) in [(false, TOLD[0]), (true, TOLD[0]), (true, TOLD[1])] {
        for (dialect, read, answer) in OTHERS {
            let mut rig = told(dialect, timeout_ms);
            assert_eq!(arm(&mut rig), Ok(known));
            if resets {
                rig.reset();
                bench::hello(&mut rig);
                run_with_host(&mut rig, 50_000);
                assert_eq!(arm(&mut rig), Ok(known));
            }
            answer.to(&mut rig, read);
            let refused = Err(Error::MotorTimeoutUnknown { axis: 0 });
            assert_eq!(arm(&mut rig), refused, "{timeout_ms} {dialect} {read}");
            // What it is told itself counts.
            run_with_host(&mut rig, 100_000);
            bench::output_off(&mut rig).unwrap();
            provision(&mut rig, timeout_ms).unwrap();
            assert_eq!(arm(&mut rig), Ok(known), "{timeout_ms} {dialect} {read}");
        }
    }
}

/// Nor because another timeout was to take its place, which the motor did not hear.
#[test]
fn another_rmd_in_the_place_of_one_without_a_timeout_has_an_unknown_one() {
    for timeout_ms in [300, 0] {
        let mut rig = told(1, 0);
        Nothing.to(&mut rig, "B3");
        assert!(provision(&mut rig, timeout_ms).is_err());
        assert_eq!(arm(&mut rig), Ok(MotorTimeout::Off));
        Says("241#B20000002E893401").to(&mut rig, "B2");
        assert_eq!(arm(&mut rig), Err(Error::MotorTimeoutUnknown { axis: 0 }), "{timeout_ms}");
    }
}

/// One answer that gets lost makes it no other motor.
#[test]
fn a_lost_answer_of_an_rmd_makes_it_no_other_one() {
    for ((timeout_ms, known), (dialect, read, _)) in
        TOLD.into_iter().flat_map(|told| OTHERS.map(|other| (told, other)))
    {
        let mut rig = told(dialect, timeout_ms);
        let mut lost = 0;
        rig.instead(move |text| {
            lost += u32::from(text[4..].starts_with(read));
            // Of the model's two reads before, for the dialect, and of this one.
            if text[4..].starts_with(read) && lost % 2 == 1 {
                Instead::Nothing
            } else {
                Instead::AsUsual
            }
        });
        assert_eq!(arm(&mut rig), Ok(known), "{timeout_ms} {dialect} {read}");
    }
}
