//! The host links of a board: its UARTs, numbered first, then USB.

use embassy_executor::Spawner;
use gateway::LinkPort;

use super::serial::HOST_BAUDS;
use super::{HOST_UARTS, UsbPort};
use crate::line::{Receiver, Sender};
use crate::shared_gateway::SharedGateway;
use crate::tasks;

/// The number of the USB's link.
#[expect(clippy::cast_possible_truncation, reason = "a handful")]
const USB_LINK: u8 = HOST_UARTS as u8;

/// The host links, set up and not yet served.
pub struct HostLinks {
    pub uarts: [(Receiver, Sender); HOST_UARTS],
    pub usb: UsbPort,
}

impl HostLinks {
    /// The rates of each.
    pub const PORTS: [LinkPort; HOST_UARTS + 1] = {
        let mut ports = [LinkPort { bauds: &HOST_BAUDS }; HOST_UARTS + 1];
        ports[USB_LINK as usize] = LinkPort { bauds: &[] };
        ports
    };

    /// Starts the tasks of every host link.
    pub fn spawn(self, spawner: Spawner, gateway: &'static SharedGateway) {
        for (link, (receiver, sender)) in (0..).zip(self.uarts) {
            spawner.spawn(defmt::unwrap!(tasks::host::receive(gateway, link, receiver)));
            spawner.spawn(defmt::unwrap!(tasks::host::send(gateway, link, sender)));
        }
        spawner.spawn(defmt::unwrap!(tasks::usb::usb(gateway, USB_LINK, self.usb, spawner)));
    }
}
