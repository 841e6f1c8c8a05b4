//! What hosts ask for: requests of every kind, mostly ones that make sense.

use super::raw::raw_send;
use super::setup::{LIMITS, RETURN_MODES};
use crate::action::{Ask, Goal, Number, Permit};
use crate::dice::Dice;
use crate::plant::{ALL_AXES, AXES, BUS_SETUP, BUSES, MOTORS, POSITION_DEVICE, RMD_AND_THRUSTER};
use host_protocol::{AxisParameter, Protocol};

/// A request of any kind.
pub fn any_ask(dice: &mut Dice) -> Ask {
    let axis = dice.byte() % AXES;
    let bus = dice.byte() % (BUSES + 1);
    match dice.below(40) {
        0 => Ask::Take,
        1 if dice.one_in(8) => Ask::Release,
        2 if dice.one_in(8) => Ask::Hello,
        3 if dice.one_in(4) => Ask::StopAll,
        4 if dice.one_in(4) => Ask::EStop,
        5..8 => Ask::ClearGateway,
        8..10 => Ask::Disarm { axis },
        10..12 => Ask::Stop { axis },
        12..14 => Ask::Setpoint { permit: permit(dice, axis), goal: goal(dice, axis) },
        14..20 => native(dice, axis),
        20 => {
            let timeout_ms = dice.pick(&[0, 1, 99, 100, 300, 300, 60_000, 60_001, 4_233_600_000]);
            Ask::Provision { axis, timeout_ms }
        }
        21 => Ask::Set {
            axis,
            parameter: dice.pick(&[6, 8, 9, 13]),
            value: Number::Unsigned(100_000),
        },
        22 => {
            let (parameter, scale) = dice.pick(&[
                (11, 0.2),
                (14, 20.0),
                (14, 0.1),
                (15, 5.0),
                (16, -9.0),
                (17, 9.0),
                (28, 3.0),
            ]);
            Ask::Set { axis, parameter, value: Number::Float(dice.fraction() * scale) }
        }
        23 => {
            let protocols =
                BUS_SETUP.get(usize::from(bus)).map_or(RMD_AND_THRUSTER, |(_, spoken)| *spoken);
            let protocols = if dice.percent(30) { dice.pick(&[1, 3, 4, 7]) } else { protocols };
            let window_us = dice.pick(&[1_000, 3_000, 5_000]);
            Ask::Bus { bus, window_us, protocols, exclusive: dice.percent(50) }
        }
        24 if dice.one_in(2) => {
            let parameter = AxisParameter::WarningsAreFaults.number();
            Ask::Set { axis, parameter, value: Number::Bool(dice.one_in(2)) }
        }
        24 if dice.one_in(4) => {
            let parameter = AxisParameter::ReturnMode.number();
            Ask::Set { axis, parameter, value: Number::Unsigned(dice.pick(&RETURN_MODES).into()) }
        }
        24 => Ask::Remove { axis: 31 },
        25 if dice.one_in(2) => Ask::RunCycle {
            axes: dice.pick(&[0, 1, 0b111, 0xFFFF]),
            period_us: dice.pick(&[1_000, 2_000, 10_000, 20_000]),
        },
        25 => Ask::Subscribe { axes: dice.pick(&[0, 1, ALL_AXES]), period_us: 50_000 },
        26..28 => Ask::Read { axis },
        28 => dice.pick(&[Ask::Status, Ask::List]),
        29 => Ask::RawOpen { bus, unsafe_access: dice.percent(30) },
        30 if dice.one_in(3) => Ask::RawOpenAt { bus, mode: dice.byte() % 3 },
        30..33 => raw_send(dice, bus),
        33 => Ask::RawReceive { bus },
        34..36 => Ask::RawClose { bus },
        36 => Ask::ClearUnreachable { axis },
        37 => Ask::Clear { axis },
        38 => Ask::OutputOff { axis },
        39 if dice.one_in(3) => Ask::FlightRecord { offset: dice.pick(&[0, 9, 10, u32::MAX]) },
        _ => Ask::Ping,
    }
}

/// Mostly in good time and for the right epoch.
pub(super) fn permit(dice: &mut Dice, axis: u8) -> Permit {
    let epoch = if dice.percent(97) { 0 } else { dice.pick(&[-1, -2, 1000]) };
    let lead_us = match dice.below(50) {
        0 => dice.pick(&[0, -1, -5_000, i32::MIN, 1, 200_001, 61_000_000]),
        1..4 => dice.pick(&[2_000, 10_000]),
        _ => 48_000,
    };
    Permit { axis, epoch, lead_us }
}

pub(super) fn goal(dice: &mut Dice, axis: u8) -> Goal {
    let value = match dice.below(60) {
        0 => f32::NAN,
        1 => 1e30,
        2 => 0.0,
        3..9 => dice.pick(&LIMITS) * dice.pick(&[1.0, -1.0]),
        _ => dice.fraction() * 4.0,
    };
    let speed = dice.pick(&LIMITS);
    match MOTORS[usize::from(axis)].protocol {
        _ if dice.percent(3) => Goal::Current(value),
        Protocol::Thruster if axis == POSITION_DEVICE && dice.percent(30) => {
            Goal::Position(value, 10.0)
        }
        Protocol::Thruster => dice.pick(&[Goal::Signal(value / 5.0), Goal::Velocity(value * 3.0)]),
        Protocol::D5 => Goal::Velocity(value),
        Protocol::Rmd => dice.pick(&[
            Goal::Velocity(value),
            Goal::Velocity(value),
            Goal::Current(value),
            Goal::Position(value, speed),
            Goal::Impedance(value),
        ]),
    }
}

/// A command of the manual, or bytes that are none.
pub(super) fn native(dice: &mut Dice, axis: u8) -> Ask {
    let motor = &MOTORS[usize::from(axis)];
    let data = match motor.protocol {
        _ if dice.percent(5) => dice.bytes(9),
        // What some dialects lack, or have in another form (docs/rmd-dialects.md).
        Protocol::Rmd if dice.percent(20) => {
            let [command, index] = dice.pick(&[
                [0x31, 0],
                [0x32, 0],
                [0x32, 4],
                [0x30, 1],
                [0x42, 3],
                [0xB5, 1],
                [0x71, 0],
                [0x90, 0],
                [0x94, 0],
                [0xA2, 50],
                [0xA9, 50],
                [0xA9, 0],
                [0xA3, 0],
                [0xA5, 0],
                [0xA6, 0],
                [0x72, 10],
                [0xB4, 0],
                [0xB6, 0x92],
                [0x20, 5],
                [0x20, 8],
                [0x79, 0],
                [0xC0, 0],
                [0x19, 0],
            ]);
            vec![command, index, dice.pick(&[0, 1]), 0, dice.byte(), 0, 0, dice.pick(&[0, 1])]
        }
        Protocol::Rmd => {
            let command = dice.pick(&[
                0x30, 0x43, 0x64, 0x70, 0x77, 0x78, 0x80, 0x81, 0x92, 0x9A, 0xA1, 0xA2, 0xA4, 0xA8,
                0xA8,
            ]);
            vec![command, 0, dice.byte(), 0, dice.byte(), dice.byte(), 0, 0]
        }
        Protocol::Thruster => {
            let [a, b] = *dice.pick(&[
                b"TC", b"VC", b"QV", b"EF", b"LA", b"LR", b"LR", b"LS", b"ST", b"MQ", b"VM",
            ]);
            let value = dice.pick(&[0, dice.clone().byte() / 3]);
            let long = vec![a, b, 0, 9, 0, 0, 0, value];
            dice.pick(&[long.clone(), long, vec![a, b, 0, 0]])
        }
        Protocol::D5 => {
            let command = dice.pick(&[1, 2, 3, 3, 4, 5]);
            let address = if command == 5 { 0 } else { dice.pick(&[0x20, 0x20, 0x26, 0x15]) };
            let low = if command == 5 { 0 } else { dice.pick(&[0, 30, 200]) };
            let body = [motor.node, 5, command, address, low, 0];
            let sum = body.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
            std::iter::once(0xD5).chain(body).chain([sum]).collect()
        }
    };
    Ask::Native { permit: permit(dice, axis), data }
}
