//! What goes wrong: buses, motors, hosts that fall silent.

use super::Generator;
use super::setup::{DIALECTS, RETURN_MODES, configuration, saved};
use crate::action::{Action, Ask, Does};
use crate::plant::{BUSES, CAN_BUSES, LINE, LISTENER, MOTORS, extended_id};
use host_protocol::Protocol;
use promise_model::EXTENDED;

/// Longest silence of the hosts, µs: more than the gateway bears.
const SILENCE_US: u64 = 400_000;

impl Generator {
    /// Bytes and frames that mean nothing, or look as if they did.
    pub(super) fn noise(&mut self) -> Action {
        match self.dice.below(4) {
            0 => Action::Bytes { link: self.dice.byte() % LISTENER, bytes: self.dice.bytes(40) },
            1 => Action::Noise { bus: LINE, bytes: self.dice.bytes(16) },
            _ => {
                let bus = self.dice.pick(&CAN_BUSES);
                let id = self.dice.pick(&[
                    0x241,
                    0x242,
                    0x243,
                    0x28E,
                    0x28F,
                    0x290,
                    0x26,
                    0x27,
                    0x501,
                    0x7FF,
                    0x001,
                    extended_id(0x26),
                ]);
                let mut data = self.dice.bytes(9);
                if let Some(first) = data.first_mut().filter(|_| id < 0x280) {
                    *first = self.dice.pick(&[0x80, 0x81, 0x9A, 0x9C, 0xA2, 0x5D]);
                }
                Action::Stray { bus, id, data }
            }
        }
    }

    /// Something breaks.
    pub(super) fn trouble(&mut self, now: u64) -> Action {
        let bus = self.dice.pick(&CAN_BUSES);
        let motor = self.axis();
        match self.dice.below(20) {
            0 if self.dice.percent(40) => {
                self.silent_until_us = now + self.dice.below(SILENCE_US);
                if self.dice.percent(40) {
                    self.commander = 1 - self.commander;
                }
                Action::Ask { link: self.commander, ask: Ask::Ping }
            }
            0 => self.load(bus),
            1 if self.dice.percent(40) => Action::Cut { bus, for_us: self.span() },
            2 if self.dice.percent(30) => Action::Short { bus, for_us: self.span() },
            3 => self.load(bus),
            4 => Action::Stubborn { bus, for_us: self.dice.below(50_000) },
            5 => Action::Overflow { bus: self.dice.byte() % BUSES },
            13 if self.dice.percent(20) => Action::Errors {
                bus,
                transmit: self.dice.byte().into(),
                receive: self.dice.byte().into(),
            },
            13 if self.dice.percent(20) => {
                // No frame is taken with such a slot, and there are fewer buses.
                let (bus, slot) = (self.dice.byte() % (BUSES + 2), self.dice.byte().max(2));
                Action::StraySlot { bus, slot }
            }
            13 if self.dice.percent(20) => Action::ClockBack { by_us: self.dice.below(100_000) },
            6 => {
                // Never the one that all depends on.
                Action::Unread {
                    link: self.dice.byte() % LISTENER,
                    for_us: self.dice.below(50_000),
                }
            }
            7 if self.dice.percent(30) => Action::EStopInput { open: self.dice.percent(50) },
            7 if self.dice.percent(50) => self.start(),
            8..13 => Action::EStopInput { open: false },
            _ => Action::Motor { motor, does: self.misdeed(motor) },
        }
    }

    /// The gateway starts anew; after a loss of power a host sets it up again.
    fn start(&mut self) -> Action {
        match self.dice.below(8) {
            0 => {
                self.first = configuration(&mut self.dice, self.protocols, self.starts).into();
                if self.dice.percent(30) {
                    self.first.extend(saved(&mut self.dice, self.protocols, self.starts));
                }
                Action::PowerLoss
            }
            1 => {
                let words = 1 + self.dice.byte() % 3;
                self.first.push_back(Action::DamagingReset { words });
                Action::Ask { link: self.commander, ask: Ask::EStop }
            }
            2 => Action::Reset,
            3..6 => Action::ResetAfter { steps: u32::from(self.dice.byte() % 24) },
            _ => Action::ResetWhileSaving {
                words: 1 + u32::from(self.dice.byte()) % 40,
                garbles: self.dice.percent(50),
            },
        }
    }

    fn misdeed(&mut self, motor: u8) -> Does {
        let turns = Does::Turns { speed: self.dice.pick(&[90.0, 400.0]), for_us: self.span() };
        match MOTORS[usize::from(motor)].protocol {
            Protocol::D5 if self.dice.percent(15) => {
                return Does::AnswersOthers { on: self.dice.percent(60) };
            }
            Protocol::D5 if self.dice.percent(15) => {
                return Does::Waits { speed: self.dice.pick(&[0.0, 90.0, -400.0]) };
            }
            Protocol::Rmd if self.dice.percent(5) => {
                return Does::Speaks { dialect: self.dice.pick(&DIALECTS) };
            }
            Protocol::Thruster if self.dice.percent(3) => {
                return Does::Returns { mode: self.dice.pick(&RETURN_MODES) };
            }
            _ => {}
        }
        match self.dice.below(16) {
            0 => Does::Mute { for_us: self.span() },
            1 => Does::Deaf { for_us: self.span() },
            2..5 => Does::Late { by_us: self.dice.below(12_000) },
            5..7 => Does::Twice,
            7..9 => {
                let mut data = self.dice.bytes(9);
                match (MOTORS[usize::from(motor)].protocol, data.first_mut()) {
                    (Protocol::Rmd, Some(first)) => {
                        *first = self.dice.pick(&[0x80, 0x81, 0x9A, 0x9C, 0x92])
                    }
                    (_, Some(first)) => *first = self.dice.pick(&[0x5D, b'Q', b'E', b'T']),
                    _ => {}
                }
                Does::Lies { data }
            }
            9..11 => Does::Refuses,
            11 => Does::Faults { word: self.dice.pick(&[0, 2, 4, 0x40, 0x1018, 0x1100]) },
            12 | 13 => Does::Faults { word: 0 },
            14 => self.dice.pick(&[
                Does::Restarts,
                turns.clone(),
                turns,
                Does::Off { for_us: 1_500_000 },
            ]),
            _ => Does::Disobeys { for_us: self.span() },
        }
    }

    /// Other nodes load a CAN bus: with an id below all of ours, above, or between two of them, in
    /// frames of any length, with pauses or without, one node or two.
    fn load(&mut self, bus: u8) -> Action {
        let mut ids: Vec<u32> = MOTORS
            .iter()
            .filter(|motor| motor.bus == bus)
            .flat_map(ids_of)
            .chain([0, 0x7FE])
            .collect();
        ids.sort_unstable();
        let beside: Vec<u32> = ids[..ids.len() - 1].to_vec();
        let id = self.dice.pick(&beside) + 1;
        // The same place among ids of 29 bits: behind those of 11 up to there.
        let id = if self.dice.percent(15) { EXTENDED | id << 18 } else { id };
        let pause_us = self.dice.pick(&[0, 0, 20, 140, 700, 1_500]);
        let longest = self.dice.pick(&[3_000, 30_000, 300_000]);
        let action = Action::Foreign {
            bus,
            id,
            length: self.dice.byte() % 9,
            pause_us,
            for_us: self.dice.below(longest),
        };
        if self.dice.percent(25) {
            self.first.push_back(action.clone());
        }
        if self.dice.percent(30) {
            let ask = self.dice.pick(&[Ask::EStop, Ask::StopAll]);
            self.first.push_back(Action::Ask { link: self.commander, ask });
        }
        action
    }

    fn span(&mut self) -> u64 {
        let longest = self.dice.pick(&[5_000, 60_000, 300_000, 2_000_000]);
        self.dice.below(longest)
    }
}

/// The ids of a motor's requests and replies.
fn ids_of(motor: &crate::plant::Wired) -> Vec<u32> {
    let node = u32::from(motor.node);
    match motor.protocol {
        Protocol::Rmd => vec![0x140 + node, 0x240 + node, 0x400 + node],
        Protocol::Thruster => vec![0x300 + node, 0x280 + node],
        Protocol::D5 => vec![node],
    }
}
