//! Random steps, mostly of the kind that leads to motion and out of it again.

use crate::action::{Action, Ask, Does, Goal, Number, Permit, Step};
use crate::dice::Dice;
use crate::plant::{BUSES, LISTENER, MOTORS, POSITION_DEVICE};
use crate::world::World;
use host_protocol::{AxisParameter, Protocol};
use promise_model::Told;
use std::collections::VecDeque;

/// Longest silence of the hosts, µs: more than the gateway bears.
const SILENCE_US: u64 = 400_000;

/// Requests among which one is repeated: those that the gateway knows in any case. Whether it still knows an older one, and
/// so does not carry it out again, is its own affair.
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
}

impl Generator {
    /// The steps of this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut dice = Dice::Seeded(seed);
        let first = configuration(&mut dice).into();
        let trouble = dice.pick(&[5, 20, 60]);
        Self { dice, first, commander: 0, silent_until_us: 0, trouble }
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
        if let Some(action) = self.first.pop_front() {
            return Step { at_us: world.since_start_us() + 60, action };
        }
        let at_us = world.since_start_us() + 20 * self.dice.below(256);
        let action = match self.dice.below(8) {
            0..3 => self.drive(world),
            3 => self.again(self.commander),
            4 => self.of_bystander(world),
            5 => Action::Bytes { link: self.dice.byte() % LISTENER, bytes: self.dice.bytes(40) },
            _ => self.anything(),
        };
        Step { at_us, action }
    }

    /// What comes from the side of the buses next, while a host drives the axes.
    pub fn of_buses(&mut self, world: &World) -> Step {
        if let Some(action) = self.first.pop_front() {
            return Step { at_us: world.since_start_us() + 60, action };
        }
        let at_us = world.since_start_us() + 20 * self.dice.below(256);
        let action = match self.dice.below(8) {
            0..3 => self.drive(world),
            3 => {
                let id = [self.dice.byte() & 7, self.dice.byte()];
                let data = self.dice.bytes(9);
                Action::Stray { bus: self.dice.byte() % 2, id: u16::from_be_bytes(id), data }
            }
            4 => self.noise(),
            _ => self.trouble(world.since_start_us()),
        };
        Step { at_us, action }
    }

    /// What happens next.
    pub fn next(&mut self, world: &World) -> Step {
        let now = world.since_start_us();
        if let Some(action) = self.first.pop_front() {
            return Step { at_us: now + 60, action };
        }
        let at_us = now + self.dice.below(500);
        if self.dice.below(1_000) < self.trouble {
            return Step { at_us, action: self.trouble(now) };
        }
        if now < self.silent_until_us {
            // The others go on.
            let action = if self.dice.percent(20) { self.noise() } else { self.of_bystander(world) };
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
        let ask = match world.oracle().told(axis) {
            Told::Armed | Told::Active => match self.dice.below(100) {
                0..88 => {
                    Ask::Setpoint { permit: permit(&mut self.dice, axis), goal: goal(&mut self.dice, axis) }
                }
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
            Told::Idle => {
                if self.dice.percent(97) {
                    Ask::Arm { axis }
                } else {
                    native(&mut self.dice, axis)
                }
            }
            Told::Tripped { .. } if self.dice.percent(20) => Ask::ClearGateway,
            Told::Tripped { confirmed: true } => Ask::Clear { axis },
            Told::Tripped { .. } if self.dice.percent(5) => Ask::ClearUnreachable { axis },
            Told::Arming if self.dice.percent(2) => Ask::Stop { axis },
            _ => Ask::Ping,
        };
        Action::Ask { link: self.commander, ask }
    }

    /// A request of any kind, in any state.
    fn anything(&mut self) -> Action {
        Action::Ask { link: self.commander, ask: any_ask(&mut self.dice) }
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
            2..4 => Ask::Setpoint { permit: permit(&mut self.dice, axis), goal: goal(&mut self.dice, axis) },
            4 => native(&mut self.dice, axis),
            5 if self.dice.one_in(3) => Ask::Stop { axis },
            6 if self.dice.one_in(4) => Ask::EStop,
            7 if self.dice.one_in(3) => Ask::Disarm { axis },
            8 => Ask::Clear { axis },
            9 => Ask::Read { axis },
            10 => Ask::Status,
            11 if link != LISTENER && self.dice.one_in(4) => Ask::Hello,
            12 => Ask::RawOpen { bus: 0 },
            _ => Ask::Ping,
        };
        if self.dice.percent(10) && world.reads(link) {
            return self.again(link);
        }
        Action::Ask { link, ask }
    }

    /// Bytes and frames that mean nothing, or look as if they did.
    fn noise(&mut self) -> Action {
        match self.dice.below(4) {
            0 => Action::Bytes { link: self.dice.byte() % LISTENER, bytes: self.dice.bytes(40) },
            1 => Action::Noise { bus: BUSES - 1, bytes: self.dice.bytes(16) },
            _ => {
                let bus = self.dice.byte() % 2;
                let id = self
                    .dice
                    .pick(&[0x241, 0x242, 0x243, 0x28E, 0x28F, 0x290, 0x26, 0x27, 0x501, 0x7FF, 0x001]);
                let mut data = self.dice.bytes(9);
                if let Some(first) = data.first_mut().filter(|_| id < 0x280) {
                    *first = self.dice.pick(&[0x80, 0x81, 0x9A, 0x9C, 0xA2, 0x5D]);
                }
                Action::Stray { bus, id, data }
            }
        }
    }

    /// Something breaks.
    fn trouble(&mut self, now: u64) -> Action {
        let bus = self.dice.byte() % 2;
        let motor = self.axis();
        match self.dice.below(20) {
            0 if self.dice.percent(40) => {
                self.silent_until_us = now + self.dice.below(SILENCE_US);
                if self.dice.percent(40) {
                    self.commander = 1 - self.commander;
                }
                Action::Ask { link: self.commander, ask: Ask::Ping }
            }
            1 if self.dice.percent(40) => Action::Cut { bus, for_us: self.span() },
            2 if self.dice.percent(30) => Action::Short { bus, for_us: self.span() },
            3 => {
                let id = self.dice.pick(&[0x001, 0x250, 0x7FF]);
                let pause_us = self.dice.pick(&[140, 200, 700, 1_500]);
                Action::Foreign { bus, id, pause_us, for_us: self.dice.below(30_000) }
            }
            4 => Action::Stubborn { bus, for_us: self.dice.below(50_000) },
            5 => Action::Overflow { bus: self.dice.byte() % BUSES },
            6 => {
                // Never the one that all depends on.
                Action::Unread { link: self.dice.byte() % LISTENER, for_us: self.dice.below(50_000) }
            }
            7 if self.dice.percent(30) => Action::EStopInput { open: self.dice.percent(50) },
            8..13 => Action::EStopInput { open: false },
            _ => Action::Motor { motor, does: self.misdeed(motor) },
        }
    }

    fn misdeed(&mut self, motor: u8) -> Does {
        match self.dice.below(16) {
            0 => Does::Mute { for_us: self.span() },
            1 => Does::Deaf { for_us: self.span() },
            2..5 => Does::Late { by_us: self.dice.below(12_000) },
            5..7 => Does::Twice,
            7..9 => {
                let mut data = self.dice.bytes(9);
                match (MOTORS[usize::from(motor)].protocol, data.first_mut()) {
                    (Protocol::Rmd, Some(first)) => *first = self.dice.pick(&[0x80, 0x81, 0x9A, 0x9C, 0x92]),
                    (_, Some(first)) => *first = self.dice.pick(&[0x5D, b'Q', b'E', b'T']),
                    _ => {}
                }
                Does::Lies { data }
            }
            9..11 => Does::Refuses,
            11 => Does::Faults { word: self.dice.pick(&[0, 2, 4, 0x40]) },
            12 | 13 => Does::Faults { word: 0 },
            14 => self.dice.pick(&[Does::Restarts, Does::Turns { speed: 90.0 }]),
            _ => Does::Disobeys { for_us: self.span() },
        }
    }

    fn span(&mut self) -> u64 {
        let longest = self.dice.pick(&[5_000, 60_000, 300_000, 2_000_000]);
        self.dice.below(longest)
    }

    fn axis(&mut self) -> u8 {
        self.dice.byte() % 10
    }
}

/// A request of any kind.
pub fn any_ask(dice: &mut Dice) -> Ask {
    let axis = dice.byte() % 10;
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
        20 => Ask::Provision { axis, timeout_ms: dice.pick(&[0, 1, 99, 100, 300]) },
        21 => Ask::Set { axis, parameter: dice.pick(&[6, 8, 9, 13]), value: Number::Unsigned(100_000) },
        22 => Ask::Set { axis, parameter: 14, value: Number::Float(dice.fraction() * 20.0) },
        23 => Ask::Bus { bus, window_us: dice.pick(&[1_000, 3_000, 5_000]) },
        24 => Ask::Remove { axis: 31 },
        25 => Ask::Subscribe { axes: dice.pick(&[0, 1, 0x3FF]), period_us: 50_000 },
        26..28 => Ask::Read { axis },
        28 => Ask::Status,
        29 => Ask::RawOpen { bus },
        30..33 => {
            let id = dice.pick(&[0x700, 0x141, 0x30E, 0x26, 0x7FF]);
            Ask::RawSend { bus, id, data: raw_data(dice) }
        }
        33 => Ask::RawReceive { bus },
        34..36 => Ask::RawClose { bus },
        36 => Ask::ClearUnreachable { axis },
        37 => Ask::Clear { axis },
        _ => Ask::Ping,
    }
}

/// Mostly in good time and for the right epoch.
fn permit(dice: &mut Dice, axis: u8) -> Permit {
    let epoch = if dice.percent(97) { 0 } else { dice.pick(&[-1, -2, 1000]) };
    let lead_us = match dice.below(50) {
        0 => dice.pick(&[0, -1, -5_000, i32::MIN, 1, 200_001, 61_000_000]),
        1..4 => dice.pick(&[2_000, 10_000]),
        _ => 48_000,
    };
    Permit { axis, epoch, lead_us }
}

fn goal(dice: &mut Dice, axis: u8) -> Goal {
    let value = match dice.below(60) {
        0 => f32::NAN,
        1 => 1e30,
        2 => 0.0,
        _ => dice.fraction() * 4.0,
    };
    match MOTORS[usize::from(axis)].protocol {
        _ if dice.percent(3) => Goal::Current(value),
        Protocol::Thruster if axis == POSITION_DEVICE && dice.percent(30) => Goal::Position(value, 10.0),
        Protocol::Thruster => dice.pick(&[Goal::Signal(value / 5.0), Goal::Velocity(value * 3.0)]),
        Protocol::D5 => Goal::Velocity(value),
        Protocol::Rmd => dice.pick(&[
            Goal::Velocity(value),
            Goal::Velocity(value),
            Goal::Current(value),
            Goal::Position(value, 1.0),
            Goal::Impedance(value),
        ]),
    }
}

/// A command of the manual, or bytes that are none.
fn native(dice: &mut Dice, axis: u8) -> Ask {
    let motor = &MOTORS[usize::from(axis)];
    let data = match motor.protocol {
        _ if dice.percent(5) => dice.bytes(9),
        Protocol::Rmd => {
            let command = dice.pick(&[
                0x30, 0x43, 0x64, 0x70, 0x77, 0x78, 0x80, 0x81, 0x92, 0x9A, 0xA1, 0xA2, 0xA4, 0xA8, 0xA8,
            ]);
            vec![command, 0, dice.byte(), 0, dice.byte(), dice.byte(), 0, 0]
        }
        Protocol::Thruster => {
            let [a, b] = *dice.pick(&[b"TC", b"VC", b"QV", b"EF", b"LA", b"LR", b"LR", b"LS", b"ST", b"MQ"]);
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

/// Data of a raw frame, which move no motor.
fn raw_data(dice: &mut Dice) -> Vec<u8> {
    let mut data = dice.bytes(9);
    if let Some(first) = data.first_mut() {
        *first = dice.pick(&[0x9A, 0x9C, 0x81, 0x3E, 0x51]);
    }
    data
}

/// What the first host sets up.
fn configuration(dice: &mut Dice) -> Vec<Action> {
    let mut asks = vec![Ask::Hello, Ask::Silence { us: dice.pick(&[100_000, 250_000]) }];
    asks.extend((0..BUSES).map(|bus| Ask::Bus { bus, window_us: dice.pick(&[2_000, 3_000, 5_000]) }));
    let grouped = dice.percent(30);
    let provisioned = dice.percent(40);
    for (axis, motor) in (0u8..).zip(&MOTORS) {
        let mut set = |parameter: AxisParameter, value: Number| {
            asks.push(Ask::Set { axis, parameter: parameter.number(), value });
        };
        set(AxisParameter::Bus, Number::Unsigned(motor.bus.into()));
        set(AxisParameter::Protocol, Number::Unsigned(motor.protocol.number().into()));
        set(AxisParameter::Node, Number::Unsigned(motor.node.into()));
        set(AxisParameter::StopAction, Number::Unsigned(motor.stop.number().into()));
        set(AxisParameter::AllowUnknownMotorTimeout, Number::Bool(true));
        set(AxisParameter::TtlUs, Number::Unsigned(dice.pick(&[50_000, 100_000, 200_000])));
        if dice.percent(20) {
            set(AxisParameter::VelocityLimitRadS, Number::Float(3.0));
        }
        if grouped && axis < 4 {
            set(AxisParameter::TripGroup, Number::Unsigned(1));
        }
        if axis == POSITION_DEVICE {
            set(AxisParameter::PositionDevice, Number::Bool(true));
        }
        if axis == 2 && dice.percent(50) {
            set(AxisParameter::ReleaseBrakeWhenArming, Number::Bool(true));
        }
        if dice.percent(20) {
            set(AxisParameter::Direction, Number::Signed(-1));
        }
        if provisioned {
            asks.push(Ask::Provision { axis, timeout_ms: dice.pick(&[200, 500]) });
        }
    }
    asks.into_iter().map(|ask| Action::Ask { link: 0, ask }).collect()
}
