//! The table "What each protocol can do" of PROTOCOL.md, tried cell by cell; and on which buses
//! each runs, as README.md says.

use crate::bench::{self, arm, setpoint};
use crate::rig::Rig;
use gateway::check_bus_config;
use host_protocol::{
    AxisParameter, BusConfig, BusKind, Error, Protocol, ProtocolSet, Request, Setpoint, StopAction,
    Value, requests,
};

const REFERENCE: &str = include_str!("../../PROTOCOL.md");
const README: &str = include_str!("../../README.md");

/// The cell of a row of the table, `column` counted from the first protocol.
fn cell(row: &str, column: usize) -> &'static str {
    let (_, table) = REFERENCE.split_once("## What each protocol can do").unwrap();
    let line = table.lines().find(|line| line.starts_with(&format!("| {row} |"))).unwrap();
    line.split('|').map(str::trim).nth(column + 2).unwrap()
}

fn rig_of(protocol: Protocol) -> Rig {
    match protocol {
        Protocol::Rmd => bench::rmd(StopAction::Hold).0,
        Protocol::Thruster => bench::thruster().0,
        Protocol::D5 => bench::d5().0,
    }
}

fn is_supported(rig: &mut Rig, request: Request, protocol: Protocol) -> bool {
    match rig.ask(request) {
        Ok(_) => true,
        Err(error) => {
            assert_eq!(error, Error::Unsupported { axis: 0, protocol });
            false
        }
    }
}

/// What a cell promises of the bench's motors, which are on CAN.
fn is_expected(cell: &str, position_device: bool) -> bool {
    match cell {
        "with `position_device`" => position_device,
        "yes" | "on CAN" => true,
        "no" => false,
        other => panic!("a cell says {other}"),
    }
}

/// What `position_device` may be.
fn position_devices(protocol: Protocol) -> &'static [bool] {
    if protocol == Protocol::Thruster { &[false, true] } else { &[false] }
}

#[test]
fn relative_moves_are_those_of_the_reference() {
    for (column, protocol) in Protocol::ALL.iter().copied().enumerate() {
        for position_device in position_devices(protocol).iter().copied() {
            let mut rig = rig_of(protocol);
            bench::parameter(
                &mut rig,
                0,
                AxisParameter::PositionDevice,
                Value::Bool(position_device),
            );
            let request = requests::MoveRelative {
                axis: 0,
                epoch: arm(&mut rig),
                expires_at_us: bench::expiry(&rig, 80_000),
                distance_rad: 0.1,
                speed_limit_rad_s: 5.0,
            };
            let expected = is_expected(cell("`MoveRelative`", column), position_device);
            let supported = is_supported(&mut rig, Request::MoveRelative(request), protocol);
            assert_eq!(supported, expected, "{protocol}");
        }
    }
}

#[test]
fn setpoints_are_those_of_the_reference() {
    let setpoints = [
        ("setpoint `Signal`", Setpoint::Signal { fraction: 0.1 }),
        ("setpoint `Current`", Setpoint::Current { current_a: 0.1 }),
        ("setpoint `Velocity`", Setpoint::Velocity { velocity_rad_s: 5.0 }),
        ("setpoint `Position`", Setpoint::Position { position_rad: 0.1, speed_limit_rad_s: 5.0 }),
        (
            "setpoint `Impedance`",
            Setpoint::Impedance {
                position_rad: 0.1,
                velocity_rad_s: 0.0,
                stiffness_nm_per_rad: 1.0,
                damping_nm_s_per_rad: 0.1,
                torque_nm: 0.0,
            },
        ),
    ];
    for (column, protocol) in Protocol::ALL.iter().copied().enumerate() {
        for (row, value) in setpoints {
            for position_device in position_devices(protocol).iter().copied() {
                let mut rig = rig_of(protocol);
                let flag = Value::Bool(position_device);
                bench::parameter(&mut rig, 0, AxisParameter::PositionDevice, flag);
                let epoch = arm(&mut rig);
                let request = setpoint(&rig, epoch, 80_000, value);
                let expected = is_expected(cell(row, column), position_device);
                assert_eq!(
                    is_supported(&mut rig, request, protocol),
                    expected,
                    "{row} of {protocol}"
                );
            }
        }
    }
}

#[test]
fn stop_actions_are_those_of_the_reference() {
    for (column, protocol) in Protocol::ALL.iter().copied().enumerate() {
        for action in StopAction::ALL {
            let row = format!("stop action `{}`", action.name());
            let request = Request::ConfigureAxis(requests::ConfigureAxis {
                axis: 0,
                parameter: AxisParameter::StopAction.number(),
                value: Value::Unsigned(u32::from(*action)),
            });
            let supported = is_supported(&mut rig_of(protocol), request, protocol);
            assert_eq!(supported, cell(&row, column) == "yes", "{row} of {protocol}");
        }
    }
}

#[test]
fn each_protocol_runs_on_the_buses_that_the_readme_shows() {
    for (protocol, row) in [
        (Protocol::Rmd, "| RMD, "),
        (Protocol::Thruster, "| thruster protocol "),
        (Protocol::D5, "| D5 "),
    ] {
        let line = README.lines().find(|line| line.starts_with(row)).expect(row);
        let runs_on: Vec<&str> =
            line.split('|').nth(3).unwrap().split(',').map(str::trim).collect();
        for kind in [BusKind::Can, BusKind::Rs485] {
            let bitrate = match (kind, protocol) {
                (BusKind::Rs485, _) => 115_200,
                (BusKind::Can, Protocol::D5) => 210_526,
                (BusKind::Can, _) => 1_000_000,
            };
            let protocols = ProtocolSet::NONE.with(protocol);
            let config = BusConfig { bitrate, protocols, exclusive: false, reply_window_us: 1_000 };
            let runs = check_bus_config(0, kind, &[bitrate], &config).is_ok();
            assert_eq!(runs, runs_on.contains(&kind.to_string().as_str()), "{protocol} on {kind}");
        }
    }
}
