//! What a board has for motors and hosts, set up and not yet served.

use embassy_executor::Spawner;
use embassy_stm32::exti::ExtiInput;
use embassy_stm32::gpio::Output;
use embassy_stm32::mode::Async;

use super::CAN_BUSES;
use super::host_links::HostLinks;
use crate::fdcan::CanPort;
use crate::line::{Receiver, Sender};
use crate::shared_gateway::SharedGateway;
use crate::tasks;

/// The number of the RS485 bus, which comes behind those of CAN.
#[expect(clippy::cast_possible_truncation, reason = "a handful")]
const RS485_BUS: u8 = CAN_BUSES as u8;

/// The ports of a board.
pub struct Ports {
    pub can: [&'static mut (dyn CanPort + Send); CAN_BUSES],
    pub rs485: (Receiver, Sender),
    pub hosts: HostLinks,
    pub e_stop: ExtiInput<'static, Async>,
    pub light: Output<'static>,
}

impl Ports {
    /// Starts what stops motors: the tasks of the e-stop input and of the buses. Returns what comes
    /// after that.
    pub fn spawn(self, spawner: Spawner, gateway: &'static SharedGateway) -> HostLinks {
        spawner.spawn(defmt::unwrap!(tasks::light::light(gateway, self.light)));
        spawner.spawn(defmt::unwrap!(tasks::safety::e_stop(gateway, self.e_stop)));
        for (bus, port) in (0..).zip(self.can) {
            gateway.add_can(bus, port);
        }
        spawner.spawn(defmt::unwrap!(tasks::can::can(gateway)));
        let (receiver, sender) = self.rs485;
        spawner.spawn(defmt::unwrap!(tasks::rs485::rs485(gateway, RS485_BUS, receiver, sender)));
        self.hosts
    }
}

/// A [`CanPort`] that lasts: the controller and its pins out of the chip's `$peripherals`.
macro_rules! can_port {
    ($peripherals:ident, $controller:ident, rx $rx:ident, tx $tx:ident) => {{
        static PORT: StaticCell<FdcanPort<$controller, $rx, $tx, Irqs>> = StaticCell::new();
        PORT.init(FdcanPort {
            controller: $peripherals.$controller,
            rx: $peripherals.$rx,
            tx: $peripherals.$tx,
            irqs: Irqs,
        })
    }};
}
pub(super) use can_port;
