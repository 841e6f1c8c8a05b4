//! The controllers, the lines and the cables: what is on its way, and when it arrives.

use super::dice::Dice;
use super::plant::{AXES, BUSES, FromMotor, ToMotor};
use gateway::{Outgoing, Transmit};

const RS485: u8 = 2;

/// A frame that the port has taken.
pub struct Held {
    pub bus: u8,
    pub slot: u8,
    pub frame: Outgoing,
    leaves_at_us: u64,
}

/// A reply on its way.
struct Coming {
    at_us: u64,
    reply: FromMotor,
}

#[derive(Default)]
pub struct Port {
    held: Vec<Held>,
    coming: Vec<Coming>,
    /// Until when a cable is cut; nothing leaves a CAN controller before.
    mended_at_us: [u64; BUSES],
    mute: [bool; AXES],
    /// The setup with which each bus was started last.
    pub generations: [Option<u32>; BUSES],
}

impl Port {
    /// Takes a frame, into a slot that must be free.
    pub fn take(&mut self, now_us: u64, bus: u8, transmit: Transmit, dice: &mut Dice) {
        let Transmit { slot, frame } = transmit;
        let is_taken = self.held.iter().any(|held| (held.bus, held.slot) == (bus, slot));
        assert!(!is_taken, "slot {slot} of bus {bus} is handed out twice");
        let frame_us = if bus == RS485 { 65 } else { 135 };
        let leaves_at_us = self.mended_at(bus).max(now_us) + frame_us + dice.below(20);
        self.held.push(Held { bus, slot, frame, leaves_at_us });
    }

    /// Gives back a frame that is not on the wire yet; whether it was one.
    pub fn give_back(&mut self, now_us: u64, bus: u8, slot: u8) -> bool {
        const ON_THE_WIRE_US: u64 = 160;
        let held = self.held.len();
        let is_back = |held: &Held| {
            (held.bus, held.slot) == (bus, slot) && held.leaves_at_us > now_us + ON_THE_WIRE_US
        };
        self.held.retain(|held| !is_back(held));
        self.held.len() < held
    }

    /// Drops what a bus holds.
    pub fn drop_frames(&mut self, bus: u8) {
        self.held.retain(|held| held.bus != bus);
    }

    /// Cuts the cable of a CAN bus for a while.
    pub fn cut(&mut self, now_us: u64, bus: u8, for_us: u64) {
        let mended_at_us = now_us + for_us;
        self.mended_at_us[usize::from(bus)] = mended_at_us;
        for held in self.held.iter_mut().filter(|held| held.bus == bus) {
            held.leaves_at_us = held.leaves_at_us.max(mended_at_us);
        }
        self.coming.retain(|coming| coming.reply.bus() != bus);
    }

    fn mended_at(&self, bus: u8) -> u64 {
        self.mended_at_us[usize::from(bus)]
    }

    /// Makes a motor deaf and dumb, or wakes it.
    pub fn set_mute(&mut self, axis: usize, mute: bool) {
        self.mute[axis] = mute;
    }

    /// Every cable is whole and every motor awake.
    pub fn mend(&mut self) {
        self.mended_at_us = [0; BUSES];
        self.mute = [false; AXES];
        for held in &mut self.held {
            held.leaves_at_us = 0;
        }
    }

    /// When the next thing arrives.
    pub fn next_us(&self) -> Option<u64> {
        let leaving = self.held.iter().map(|held| held.leaves_at_us);
        leaving.chain(self.coming.iter().map(|coming| coming.at_us)).min()
    }

    /// A frame that has left; its motor may answer, late or twice too.
    pub fn left(&mut self, now_us: u64, dice: &mut Dice) -> Option<Held> {
        let index = self.held.iter().position(|held| held.leaves_at_us <= now_us)?;
        let held = self.held.remove(index);
        let request =
            ToMotor::read(held.bus, &held.frame).filter(|request| !self.mute[request.axis]);
        if let Some(reply) = request.and_then(|request| request.reply(now_us, dice)) {
            let late_us = if dice.percent(3) { dice.below(9_000) } else { 0 };
            if dice.percent(2) {
                let at_us = now_us + 400 + dice.below(5_000);
                self.coming.push(Coming { at_us, reply: reply.clone() });
            }
            self.coming.push(Coming { at_us: now_us + 200 + late_us, reply });
        }
        Some(held)
    }

    /// A reply that has arrived.
    pub fn arrived(&mut self, now_us: u64) -> Option<FromMotor> {
        let index = self.coming.iter().position(|coming| coming.at_us <= now_us)?;
        Some(self.coming.remove(index).reply)
    }
}
