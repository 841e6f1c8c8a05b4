//! The device's end of the cable.

use rigless::device::{DeviceContext, Level};

use super::super::START_OF_FRAME;
use super::super::endpoint::{CTR_RX, EP_KIND, Kind, Status};
use super::super::packet_memory::Failed;
use super::super::registers::{DPPU, LCK, PDWN, SOF};
use super::{Controller, row};
use crate::usb::function::{Handshake, Input, Toggle, UsbFunction};

/// It, at one instant.
#[derive(Debug)]
pub struct Function<'a, 'c> {
    usb: &'a mut Controller,
    context: &'a mut DeviceContext<'c>,
}

impl<'a, 'c> Function<'a, 'c> {
    /// Of that controller, at the instant of `context`.
    pub fn new(usb: &'a mut Controller, context: &'a mut DeviceContext<'c>) -> Self {
        Self { usb, context }
    }
}

impl UsbFunction for Function<'_, '_> {
    fn is_pulled_up(&self) -> bool {
        self.usb.charger & DPPU != 0 && self.usb.control & PDWN == 0
    }

    /// The controller sees no VBUS: with no cable no frames come, and that is all.
    fn set_attached(&mut self, _: bool) {}

    fn bus_reset(&mut self) {
        if self.usb.is_on() {
            self.usb.wake();
            self.usb.forget();
            self.usb.watch_idle(self.context);
            self.usb.refresh(self.context);
        }
    }

    /// The controller sees for itself that no frames come.
    fn suspend(&mut self) {}

    fn resume(&mut self) {
        self.usb.wake();
        self.usb.watch_idle(self.context);
        self.usb.refresh(self.context);
    }

    fn start_of_frame(&mut self, number: u16) {
        if !self.usb.is_on() {
            return;
        }
        self.usb.wake();
        self.usb.frame = number & 0x7FF | LCK;
        self.usb.flags |= SOF;
        self.usb.watch_idle(self.context);
        self.usb.refresh(self.context);
        for level in [Level::High, Level::Low] {
            self.context.request(START_OF_FRAME, level);
        }
    }

    fn setup(&mut self, address: u8, endpoint: u8, data: [u8; 8]) -> Handshake {
        let Some(number) = self.usb.addressed(address, endpoint, self.context) else {
            return Handshake::NoResponse;
        };
        let found = self.usb.endpoints[number];
        let takes = found.kind() == Kind::Control
            && found.receives() != Status::Disabled
            && !found.has(CTR_RX);
        if !takes || self.usb.store(number, &data, self.context).is_err() {
            return Handshake::NoResponse;
        }
        self.usb.endpoints[number].set_up();
        self.usb.refresh(self.context);
        Handshake::Ack
    }

    fn out(&mut self, address: u8, endpoint: u8, toggle: Toggle, data: &[u8]) -> Handshake {
        let Some(number) = self.usb.addressed(address, endpoint, self.context) else {
            return Handshake::NoResponse;
        };
        let found = self.usb.endpoints[number];
        match found.receives() {
            Status::Disabled => return Handshake::NoResponse,
            Status::Stall => return Handshake::Stall,
            Status::Nak => return Handshake::Nak,
            Status::Valid => {}
        }
        if found.kind() == Kind::Control && found.has(EP_KIND) && !data.is_empty() {
            return Handshake::Stall;
        }
        if found.expects() != toggle {
            return Handshake::Ack;
        }
        match self.usb.store(number, data, self.context) {
            Ok(()) => {}
            Err(Failed::Overrun) => return Handshake::Stall,
            Err(Failed::Outside) => return Handshake::NoResponse,
        }
        self.usb.endpoints[number].received();
        self.usb.refresh(self.context);
        Handshake::Ack
    }

    fn input(&mut self, address: u8, endpoint: u8) -> Input {
        let Some(number) = self.usb.addressed(address, endpoint, self.context) else {
            return Input::NoResponse;
        };
        let found = self.usb.endpoints[number];
        match found.transmits() {
            Status::Disabled => Input::NoResponse,
            Status::Stall => Input::Stall,
            Status::Nak => Input::Nak,
            Status::Valid => match self.usb.memory.packet(self.usb.buffers, row(number)) {
                Ok(data) => Input::Data(found.sends(), data),
                Err(_) => {
                    self.context.tell("BTABLE", "a transmit buffer lies outside the packet memory");
                    Input::NoResponse
                }
            },
        }
    }

    fn input_acknowledged(&mut self, address: u8, endpoint: u8) {
        if let Some(number) = self.usb.addressed(address, endpoint, self.context)
            && self.usb.endpoints[number].transmits() == Status::Valid
        {
            self.usb.endpoints[number].sent();
            self.usb.refresh(self.context);
        }
    }
}
