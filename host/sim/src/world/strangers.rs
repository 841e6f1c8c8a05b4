//! Who else is on the buses and on the host links: stations that do not belong there, and hosts
//! that do not read.

use std::time::Duration;

use host_protocol::CanFrame;

use super::host_link::HostLink;
use super::{TICK, World};
use crate::bus::Wire;
use crate::random::Random;

/// Sets the dice of strangers apart from those of the motors.
const STRANGERS: u64 = 1 << 63;

/// Who sends the same on a bus again and again.
pub(super) struct Strangers {
    random: Random,
    all: Vec<Stranger>,
}

struct Stranger {
    bus: u8,
    wire: Wire,
    period: Duration,
    next: Duration,
}

impl Strangers {
    pub(super) fn new(seed: u64) -> Self {
        Self { random: Random::new(seed ^ STRANGERS), all: Vec::new() }
    }

    pub(super) fn next_event(&self) -> Option<Duration> {
        self.all.iter().map(|stranger| stranger.next).min()
    }
}

impl World {
    /// A station that is neither the gateway nor a motor sends something on a bus, once,
    /// as soon as the bus is free. On RS485 nobody looks whether it is.
    pub fn send_foreign(&mut self, bus: u8, wire: Wire) {
        let now = self.now;
        if let Some(port) = self.ports.get_mut(usize::from(bus)) {
            port.send_stranger(now, wire);
        }
    }

    /// A foreign station sends this on a bus from now on, at irregular intervals of half a period
    /// to one and a half.
    pub fn repeat_foreign(&mut self, bus: u8, wire: Wire, period: Duration) {
        self.strangers.all.push(Stranger { bus, wire, period, next: self.now });
    }

    /// The foreign stations of a bus fall silent.
    pub fn hush(&mut self, bus: u8) {
        self.strangers.all.retain(|stranger| stranger.bus != bus);
        self.babble(bus, None);
    }

    /// A foreign station sends these frames on a CAN bus, one after the other, as fast as the bus
    /// takes them, until there are none.
    pub fn babble(&mut self, bus: u8, frames: impl IntoIterator<Item = CanFrame>) {
        let now = self.now;
        if let Some(port) = self.ports.get_mut(usize::from(bus)) {
            port.babble(now, frames.into_iter().collect());
        }
    }

    /// The host of a link stops reading, or reads again. While it does not, the link takes nothing
    /// more from the gateway.
    pub fn set_host_reads(&mut self, link: u8, reads: bool) {
        self.links
            .get_mut(usize::from(link))
            .into_iter()
            .for_each(|link: &mut HostLink| link.set_reads(reads));
    }

    pub(super) fn run_strangers(&mut self) {
        let Strangers { random, all } = &mut self.strangers;
        for stranger in all.iter_mut().filter(|stranger| stranger.next <= self.now) {
            if let Some(port) = self.ports.get_mut(usize::from(stranger.bus)) {
                port.send_stranger(self.now, stranger.wire.clone());
            }
            stranger.next =
                self.now + random.between(stranger.period / 2, stranger.period * 3 / 2).max(TICK);
        }
    }

    pub(super) fn go_on_babbling(&mut self, bus: u8) {
        let now = self.now;
        if let Some(port) = self.ports.get_mut(usize::from(bus)) {
            port.go_on_babbling(now);
        }
    }
}
