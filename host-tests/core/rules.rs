//! The rules of an axis as a program may ask for them, and that the gateway refuses what they
//! refuse and takes what they allow.

use crate::bench::{self, arm, expiry, native, parameter, setpoint};
use crate::rig::{Instead, Rig};
use crate::text::unhex;
use gateway::{AxisRules, NativeEffect};
use host_protocol::{
    AxisParameter, BusKind, Error, Protocol, Quantity, Reply, Request, Setpoint, StopAction, Value,
    requests,
};

const TTL_US: u64 = 80_000;
/// A gateway that takes a move reads the position first; the others refuse.
const DISTANCES: [(f32, f32); 7] = [
    (1.0, 1.0),
    (f32::NAN, 1.0),
    (1.0, f32::NAN),
    (1.0, 0.0),
    (1.0, -1.0),
    (1.0, 9.0),
    (-0.5, 5_000.0),
];

/// The rules for what the gateway says axis 0 is configured with.
fn rules(rig: &mut Rig, bus: BusKind) -> AxisRules {
    let mut rules = AxisRules::new(0, bus);
    for parameter in AxisParameter::ALL {
        let request = requests::ReadAxisParameter { axis: 0, parameter: parameter.number() };
        let Ok(Reply::ReadAxisParameter(reply)) = rig.ask(Request::ReadAxisParameter(request))
        else {
            panic!("{parameter:?}")
        };
        if let Some(value) = reply.value {
            rules.set(*parameter, value).unwrap();
        }
    }
    rules
}

/// Some of every kind: usual, at the limits of the wire, beyond them, no numbers.
fn setpoints() -> Vec<Setpoint> {
    let values = [0.0, 0.1, -0.1, 1.0, -1.0, 4.0, 50.0, -400.0, 4.0e5, f32::NAN, f32::NEG_INFINITY];
    let mut setpoints = Vec::new();
    for value in values {
        setpoints.extend([
            Setpoint::Signal { fraction: value },
            Setpoint::Current { current_a: value },
            Setpoint::Velocity { velocity_rad_s: value },
            Setpoint::Position { position_rad: value, speed_limit_rad_s: 1.0 },
            Setpoint::Position { position_rad: 1.0, speed_limit_rad_s: value },
        ]);
        // Position, velocity, stiffness, damping and torque; one of them the value.
        for which in 0..5 {
            let mut parts = [0.5, 0.5, 1.0, 0.1, 0.1];
            parts[which] = value;
            let [
                position_rad,
                velocity_rad_s,
                stiffness_nm_per_rad,
                damping_nm_s_per_rad,
                torque_nm,
            ] = parts;
            setpoints.push(Setpoint::Impedance {
                position_rad,
                velocity_rad_s,
                stiffness_nm_per_rad,
                damping_nm_s_per_rad,
                torque_nm,
            });
        }
    }
    setpoints
}

/// NaN is not equal to itself.
fn said<T>(result: Result<T, Error>) -> String {
    format!("{:?}", result.err())
}

/// Asks the rules and the armed gateway the same. Returns how much was allowed, and how much
/// refused.
fn assert_agree(mut rig: Rig, bus: BusKind, commands: &[&str]) -> (usize, usize) {
    let rules = rules(&mut rig, bus);
    let mut verdicts = Vec::new();
    let mut compare = |what: String, rule: Result<(), Error>, gateway: Result<Reply, Error>| {
        verdicts.push(rule.is_ok());
        assert_eq!(said(rule), said(gateway), "{what}");
    };
    let epoch = arm(&mut rig);
    for value in setpoints() {
        let request = setpoint(&rig, epoch, TTL_US, value);
        compare(format!("{value:?}"), rules.check_setpoint(value), rig.ask(request));
    }
    for (distance_rad, speed_limit_rad_s) in DISTANCES {
        let expires_at_us = expiry(&rig, TTL_US);
        let request = requests::MoveRelative {
            axis: 0,
            epoch,
            expires_at_us,
            distance_rad,
            speed_limit_rad_s,
        };
        let gateway = rig.ask(Request::MoveRelative(request));
        let rule = rules.check_move(distance_rad, speed_limit_rad_s);
        compare(format!("move {distance_rad} at {speed_limit_rad_s}"), rule, gateway);
    }
    for data in commands {
        let request = native(&rig, epoch, data);
        compare((*data).into(), rules.check_native(&unhex(data)), rig.ask(request));
    }
    let allowed = verdicts.iter().filter(|allowed| **allowed).count();
    (allowed, verdicts.len() - allowed)
}

/// Some limits, and an axis that counts the other way round.
fn limit(rig: &mut Rig, lowest_rad: f32) {
    parameter(rig, 0, AxisParameter::Direction, Value::Signed(-1));
    for (limited, value) in [
        (AxisParameter::VelocityLimitRadS, 45.0),
        (AxisParameter::CurrentLimitA, 2.0),
        (AxisParameter::PositionMinRad, lowest_rad),
        (AxisParameter::SignalLimit, 0.5),
        (AxisParameter::TorqueLimitNm, 3.0),
    ] {
        let (number, value) = (limited.number(), Value::Float(value));
        let configured = requests::ConfigureAxis { axis: 0, parameter: number, value };
        // Not every motor measures, or can be asked for, all of these.
        match rig.ask(Request::ConfigureAxis(configured)) {
            Ok(_) => {}
            refused => {
                assert_eq!(refused, Err(Error::CannotMeasure { axis: 0, parameter: number }))
            }
        }
    }
}

/// RMD V3.6 §2.17, §2.18 and §2.20: currents, speeds and positions.
const RMD_COMMANDS: [&str; 6] = [
    "A100000064000000",
    "A1000000B80B0000",
    "A200000010270000",
    "A20000007F969800",
    "A400F401A08C0000",
    "A40000000A000000",
];
/// §2.19, §2.22: a position at any speed, and distances.
// 361°: the bench's motor stands at 360°.
const RMD_UNLIMITED: [&str; 3] = ["A3000000048D0000", "A800F40128230000", "A800000028230000"];

#[test]
fn the_gateway_and_the_rules_agree_on_an_rmd() {
    for limited in [false, true] {
        let (mut rig, _) = bench::rmd(StopAction::Hold);
        if limited {
            limit(&mut rig, -8.0);
        }
        rig.instead(|text| match &text[..6] {
            "141#A3" => Instead::Says("241#A332640000002D00"),
            "141#A8" => Instead::Says("241#A832640000002D00"),
            _ => Instead::AsUsual,
        });
        let commands = [&RMD_COMMANDS[..], &RMD_UNLIMITED[..]].concat();
        let (allowed, refused) = assert_agree(rig, BusKind::Can, &commands);
        assert!(allowed > 20 && refused > 20, "{allowed} allowed, {refused} refused");
    }
}

#[test]
fn the_gateway_and_the_rules_agree_on_an_rmd_that_has_no_motion_mode() {
    let (rig, _) = bench::rmd_serial(StopAction::Hold);
    let (allowed, refused) = assert_agree(rig, BusKind::Rs485, &RMD_COMMANDS);
    assert!(allowed > 15 && refused > 60, "{allowed} allowed, {refused} refused");
}

#[test]
fn the_gateway_and_the_rules_agree_on_a_thruster() {
    for position_device in [false, true] {
        let (mut rig, _) = bench::thruster();
        parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(position_device));
        // Of 180° little is left at 45 rad/s.
        limit(&mut rig, -0.5);
        // Thruster manual §2.1, §4.1: a signal, speeds of 300 and 20 rpm, a position and a
        // distance.
        let commands = [
            "544300000000FFFB",
            "564300000000012C",
            "5643000000000014",
            "4C41012C000003E8",
            "4C52012C000003E8",
        ];
        let (allowed, refused) = assert_agree(rig, BusKind::Can, &commands);
        assert!(allowed > 5 && refused > 60, "{allowed} allowed, {refused} refused");
    }
}

#[test]
fn the_gateway_and_the_rules_agree_on_a_d5() {
    let (mut rig, _) = bench::d5();
    limit(&mut rig, -8.0);
    // D5 manual, common row 2: 600 °/s; for somebody else; with a wrong checksum.
    let commands = ["D50B05032058028D", "D50C05032058028E", "D50B05032058028E"];
    let (allowed, refused) = assert_agree(rig, BusKind::Can, &commands);
    assert!(allowed >= 6 && refused > 80, "{allowed} allowed, {refused} refused");
}

fn effect(protocol: Protocol, data: &str) -> Result<NativeEffect, Error> {
    let mut rules = AxisRules::new(0, BusKind::Can);
    rules.set(AxisParameter::Protocol, Value::Unsigned(protocol.number().into())).unwrap();
    rules.set(AxisParameter::Node, Value::Unsigned(0x0B)).unwrap();
    rules.set(AxisParameter::PositionDevice, Value::Bool(true)).unwrap();
    rules.native_effect(&unhex(data))
}

#[test]
fn what_a_native_command_does_is_told_by_its_bytes() {
    use NativeEffect::{Asks, Changes, Moves, MovesOnce, Prepares, Stops};
    let table = [
        // RMD V3.6 §2; the first byte is the command.
        (Protocol::Rmd, "8000000000000000", Stops),
        (Protocol::Rmd, "8100000000000000", Stops),
        (Protocol::Rmd, "A100000064000000", Moves),
        (Protocol::Rmd, "A200000064000000", Moves),
        (Protocol::Rmd, "A300000064000000", Moves),
        (Protocol::Rmd, "A400000064000000", Moves),
        (Protocol::Rmd, "A500000064000000", Moves),
        (Protocol::Rmd, "A800000064000000", MovesOnce),
        (Protocol::Rmd, "9200000000000000", Asks),
        (Protocol::Rmd, "9A00000000000000", Asks),
        (Protocol::Rmd, "9C00000000000000", Asks),
        (Protocol::Rmd, "6400000000000000", Changes),
        (Protocol::Rmd, "7600000000000000", Changes),
        (Protocol::Rmd, "7700000000000000", Changes),
        // Thruster manual §2.1, §4.1.
        (Protocol::Thruster, "544300000000FFFB", Moves),
        (Protocol::Thruster, "5443000000000000", Stops),
        (Protocol::Thruster, "564300000000012C", Moves),
        (Protocol::Thruster, "5643000000000000", Stops),
        (Protocol::Thruster, "4C41012CFFFFF8F9", Moves),
        (Protocol::Thruster, "4C52012CFFFFF8F9", MovesOnce),
        (Protocol::Thruster, "51560000", Asks),
        // D5 manual, common rows 2 and 3, rows 11 and 13.
        (Protocol::D5, "D50B05032058028D", Moves),
        (Protocol::D5, "D50B050320000033", Stops),
        (Protocol::D5, "D50B05042058028E", Prepares),
        (Protocol::D5, "D50B050500000015", Prepares),
        (Protocol::D5, "D50B050226000038", Asks),
    ];
    for (protocol, data, wanted) in table {
        assert_eq!(effect(protocol, data), Ok(wanted), "{protocol:?} {data}");
    }
}

#[test]
fn what_is_no_command_and_what_is_no_value_is_refused() {
    assert_eq!(
        effect(Protocol::Rmd, "FF00000000000000"),
        Err(Error::NotACommand { axis: 0, protocol: Protocol::Rmd })
    );
    assert_eq!(
        effect(Protocol::D5, "D50C050226000039"),
        Err(Error::NotThisNode { axis: 0, node: 0x0B })
    );
    let mut rules = AxisRules::new(3, BusKind::Can);
    assert!(rules.set(AxisParameter::SignalLimit, Value::Float(1.5)).is_err());
    let nowhere =
        Err(Error::NotConfigured { axis: 3, parameter: AxisParameter::Protocol.number() });
    assert_eq!(rules.check_setpoint(Setpoint::Velocity { velocity_rad_s: 1.0 }), nowhere);
    assert_eq!(rules.check_native(&[0x9A; 8]), nowhere);
    assert_eq!(
        rules.check_move(f32::INFINITY, 1.0),
        Err(Error::NotANumber { quantity: Quantity::Position })
    );
}

#[test]
fn a_motor_that_cannot_be_is_refused_by_the_rules_as_by_the_gateway() {
    let mut refused = 0;
    for protocol in Protocol::ALL.iter().copied() {
        for (bus, kind) in [(0, BusKind::Can), (2, BusKind::Rs485)] {
            for (node, stop) in
                [1, 32, 33, 127, 128, 253].iter().zip(StopAction::ALL.iter().cycle())
            {
                let mut rig = Rig::new();
                bench::hello(&mut rig);
                let mut rules = AxisRules::new(0, kind);
                let mut told = Ok(());
                for (name, number) in [
                    (AxisParameter::StopAction, stop.number()),
                    (AxisParameter::Bus, bus),
                    (AxisParameter::Node, *node),
                    (AxisParameter::Protocol, protocol.number()),
                ] {
                    let value = Value::Unsigned(number.into());
                    rules.set(name, value).unwrap();
                    let request =
                        requests::ConfigureAxis { axis: 0, parameter: name.number(), value };
                    told = told.and(rig.ask(Request::ConfigureAxis(request)).map(drop));
                }
                assert_eq!(rules.check(), told, "{protocol:?} {node} on bus {bus}, {stop:?}");
                refused += usize::from(told.is_err());
            }
        }
    }
    assert!(refused > 20, "{refused}");
}
