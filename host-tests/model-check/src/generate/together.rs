//! D5 motors that are set in motion several at once.

use super::Generator;
use super::setup::LIMITS;
use crate::action::{Action, Ask};
use crate::plant::{D5_AXES, MOTORS};
use crate::world::World;
use host_protocol::Protocol;
use promise_model::Told;

impl Generator {
    /// Whether a host that drives this axis now sets several in motion. One that moves by itself
    /// goes on mostly.
    pub(super) fn starts_several(&mut self, axis: u8, told: Told) -> bool {
        let chance = match told {
            Told::Armed if self.starts => 90,
            Told::Active if self.starts => 20,
            _ => 1,
        };
        MOTORS[usize::from(axis)].protocol == Protocol::D5 && self.dice.percent(chance)
    }

    /// Two or more of those that are armed start together, mostly; else a host waits until they
    /// are.
    pub(super) fn together(&mut self, world: &World, axis: u8) -> Action {
        let may_move = |axis: &u8| matches!(world.oracle().told(*axis), Told::Armed | Told::Active);
        let armed: Vec<u8> =
            D5_AXES.into_iter().filter(|axis| may_move(axis) || self.dice.percent(2)).collect();
        let mut members: Vec<u8> =
            armed.iter().copied().filter(|_| self.dice.percent(85)).collect();
        // Beside one that is on its way to another state no start is taken.
        let unsettled = |axis: &u8| {
            let told = world.oracle().told(*axis);
            matches!(told, Told::Arming | Told::Stopping | Told::Tripped { .. })
        };
        let waits = D5_AXES.iter().any(unsettled);
        if (waits || members.len() < 2) && self.dice.percent(95) {
            let may_arm = |other: &u8| match world.oracle().told(*other) {
                Told::Idle | Told::Holding => members.len() < 2,
                told => matches!(told, Told::Tripped { confirmed: true }),
            };
            let others: Vec<u8> = D5_AXES.into_iter().filter(may_arm).collect();
            let ask = match others.is_empty() {
                true => Ask::Ping,
                false => {
                    let axis = self.dice.pick(&others);
                    let is_tripped = matches!(world.oracle().told(axis), Told::Tripped { .. });
                    if is_tripped { Ask::Clear { axis } } else { Ask::Arm { axis } }
                }
            };
            return Action::Ask { link: self.commander, ask };
        }
        if self.dice.percent(2) {
            members.push(self.dice.pick(&[axis, 0, 3]));
        }
        let lead_us = match self.dice.below(10) {
            0 => self.dice.pick(&[-1, 300_000]),
            1 => self.dice.pick(&[20_000, 8_000, 2_000]),
            _ => 48_000,
        };
        let members = members.into_iter().map(|axis| {
            let epoch = if self.dice.percent(98) { 0 } else { -1 };
            let speed = match self.dice.below(60) {
                0..3 => 0.0,
                3 => f32::NAN,
                4..8 => self.dice.pick(&LIMITS),
                _ => self.dice.fraction() * 4.0,
            };
            (axis, epoch, speed)
        });
        let members = members.collect();
        // What may happen before they have started.
        if self.dice.percent(10) {
            let later = (0..self.dice.below(80)).map(|_| Ask::Ping);
            self.first.extend(later.map(|ask| Action::Ask { link: self.commander, ask }));
            let ask = match self.dice.below(8) {
                0 => Ask::EStop,
                1 => Ask::StopAll,
                _ => self.dice.pick(&[Ask::Stop { axis }, Ask::Disarm { axis }]),
            };
            self.first.push_back(Action::Ask { link: self.commander, ask });
        }
        Action::Ask { link: self.commander, ask: Ask::Together { lead_us, members } }
    }
}
