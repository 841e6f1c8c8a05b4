//! Random steps, mostly of the kind that leads to motion and out of it again.

mod asks;
mod moves;
mod raw;
mod setup;
mod together;
mod trouble;

pub use asks::any_ask;

use crate::action::{Action, Ask, Step};
use crate::bad_host;
use crate::dice::Dice;
use crate::plant::{
    AXES, BUS_SETUP, BUSES, CAN_BUSES, D5_AXES, LISTENER, MOTORS, RMD_AND_THRUSTER,
};
use crate::world::World;
use asks::{goal, native, permit};
use promise_model::Told;
use setup::{configuration, saved};
use std::collections::VecDeque;

/// Requests among which one is repeated: those that the gateway knows in any case. Whether it still
/// knows an older one, and so does not carry it out again, is its own affair.
const AGAIN: u8 = 8;

/// Makes the steps of one run.
pub struct Generator {
    dice: Dice,
    first: VecDeque<Action>,
    /// Which link commands, mostly.
    commander: u8,
    silent_until_us: u64,
    /// How much goes wrong: actions in a thousand.
    trouble: u64,
    /// Axes that nobody sets in motion when they are armed. Bit 0 is axis 0.
    left_armed: u16,
    /// Axes that are seldom armed.
    left_idle: u16,
    /// A bus whose axes are mostly at rest, and which is opened for raw frames.
    raw_bus: Option<u8>,
    /// How often an axis is moved to another motor, in a thousand.
    moves: u64,
    /// D5 motors are mostly set in motion several at once: their buses are exclusive.
    starts: bool,
    /// What each bus is configured for: bus 1 for D5, or for what speaks on bus 0 too, so that
    /// axes are moved between them.
    protocols: [u8; BUSES as usize],
    /// Frames of a bad host, which it may send again.
    sent: Vec<Vec<u8>>,
}

impl Generator {
    /// The steps of this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut dice = Dice::seeded(seed);
        let starts = dice.percent(50);
        let protocols = if !starts && dice.percent(60) {
            [RMD_AND_THRUSTER, RMD_AND_THRUSTER, 1, BUS_SETUP[3].1]
        } else {
            BUS_SETUP.map(|(_, spoken)| spoken)
        };
        let mut first: VecDeque<_> = configuration(&mut dice, protocols, starts).into();
        if dice.percent(40) {
            first.extend(saved(&mut dice, protocols, starts));
        }
        let trouble = if starts { dice.pick(&[2, 5, 20]) } else { dice.pick(&[5, 20, 60]) };
        let left_armed =
            if dice.percent(25) { u16::from_be_bytes([dice.byte(), dice.byte()]) } else { 0 };
        let raw_bus = dice.percent(30).then(|| dice.byte() % BUSES);
        let moves = dice.pick(&[0, 0, 4, 15]);
        let left_idle =
            if moves > 0 && !starts { u16::from_be_bytes([dice.byte(), dice.byte()]) } else { 0 };
        Self {
            dice,
            first,
            commander: 0,
            silent_until_us: 0,
            trouble,
            left_armed,
            left_idle,
            raw_bus,
            moves,
            starts,
            protocols,
            sent: Vec::new(),
        }
    }

    /// Steps that a fuzzer chooses, behind the configuration of the first seed.
    #[must_use]
    pub fn fuzzed(bytes: &[u8]) -> Self {
        let dice = Dice::Given(bytes.iter().copied().collect());
        Self { dice, ..Self::new(1) }
    }

    /// Whether the fuzzer's bytes are used up.
    #[must_use]
    pub fn is_spent(&self) -> bool {
        self.dice.is_spent()
    }

    /// What comes from the side of the hosts next: requests, repeated ones, and bytes.
    pub fn of_hosts(&mut self, world: &World) -> Step {
        self.chosen(world, |it| match it.dice.below(8) {
            0..3 => it.drive(world),
            3 => it.again(it.commander),
            4 => it.of_bystander(world),
            5 => Action::Bytes { link: it.dice.byte() % LISTENER, bytes: it.dice.bytes(40) },
            _ => it.anything(),
        })
    }

    /// What comes from the side of the buses next, while a host drives the axes.
    pub fn of_buses(&mut self, world: &World) -> Step {
        self.chosen(world, |it| match it.dice.below(8) {
            0..3 => it.drive(world),
            3 => it.stray(),
            4 => it.noise(),
            _ => it.trouble(world.since_start_us()),
        })
    }

    /// What comes next from hosts that know what a frame is and not what it does, while buses and
    /// motors fail.
    pub fn of_bad_hosts(&mut self, world: &World) -> Step {
        self.chosen(world, |it| match it.dice.below(8) {
            0..4 => bad_host::any_frame(&mut it.dice, &mut it.sent),
            4 => it.stray(),
            5 => it.drive(world),
            _ => match it.trouble(world.since_start_us()) {
                // What its frames do the model learns from their results.
                Action::Unread { link, .. } => Action::Ask { link, ask: Ask::Ping },
                action => action,
            },
        })
    }

    /// What is chosen, behind the configuration.
    fn chosen(&mut self, world: &World, choose: impl FnOnce(&mut Self) -> Action) -> Step {
        let now = world.since_start_us();
        if let Some(action) = self.first.pop_front() {
            return Step { at_us: now + 60, action };
        }
        let at_us = now + 20 * self.dice.below(256);
        Step { at_us, action: choose(self) }
    }

    /// Any frame on a CAN bus.
    fn stray(&mut self) -> Action {
        let id = u16::from_be_bytes([self.dice.byte() & 7, self.dice.byte()]);
        let data = self.dice.bytes(9);
        Action::Stray { bus: self.dice.pick(&CAN_BUSES), id: id.into(), data }
    }

    /// What happens next.
    pub fn next(&mut self, world: &World) -> Step {
        let now = world.since_start_us();
        if let Some(action) = self.first.pop_front() {
            let pause = if self.moves > 0 { self.dice.pick(&[60, 60, 60, 400]) } else { 60 };
            return Step { at_us: now + pause, action };
        }
        let at_us = now + self.dice.below(500);
        if self.dice.below(1_000) < self.trouble {
            return Step { at_us, action: self.trouble(now) };
        }
        if self.dice.below(1_000) < self.moves
            && world.reads(self.commander)
            && now >= self.silent_until_us
        {
            return Step { at_us, action: self.moves(world) };
        }
        if now < self.silent_until_us {
            // The others go on.
            let action =
                if self.dice.percent(20) { self.noise() } else { self.of_bystander(world) };
            return Step { at_us: at_us + 2_000, action };
        }
        let action = match self.dice.below(100) {
            0..80 => self.drive(world),
            // What configures takes effect in the model when its result is read.
            80..86 if world.reads(self.commander) => self.anything(),
            86..90 if world.reads(self.commander) => self.again(self.commander),
            90..94 => self.of_bystander(world),
            94..97 => self.noise(),
            _ => Action::Ask { link: self.commander, ask: Ask::Ping },
        };
        Step { at_us, action }
    }

    /// What a host does that wants an axis to move.
    fn drive(&mut self, world: &World) -> Action {
        let axis = self.axis();
        let on_raw_bus = self.raw_bus == Some(MOTORS[usize::from(axis)].bus);
        if on_raw_bus && self.dice.percent(90) && world.reads(self.commander) {
            return self.raw(world, axis);
        }
        let ask = match world.oracle().told(axis) {
            Told::Armed if self.left_armed >> axis & 1 == 1 && self.dice.percent(98) => Ask::Ping,
            told @ (Told::Armed | Told::Active) if self.starts_several(axis, told) => {
                return self.together(world, axis);
            }
            Told::Armed | Told::Active => match self.dice.below(100) {
                0..78 => Ask::Setpoint {
                    permit: permit(&mut self.dice, axis),
                    goal: goal(&mut self.dice, axis),
                },
                78..88 => self.cycle(world),
                88..93 => native(&mut self.dice, axis),
                93..96 => Ask::Move {
                    permit: permit(&mut self.dice, axis),
                    distance: self.dice.fraction(),
                    speed: 1.0,
                },
                96..98 => Ask::Read { axis },
                98 => Ask::Stop { axis },
                _ => Ask::Disarm { axis },
            },
            Told::Holding if self.dice.percent(3) => Ask::OutputOff { axis },
            Told::Unconfigured if world.reads(self.commander) && self.dice.percent(10) => {
                return self.moves_back(axis);
            }
            Told::Idle if self.moves > 0 && world.reads(self.commander) && self.dice.percent(2) => {
                return self.moves_back(axis);
            }
            Told::Idle if self.left_idle >> axis & 1 == 1 && self.dice.percent(98) => Ask::Ping,
            Told::Idle | Told::Holding => {
                if self.dice.percent(10) {
                    self.arm_together(world)
                } else if self.dice.percent(97) {
                    Ask::Arm { axis }
                } else {
                    native(&mut self.dice, axis)
                }
            }
            Told::Tripped { .. } if self.dice.percent(20) => Ask::ClearGateway,
            Told::Tripped { confirmed: true } if self.dice.percent(10) => {
                Ask::ClearByRestart { axis }
            }
            Told::Tripped { confirmed: true } => Ask::Clear { axis },
            Told::Tripped { .. } if self.dice.percent(5) => Ask::ClearUnreachable { axis },
            Told::Arming if self.dice.percent(2) => Ask::Stop { axis },
            _ => Ask::Ping,
        };
        Action::Ask { link: self.commander, ask }
    }

    /// Some of the axes, mostly such as are so.
    fn some(&mut self, world: &World, are: fn(Told) -> bool) -> Vec<u8> {
        let wanted = |it: &mut Self, axis: &u8| {
            let is_so = are(world.oracle().told(*axis));
            it.dice.percent(if is_so { 60 } else { 1 })
        };
        (0..AXES).filter(|axis| wanted(self, axis)).collect()
    }

    fn arm_together(&mut self, world: &World) -> Ask {
        let axes = self.some(world, |told| matches!(told, Told::Idle | Told::Holding));
        Ask::ArmTogether { axes: axes.into_iter().fold(0, |axes, axis| axes | 1 << axis) }
    }

    fn cycle(&mut self, world: &World) -> Ask {
        let axes = self.some(world, |told| matches!(told, Told::Armed | Told::Active));
        let lead = permit(&mut self.dice, 0);
        let members = axes.into_iter().map(|axis| (axis, goal(&mut self.dice, axis))).collect();
        Ask::Cycle { lead_us: lead.lead_us, epoch: lead.epoch, members }
    }

    /// A request of any kind, in any state.
    fn anything(&mut self) -> Action {
        if self.dice.one_in(20) {
            self.first.extend(saved(&mut self.dice, self.protocols, self.starts));
        }
        let (link, ask) = (self.commander, any_ask(&mut self.dice));
        if self.dice.one_in(4) { Action::Watch { link, ask } } else { Action::Ask { link, ask } }
    }

    /// One of the latest requests again.
    fn again(&mut self, link: u8) -> Action {
        Action::Again { link, back: self.dice.byte() % AGAIN }
    }

    /// Somebody who is not in command, and may want to be.
    fn of_bystander(&mut self, world: &World) -> Action {
        let axis = self.axis();
        let link = self.dice.pick(&[1 - self.commander, LISTENER]);
        let ask = match self.dice.below(24) {
            0 => Ask::Take,
            1 => Ask::Arm { axis },
            2..4 => Ask::Setpoint {
                permit: permit(&mut self.dice, axis),
                goal: goal(&mut self.dice, axis),
            },
            4 => native(&mut self.dice, axis),
            5 if self.dice.one_in(3) => Ask::Stop { axis },
            6 if self.dice.one_in(4) => Ask::EStop,
            7 if self.dice.one_in(3) => Ask::Disarm { axis },
            8 => Ask::Clear { axis },
            9 => Ask::Read { axis },
            10 => Ask::Status,
            11 if link != LISTENER && self.dice.one_in(4) => Ask::Hello,
            12 => Ask::RawOpen { bus: 0, unsafe_access: self.dice.percent(20) },
            14..16 => Ask::BusStatus { bus: self.dice.byte() % BUSES },
            13 => Ask::Incidents { first: self.dice.pick(&[0, 0, 8, 15, 255]) },
            16 => Ask::FlightRecord { offset: 0 },
            _ => Ask::Ping,
        };
        if self.dice.percent(10) && world.reads(link) {
            return self.again(link);
        }
        if self.dice.one_in(3) { Action::Watch { link, ask } } else { Action::Ask { link, ask } }
    }

    fn axis(&mut self) -> u8 {
        if self.starts && self.dice.percent(40) {
            return self.dice.pick(&D5_AXES);
        }
        self.dice.byte() % AXES
    }
}
