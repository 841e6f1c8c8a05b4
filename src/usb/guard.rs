//! Stands between the USB stack and the chip's driver.
//!
//! The stack passes the host's endpoint numbers on as they are, and the drivers panic at one that
//! the chip does not have; here they reach the driver only if the device has that endpoint. And the
//! stack never lets another task run while the driver has events; here each waits for the next
//! round.
//!
//! A packet that the host has not fetched when it resets the bus, or after an unplugged cable is
//! plugged in again, keeps an endpoint of the OTG controller busy for ever: the stack switches no
//! endpoint off at a reset. Here all are.
//!
//! While a control transfer is under way the stack takes nothing of the bus, and would wait for ever
//! for a host that has gone in the middle of one: each of its stages ends by itself.
//!
//! An endpoint that the host halts no more, or configures again, must begin with DATA0 (USB 2.0
//! §9.4.5, §9.1.1.5). The drivers leave its toggle as it is, so that a packet would be lost, and
//! the one of the controller with packet memory never returns from ending a halt that is none.

use embassy_futures::yield_now;
use embassy_time::{Duration, with_timeout};
use embassy_usb::driver::{
    Bus, ControlPipe, Driver, EndpointAddress, EndpointAllocError, EndpointError, EndpointInfo,
    EndpointType, Event, Unsupported,
};
use embassy_usb::driver::{Direction, Endpoint as _};

use crate::board;

/// The longest that a packet of a control transfer may take (USB 2.0 §9.2.6.4).
const STAGE: Duration = Duration::from_millis(500);

/// The endpoints that a device has, one bit each: IN above OUT.
#[derive(Clone, Copy, Default)]
struct Endpoints(u32);

impl Endpoints {
    fn bit(address: EndpointAddress) -> u32 {
        // Endpoint numbers have four bits.
        let number = 1u32 << (address.index() % 16);
        match address.direction() {
            Direction::Out => number,
            Direction::In => number << 16,
        }
    }

    fn add(&mut self, info: &EndpointInfo) {
        self.0 |= Self::bit(info.addr);
    }

    /// Their addresses.
    fn addresses(self) -> impl Iterator<Item = EndpointAddress> {
        let of =
            |direction| (1..16).map(move |number| EndpointAddress::from_parts(number, direction));
        of(Direction::Out).chain(of(Direction::In)).filter(move |address| self.has(*address))
    }

    fn has(self, address: EndpointAddress) -> bool {
        address.index() < 16 && self.0 & Self::bit(address) != 0
    }
}

/// A driver, guarded.
pub struct Guarded<D> {
    driver: D,
    endpoints: Endpoints,
}

impl<D> Guarded<D> {
    /// Before any endpoint is allocated.
    pub fn new(driver: D) -> Self {
        Self { driver, endpoints: Endpoints::default() }
    }
}

impl<'d, D: Driver<'d>> Driver<'d> for Guarded<D> {
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = GuardedControl<D::ControlPipe>;
    type Bus = GuardedBus<D::Bus>;

    fn alloc_endpoint_out(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointOut, EndpointAllocError> {
        let endpoint =
            self.driver.alloc_endpoint_out(kind, address, max_packet_size, interval_ms)?;
        self.endpoints.add(endpoint.info());
        Ok(endpoint)
    }

    fn alloc_endpoint_in(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointIn, EndpointAllocError> {
        let endpoint =
            self.driver.alloc_endpoint_in(kind, address, max_packet_size, interval_ms)?;
        self.endpoints.add(endpoint.info());
        Ok(endpoint)
    }

    fn start(self, control_max_packet_size: u16) -> (Self::Bus, Self::ControlPipe) {
        let (bus, control) = self.driver.start(control_max_packet_size);
        (GuardedBus { bus, endpoints: self.endpoints }, GuardedControl(control))
    }
}

/// Its control pipe.
pub struct GuardedControl<C>(C);

impl<C: ControlPipe> ControlPipe for GuardedControl<C> {
    fn max_packet_size(&self) -> usize {
        self.0.max_packet_size()
    }

    async fn setup(&mut self) -> [u8; 8] {
        self.0.setup().await
    }

    async fn data_out(
        &mut self,
        buf: &mut [u8],
        first: bool,
        last: bool,
    ) -> Result<usize, EndpointError> {
        let received = with_timeout(STAGE, self.0.data_out(buf, first, last)).await;
        received.unwrap_or(Err(EndpointError::Disabled))
    }

    async fn data_in(&mut self, data: &[u8], first: bool, last: bool) -> Result<(), EndpointError> {
        let sent = with_timeout(STAGE, self.0.data_in(data, first, last)).await;
        sent.unwrap_or(Err(EndpointError::Disabled))
    }

    async fn accept(&mut self) {
        let _ = with_timeout(STAGE, self.0.accept()).await;
    }

    async fn reject(&mut self) {
        self.0.reject().await;
    }

    async fn accept_set_address(&mut self, address: u8) {
        let _ = with_timeout(STAGE, self.0.accept_set_address(address)).await;
    }
}

/// Its bus.
pub struct GuardedBus<B> {
    bus: B,
    endpoints: Endpoints,
}

impl<B: Bus> Bus for GuardedBus<B> {
    async fn enable(&mut self) {
        self.bus.enable().await;
    }

    async fn disable(&mut self) {
        self.bus.disable().await;
    }

    async fn poll(&mut self) -> Event {
        // First, as an event that is already taken would be lost if the stack dropped this future.
        yield_now().await;
        let event = self.bus.poll().await;
        if matches!(event, Event::Reset) {
            self.endpoints
                .addresses()
                .for_each(|address| self.bus.endpoint_set_enabled(address, false));
        }
        event
    }

    fn endpoint_set_enabled(&mut self, address: EndpointAddress, enabled: bool) {
        if self.endpoints.has(address) {
            if enabled {
                board::begin_with_data0(&mut self.bus, address);
            }
            self.bus.endpoint_set_enabled(address, enabled);
        }
    }

    fn endpoint_set_stalled(&mut self, address: EndpointAddress, stalled: bool) {
        if self.endpoints.has(address) {
            if stalled {
                self.bus.endpoint_set_stalled(address, true);
            } else {
                board::end_halt(&mut self.bus, address);
            }
        }
    }

    fn endpoint_is_stalled(&mut self, address: EndpointAddress) -> bool {
        self.endpoints.has(address) && self.bus.endpoint_is_stalled(address)
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        self.bus.remote_wakeup().await
    }
}
