//! Axes that are moved to other motors: another bus, node, protocol, other ids, in any state and
//! with requests under way.

use super::Generator;
use super::asks::native;
use super::raw::unsafe_access;
use crate::action::{Action, Ask, Number};
use crate::plant::{ALL_AXES, AXES, BUSES, D5_BUSES, MOTORS, POSITION_DEVICE, extended_id};
use crate::world::World;
use host_protocol::{AxisParameter, Protocol};
use promise_model::{EXTENDED, Told};

/// Ids for D5 motors: their own, and those of others.
const D5_IDS: [u32; 22] = [
    0x26,
    0x27,
    0x28,
    0x141,
    0x142,
    0x241,
    0x242,
    0x30E,
    0x28E,
    0x401,
    0x402,
    0x403,
    0x501,
    0x280,
    0x300,
    0x7FF,
    extended_id(0x26),
    extended_id(0x27),
    extended_id(0x28),
    EXTENDED | 0x26,
    EXTENDED | 0x27,
    EXTENDED | 0x141,
];

impl Generator {
    /// An axis is asked something, and moved before it has been answered; its old bus is loaded
    /// meanwhile, starts again, or goes off.
    pub(super) fn moves(&mut self, world: &World) -> Action {
        if self.dice.percent(10) {
            return self.bares();
        }
        let idle: Vec<u8> =
            (0..AXES).filter(|axis| world.oracle().told(*axis) == Told::Idle).collect();
        let axis = if idle.is_empty() || self.dice.percent(10) {
            self.axis()
        } else {
            self.dice.pick(&idle)
        };
        let old = MOTORS[usize::from(axis)].bus;
        let link = self.commander;
        let mut actions = Vec::new();
        if self.dice.percent(40) {
            let (length, for_us) = (self.dice.byte() % 9, self.dice.pick(&[1_000, 6_000]));
            actions.push(Action::Foreign { bus: old, id: 1, length, pause_us: 0, for_us });
        }
        let mut asks = Vec::new();
        if self.dice.percent(70) {
            asks.push(match self.dice.below(6) {
                0 => native(&mut self.dice, axis),
                1 => Ask::Provision { axis, timeout_ms: 300 },
                2 => Ask::Arm { axis },
                3 => self.dice.pick(&[Ask::Stop { axis }, Ask::EStop]),
                _ => Ask::Subscribe { axes: ALL_AXES, period_us: 1_000 },
            });
        }
        if self.dice.percent(10) {
            asks.push(Ask::Remove { axis });
        }
        let together = self.dice.percent(40);
        if together {
            asks.push(Ask::Begin);
        }
        for _ in 0..=self.dice.below(3) {
            let (parameter, value) = self.new_address(MOTORS[usize::from(axis)].protocol);
            let (parameter, value) = (parameter.number(), Number::Unsigned(value));
            asks.push(if together {
                let value = (!self.dice.percent(5)).then_some(value);
                Ask::Change { axis, parameter, value }
            } else {
                Ask::Set { axis, parameter, value }
            });
        }
        if together && self.dice.percent(40) {
            asks.push(self.name());
        }
        if together {
            asks.push(Ask::Apply);
        }
        actions.extend(asks.into_iter().map(|ask| Action::Ask { link, ask }));
        if self.dice.percent(50) {
            actions.push(if self.dice.percent(40) {
                let protocols = self.protocols[usize::from(old)];
                Action::Ask {
                    link,
                    ask: Ask::Bus { bus: old, window_us: 3_000, protocols, exclusive: self.starts },
                }
            } else {
                Action::Short { bus: old, for_us: self.dice.below(3_000) }
            });
        }
        if self.dice.percent(40) {
            let ask = self.dice.pick(&[
                Ask::StopAll,
                Ask::Stop { axis },
                Ask::Stop { axis },
                Ask::Arm { axis },
            ]);
            actions.push(Action::Ask { link, ask });
        }
        self.first.extend(actions);
        Action::Ask { link, ask: Ask::Ping }
    }

    /// All axes of a bus are removed, it is opened for everything, and an axis comes back before or
    /// after that ends.
    fn bares(&mut self) -> Action {
        let axis = self.axis();
        let bus = MOTORS[usize::from(axis)].bus;
        let here = (0..).zip(&MOTORS).filter(|(_, motor)| motor.bus == bus).map(|(axis, _)| axis);
        let mut asks: Vec<Ask> = here.map(|axis| Ask::Remove { axis }).collect();
        asks.extend(unsafe_access(&mut self.dice, bus));
        let comes_back = Ask::Set {
            axis,
            parameter: AxisParameter::Bus.number(),
            value: Number::Unsigned(bus.into()),
        };
        let ends = [Ask::RawClose { bus }, Ask::EStop, comes_back.clone(), Ask::Ping];
        asks.extend([self.dice.pick(&ends), comes_back]);
        asks.extend([Ask::RawClose { bus }, Ask::ClearGateway]);
        let link = self.commander;
        self.first.extend(asks.into_iter().map(|ask| Action::Ask { link, ask }));
        self.moves_back(axis)
    }

    /// A name for something, one that something else has, or none that is allowed.
    fn name(&mut self) -> Ask {
        const NAMES: [&str; 6] = ["left", "right", "a-name_of-16-bts", "left", "2nd", ""];
        let (kind, number) = (self.dice.byte() % 3, self.dice.byte() % (AXES + 1));
        let name = self.dice.percent(80).then(|| self.dice.pick(&NAMES).to_owned());
        Ask::Name { kind, number, name }
    }

    fn new_address(&mut self, protocol: Protocol) -> (AxisParameter, u32) {
        match self.dice.below(8) {
            // Where the others of its protocol are, and back.
            0..3 if protocol == Protocol::D5 && self.dice.percent(80) => {
                (AxisParameter::Bus, self.dice.pick(&D5_BUSES).into())
            }
            0..3 => (AxisParameter::Bus, (self.dice.byte() % BUSES).into()),
            3 => (AxisParameter::Protocol, self.dice.pick(&[1, 2, 3])),
            4 => (
                AxisParameter::Node,
                self.dice.pick(&[1, 2, 3, 4, 0x0E, 0x0F, 20, 0x26, 0x27, 0x28]),
            ),
            5 => (AxisParameter::StopAction, self.dice.pick(&[1, 2, 3])),
            6 => (AxisParameter::D5RequestId, self.dice.pick(&D5_IDS)),
            _ => (AxisParameter::D5ReplyId, self.dice.pick(&D5_IDS)),
        }
    }

    /// An axis is that of its own motor again.
    pub(super) fn moves_back(&mut self, axis: u8) -> Action {
        let motor = &MOTORS[usize::from(axis)];
        let protocols = self.protocols[usize::from(motor.bus)];
        let bus = Ask::Bus { bus: motor.bus, window_us: 3_000, protocols, exclusive: self.starts };
        let mut asks = vec![Ask::Remove { axis }, bus];
        for (parameter, value) in [
            (AxisParameter::Bus, motor.bus.into()),
            (AxisParameter::Protocol, motor.protocol.number().into()),
            (AxisParameter::Node, motor.node.into()),
            (AxisParameter::StopAction, motor.stop.number().into()),
        ] {
            asks.push(Ask::Set {
                axis,
                parameter: parameter.number(),
                value: Number::Unsigned(value),
            });
        }
        let allow = AxisParameter::AllowUnknownMotorTimeout.number();
        asks.push(Ask::Set { axis, parameter: allow, value: Number::Bool(true) });
        if axis == POSITION_DEVICE {
            let parameter = AxisParameter::PositionDevice.number();
            asks.push(Ask::Set { axis, parameter, value: Number::Bool(true) });
        }
        self.first.extend(asks.into_iter().map(|ask| Action::Ask { link: self.commander, ask }));
        Action::Ask { link: self.commander, ask: Ask::Ping }
    }
}
