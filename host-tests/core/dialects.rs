//! RMD dialects (docs/rmd-dialects.md): what a motor lacks is refused by name, what differs goes
//! out in its dialect. The bytes have their sources in `host-tests/vectors/rmd-dialects.txt`.

use crate::bench::{self, VELOCITY, arm, native, parameter, setpoint};
use crate::rig::{Instead, Rig};
use host_protocol::{
    Agreement, AxisParameter, AxisState, Error, Protocol, Quantity, Reply, Request, Setpoint,
    StopAction, Value, requests,
};

/// The numbers of `rmd_dialect`.
const UNKNOWN: u32 = 0;
const V3_6: u32 = 1;
const V3_7: u32 = 2;
const V3_9: u32 = 3;
const V4_2: u32 = 4;
const V4_3: u32 = 5;
const V4_4: u32 = 6;
const ALL: [u32; 7] = [UNKNOWN, V3_6, V3_7, V3_9, V4_2, V4_3, V4_4];

fn rmd(dialect: u32, stop: StopAction) -> Rig {
    speaking(dialect, dialect, stop)
}

/// The axis states one dialect, its motor speaks another.
fn speaking(stated: u32, spoken: u32, stop: StopAction) -> Rig {
    let (mut rig, play) = bench::rmd(stop);
    play.borrow_mut().dialect = spoken;
    parameter(&mut rig, 0, AxisParameter::RmdDialect, Value::Unsigned(stated));
    rig
}

/// What the answers of a motor leave possible: V3.6 and V3.7, and V4.2 and V4.3, answer alike.
fn possible(spoken: u32) -> &'static [u32] {
    match spoken {
        V3_6 | V3_7 => &[V3_6, V3_7],
        V4_2 | V4_3 => &[V4_2, V4_3],
        V3_9 => &[V3_9],
        _ => &[V4_4],
    }
}

fn bits(dialects: &[u32]) -> u8 {
    dialects.iter().fold(0, |bits, dialect| bits | 1 << dialect)
}

/// That of the model is asked once more where the motor was told a timeout, and counts.
#[test]
fn a_contradiction_of_which_the_first_answer_was_lost_is_one() {
    let mut rig = speaking(V4_3, V4_4, StopAction::Hold);
    bench::provision(&mut rig, 400).unwrap();
    let mut asked = 0;
    rig.instead(move |text| {
        asked += u32::from(text.starts_with("141#B501"));
        let is_lost = text.starts_with("141#30") || text.starts_with("141#B501") && asked == 1;
        if is_lost { Instead::Nothing } else { Instead::AsUsual }
    });
    let possible = bits(&[V4_4]);
    let refused = Error::DialectContradicted { axis: 0, stated: 5, possible };
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(refused));
}

/// Also the default, v3_6, which nobody has stated.
#[test]
fn what_the_answers_of_its_motor_contradict_is_not_armed() {
    for stated in ALL {
        for spoken in &ALL[1..] {
            let mut rig = speaking(stated, *spoken, StopAction::Hold);
            let result = rig.ask(Request::Arm(requests::Arm { axis: 0 }));
            let possible = possible(*spoken);
            if stated == UNKNOWN || possible.contains(&stated) {
                assert!(result.is_ok(), "{stated} {spoken}: {result:?}");
                continue;
            }
            let stated = u8::try_from(stated).unwrap();
            let possible = bits(possible);
            assert_eq!(result, Err(Error::DialectContradicted { axis: 0, stated, possible }));
            assert_eq!(bench::listed(&mut rig, 0), AxisState::Holding);
        }
    }
    let (mut rig, play) = bench::rmd(StopAction::Coast);
    play.borrow_mut().dialect = V4_4;
    let refused = Error::DialectContradicted { axis: 0, stated: 1, possible: 1 << V4_4 };
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(refused));
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
}

/// Each read is asked twice; `answers` says which of the six are answered, the others are not.
fn armed_with(answers: [bool; 6], spoken: u32) -> Result<Reply, Error> {
    let mut rig = speaking(V3_6, spoken, StopAction::Hold);
    let mut asked = answers.into_iter();
    rig.instead(move |text| {
        let is_read = ["141#30", "141#B5", "141#42"].iter().any(|read| text.starts_with(read));
        match is_read.then(|| asked.next()).flatten() {
            Some(false) => Instead::Nothing,
            _ => Instead::AsUsual,
        }
    });
    rig.ask(Request::Arm(requests::Arm { axis: 0 }))
}

/// One pair of agreeing answers is enough to contradict; silence, and an answer given once, are
/// not.
#[test]
fn silence_and_single_answers_contradict_nothing() {
    let (yes, no) = (true, false);
    assert!(armed_with([no; 6], V4_4).is_ok());
    assert!(armed_with([yes, yes, yes, no, no, no], V4_4).is_ok());
    assert!(armed_with([no, no, no, yes, yes, yes], V4_4).is_ok());
    assert!(armed_with([yes, no, no, no, yes, yes], V4_4).is_ok());
    for (answers, possible) in [
        ([yes, no, no, yes, no, no], &[V4_2, V4_3, V4_4][..]),
        ([no, yes, no, no, yes, no], &[V4_4]),
        ([no, no, yes, no, no, yes], &[V3_9, V4_2, V4_3, V4_4]),
    ] {
        let possible = bits(possible);
        let refused = Error::DialectContradicted { axis: 0, stated: 1, possible };
        assert_eq!(armed_with(answers, V4_4), Err(refused));
    }
}

/// Two motors with one id, or a firmware that nobody has seen: it is unknown what it speaks.
#[test]
fn what_is_answered_in_two_ways_contradicts_every_dialect_but_unknown() {
    for stated in ALL {
        let mut rig = speaking(stated, V4_4, StopAction::Hold);
        let mut gains = 0;
        rig.instead(move |text| {
            gains += u32::from(text.starts_with("141#30"));
            match text.starts_with("141#30") && gains == 2 {
                true => Instead::Says("241#3000551955195519"),
                false => Instead::AsUsual,
            }
        });
        let result = rig.ask(Request::Arm(requests::Arm { axis: 0 }));
        if stated == UNKNOWN {
            assert!(result.is_ok(), "{result:?}");
            continue;
        }
        let stated = u8::try_from(stated).unwrap();
        let refused = Error::DialectContradicted { axis: 0, stated, possible: 0 };
        assert_eq!(result, Err(refused));
    }
}

#[test]
fn a_motor_at_rest_is_asked_what_it_speaks_and_the_answers_are_told() {
    let recognise = Request::Recognise(requests::Recognise { axis: 0 });
    let mut rig = speaking(UNKNOWN, V4_4, StopAction::Hold);
    let since = rig.now_us;
    let Ok(Reply::Recognise(told)) = rig.ask(recognise.clone()) else { panic!("no answer") };
    assert_eq!((told.dialect, told.possible, told.answers.len()), (6, 1 << V4_4, 3));
    let gain = told.answers[0];
    assert_eq!(gain.request, [0x30, 1, 0, 0, 0, 0, 0, 0]);
    assert_eq!(gain.answer, [0x30, 1, 0, 0, 0, 0, 0, 0x3F]);
    assert_eq!((gain.dialects, gain.agreement), (bits(&[V4_2, V4_3, V4_4]), Agreement::Twice));
    let reads = ["B1", "30", "B5", "42", "30", "B5", "42"];
    let sent = rig.sent_since(0, since);
    assert_eq!(sent.iter().map(|text| &text[4..6]).collect::<Vec<_>>(), reads);

    // One of a V3.6 motor is one of two.
    let mut rig = speaking(V3_6, V3_6, StopAction::Hold);
    let Ok(Reply::Recognise(told)) = rig.ask(recognise.clone()) else { panic!("no answer") };
    assert_eq!((told.dialect, told.possible), (0, bits(&[V3_6, V3_7])));
    // Armed: nothing is asked.
    arm(&mut rig);
    let since = rig.now_us;
    let again = rig.ask(recognise.clone());
    assert_eq!(again, Ok(Reply::Recognise(told)));
    assert!(!rig.sent_since(0, since).iter().any(|text| text.starts_with("141#30")));

    // What a silent motor speaks is not asked in vain.
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    play.borrow_mut().mute = true;
    assert!(matches!(rig.ask(recognise.clone()), Err(Error::NoReply { axis: 0, .. })));
    let (mut rig, _) = bench::thruster();
    let refused = Error::Unsupported { axis: 0, protocol: Protocol::Thruster };
    assert_eq!(rig.ask(recognise), Err(refused));
}

fn configure(rig: &mut Rig, parameter: AxisParameter, value: Value) -> Result<(), Error> {
    let request = requests::ConfigureAxis { axis: 0, parameter: parameter.number(), value };
    rig.ask(Request::ConfigureAxis(request)).map(drop)
}

/// What becomes of a native command that does not move.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Outcome {
    /// These bytes go out.
    Sent,
    /// The dialect has it not.
    Lacks,
    /// No dialect may be sent it.
    Never,
}

fn outcome(rig: &mut Rig, data: &str) -> Outcome {
    let since = rig.now_us;
    let request = native(rig, 0, data);
    let result = rig.ask(request);
    let sent = rig.sent_since(0, since).contains(&format!("141#{data}").as_str());
    let command = u8::from_str_radix(&data[..2], 16).unwrap();
    match result {
        Err(Error::NotInDialect { axis: 0, command: named }) => {
            assert!(named == command && !sent);
            Outcome::Lacks
        }
        Err(Error::NotACommand { axis: 0, protocol: Protocol::Rmd }) => {
            assert!(!sent);
            Outcome::Never
        }
        result => {
            assert!(sent, "{data}: {result:?}");
            Outcome::Sent
        }
    }
}

/// The rows of "dangerous differences" that are no motion; those with none there are never sent.
#[test]
fn a_native_command_goes_to_a_motor_that_has_it() {
    let rows: [(&str, &[u32]); 21] = [
        ("320400000000003F", &[V4_2, V4_3, V4_4]), // 1
        ("310400000000003F", &[V4_2, V4_3, V4_4]), // 1
        ("3200551955195519", &[V3_6, V3_7, V3_9]), // 2
        ("3100551955195519", &[V3_6, V3_7, V3_9]), // 2
        ("B400000000000001", &ALL[1..]),           // 4
        ("4303000010270000", &ALL),                // 10
        ("4300000000000000", &[]),                 // 10
        ("9400000000000000", &ALL[2..]),           // 11
        ("9000000000000000", &[V3_7, V3_9, V4_2, V4_3]),
        ("7900010000000000", &[]), // 12
        ("2005000002000000", &[]), // 13
        ("B692010100000000", &[]), // 14
        ("C000010141420000", &[]), // 16
        ("C100000000000000", &[]), // 16
        ("1900000000000000", &[]), // 18
        ("8800000000000000", &[]), // 18
        ("9B00000000000000", &[]), // 18
        ("3001000000000000", &[UNKNOWN, V4_2, V4_3, V4_4]),
        ("4203000000000000", &[UNKNOWN, V3_9, V4_2, V4_3, V4_4]),
        ("B501020000000000", &[UNKNOWN, V4_4]),
        ("7100000000000000", &[V3_6, V3_7, V3_9]),
    ];
    for dialect in ALL {
        let mut rig = rmd(dialect, StopAction::Coast);
        for (data, have) in rows {
            let found = outcome(&mut rig, data);
            assert_eq!(
                found == Outcome::Sent,
                have.contains(&dialect),
                "{data} {dialect}: {found:?}"
            );
        }
    }
}

/// Rows 5 to 9: motions that a motor would not carry out, or not with its limit.
#[test]
fn a_native_motion_goes_to_a_motor_that_has_it() {
    let rows: [(&str, &[u32]); 9] = [
        ("A232000010270000", &[V4_3, V4_4]), // 5: 100 °/s with at most 50 % torque
        ("A200000010270000", &ALL),          // 5
        ("A91EF401A08C0000", &[V4_3, V4_4]), // 6
        ("A900F401A08C0000", &[]),           // 7
        ("720AF401A08C0000", &[]),           // 6
        ("73F6F401A08C0000", &[]),           // 6
        ("A3000000A08C0000", &[V3_6]),       // 8
        ("A500F401A08C0000", &[V3_6]),       // 8
        ("A4000000A08C0000", &[]),           // 9
    ];
    for dialect in ALL {
        for (data, have) in rows {
            let mut rig = rmd(dialect, StopAction::Hold);
            let epoch = arm(&mut rig);
            let since = rig.now_us;
            let request = native(&rig, epoch, data);
            let result = rig.ask(request);
            let sent = rig.sent_since(0, since).contains(&format!("141#{data}").as_str());
            assert_eq!(sent, have.contains(&dialect), "{data} {dialect}: {result:?}");
            assert!(sent || result.is_err(), "{data} {dialect}");
        }
    }
}

/// Row 15: V4.4 echoes what it does not store while its output is on.
#[test]
fn what_is_stored_only_while_the_output_is_off_is_refused_where_a_stop_leaves_it_on() {
    for (dialect, stop, refused) in [
        (V4_4, StopAction::Hold, true),
        (V4_4, StopAction::Coast, false),
        (V4_3, StopAction::Hold, false),
    ] {
        let mut rig = rmd(dialect, stop);
        for data in ["320400000000003F", "4303000010270000", "6300000010270000", "6400000000000000"]
        {
            let request = native(&rig, 0, data);
            let result = rig.ask(request);
            assert_eq!(
                result == Err(Error::OutputStaysOn { axis: 0 }),
                refused,
                "{dialect} {data}"
            );
        }
    }
}

fn impedance() -> Setpoint {
    Setpoint::Impedance {
        position_rad: 10.0,
        velocity_rad_s: 1.0,
        stiffness_nm_per_rad: 10.0,
        damping_nm_s_per_rad: 1.0,
        torque_nm: 10.0,
    }
}

/// What comes of a setpoint: the frame, or the refusal.
fn moved(rig: &mut Rig, value: Setpoint) -> Result<String, Error> {
    let epoch = arm(rig);
    let since = rig.now_us;
    let request = setpoint(rig, epoch, 80_000, value);
    rig.ask(request)?;
    bench::run_with_host(rig, 10_000);
    Ok(rig.sent_since(0, since).first().copied().unwrap_or_default().to_owned())
}

/// Row 3.
#[test]
fn motion_mode_goes_out_in_the_ranges_of_the_motor_or_not_at_all() {
    for dialect in [V3_6, V3_7, V3_9, V4_2, V4_3] {
        let mut rig = rmd(dialect, StopAction::Hold);
        // RMD V3.6 §5.4
        assert_eq!(moved(&mut rig, impedance()).as_deref(), Ok("401#E66682E052333B55"));
    }
    let mut rig = rmd(UNKNOWN, StopAction::Hold);
    let refused = Err(Error::NotInDialect { axis: 0, command: 0 });
    assert_eq!(moved(&mut rig, impedance()), refused);

    let (torque, damping) = (AxisParameter::MotionTorqueNm, AxisParameter::MotionDamping);
    let lacks = |parameter: AxisParameter| {
        Err(Error::NotConfigured { axis: 0, parameter: parameter.number() })
    };
    let mut rig = rmd(V4_4, StopAction::Hold);
    assert_eq!(moved(&mut rig, impedance()), lacks(torque));
    let mut rig = rmd(V4_4, StopAction::Hold);
    parameter(&mut rig, 0, torque, Value::Float(60.0));
    assert_eq!(moved(&mut rig, impedance()), lacks(damping));
    let mut rig = rmd(V4_4, StopAction::Hold);
    parameter(&mut rig, 0, torque, Value::Float(60.0));
    parameter(&mut rig, 0, damping, Value::Float(50.0));
    // V4.4: ±12.566 rad, ±60 N·m, kd to 50
    assert_eq!(moved(&mut rig, impedance()).as_deref(), Ok("401#E5DD82E052052955"));
}

#[test]
fn a_torque_cap_goes_out_with_every_velocity_and_position() {
    let cap = AxisParameter::TorqueCap;
    let position = Setpoint::Position { position_rad: 6.283_185_5, speed_limit_rad_s: 8.726_646 };
    for dialect in ALL {
        let mut rig = rmd(dialect, StopAction::Hold);
        let result = configure(&mut rig, cap, Value::Unsigned(30));
        if ![V4_3, V4_4].contains(&dialect) {
            assert_eq!(result, Err(Error::NotInDialect { axis: 0, command: 0xA9 }), "{dialect}");
            assert_eq!(moved(&mut rig, VELOCITY).as_deref(), Ok("141#A200000010270000"));
            continue;
        }
        assert_eq!(result, Ok(()));
        let other = configure(&mut rig, AxisParameter::RmdDialect, Value::Unsigned(V4_2));
        assert_eq!(other, Err(Error::NotInDialect { axis: 0, command: 0xA9 }));
        assert_eq!(moved(&mut rig, VELOCITY).as_deref(), Ok("141#A21E000010270000"));
        let mut rig = rmd(dialect, StopAction::Hold);
        parameter(&mut rig, 0, cap, Value::Unsigned(30));
        assert_eq!(moved(&mut rig, position).as_deref(), Ok("141#A91EF401A08C0000"));
        // Native: no cap, a higher one, and commands that cannot have one.
        for (data, allowed) in [
            ("A200000010270000", false),
            ("A21F000010270000", false),
            ("A21E000010270000", true),
            ("A400F40100000000", false),
            ("A800F40100000000", false),
            ("A100000001000000", true),
        ] {
            let mut rig = rmd(dialect, StopAction::Hold);
            parameter(&mut rig, 0, cap, Value::Unsigned(30));
            let epoch = arm(&mut rig);
            let request = native(&rig, epoch, data);
            let refused = Err(Error::CannotCheckLimit { axis: 0, quantity: Quantity::Torque });
            assert_eq!(rig.ask(request) != refused, allowed, "{data}");
        }
    }
}
