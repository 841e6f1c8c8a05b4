//! Who else is on the buses and on the host links: stations that do not belong there, and hosts that do not read.

use host_protocol::CanFrame;

use super::World;
use super::host_link::HostLink;
use crate::bus::Wire;

impl World {
    /// Somebody who belongs to neither the gateway nor the motors sends something on a bus, once, as soon as the bus is
    /// free. On RS485 nobody looks whether it is.
    pub fn send_foreign(&mut self, bus: u8, wire: Wire) {
        let now = self.now;
        if let Some(port) = self.ports.get_mut(usize::from(bus)) {
            port.send_stranger(now, wire);
        }
    }

    /// Somebody sends these frames on a CAN bus, one after the other, as fast as the bus takes them, until there are none.
    pub fn babble(&mut self, bus: u8, frames: impl IntoIterator<Item = CanFrame>) {
        let now = self.now;
        if let Some(port) = self.ports.get_mut(usize::from(bus)) {
            port.babble(now, frames.into_iter().collect());
        }
    }

    /// The host of a link stops reading, or reads again. While it does not, the link takes nothing more from the gateway.
    pub fn set_host_reads(&mut self, link: u8, reads: bool) {
        self.links
            .get_mut(usize::from(link))
            .into_iter()
            .for_each(|link: &mut HostLink| link.set_reads(reads));
    }

    pub(super) fn go_on_babbling(&mut self, bus: u8) {
        let now = self.now;
        if let Some(port) = self.ports.get_mut(usize::from(bus)) {
            port.go_on_babbling(now);
        }
    }
}
