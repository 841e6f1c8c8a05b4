//! RMD dialects (docs/rmd-dialects.md): what a motor lacks is refused by name, what differs goes out in
//! its dialect. The bytes have their sources in `host-tests/vectors/rmd-dialects.txt`.

use crate::bench::{self, VELOCITY, arm, native, parameter, setpoint};
use crate::rig::Rig;
use host_protocol::{
    AxisParameter, Error, Protocol, Quantity, Request, Setpoint, StopAction, Value, requests,
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
    let (mut rig, _) = bench::rmd(stop);
    parameter(&mut rig, 0, AxisParameter::RmdDialect, Value::Unsigned(dialect));
    rig
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
