//! The core's side of the bus: how it answers a host.

use super::core::Core;
use super::endpoint::Endpoint;
use super::registers::{epctl, epint, eptsiz, gint, pktsts};
use crate::usb::function::{Handshake, Input, Toggle, UsbFunction};

impl Core {
    /// Whether a host speaks to this device, and to an endpoint that is active.
    fn is_meant(&self, address: u8, endpoint: &Endpoint) -> bool {
        !self.suspended && address == self.address && endpoint.is(epctl::USBAEP)
    }

    /// The first token after a SETUP ends its stage.
    fn end_setup(&mut self, endpoint: u8) {
        if endpoint == 0 && std::mem::take(&mut self.in_setup) {
            self.receive.push(0, pktsts::SETUP_DONE, false, &[]);
        }
    }

    /// The packet that an IN endpoint would send now.
    fn packet(&self, endpoint: &Endpoint) -> Option<Vec<u8>> {
        let length = endpoint.bytes().min(endpoint.packet());
        let ready = endpoint.is(epctl::EPENA) && !endpoint.is(epctl::NAKSTS);
        ready.then(|| self.transmit.get(endpoint.fifo())?.peek(length)).flatten()
    }
}

fn number(endpoint: u8) -> usize {
    usize::from(endpoint)
}

impl UsbFunction for Core {
    fn is_pulled_up(&self) -> bool {
        self.shows_itself()
    }

    /// The driver overrides the session (GOTGCTL.BVALOVAL): the core does not look.
    fn set_attached(&mut self, _: bool) {}

    fn bus_reset(&mut self) {
        self.suspended = false;
        self.in_setup = false;
        self.address = 0;
        self.latched |= gint::USBRST;
        for endpoint in self.inputs[1..].iter_mut().chain(&mut self.outputs[1..]) {
            endpoint.clear(epctl::USBAEP);
        }
    }

    fn bus_reset_ended(&mut self) {
        self.latched |= gint::ENUMDNE;
    }

    fn suspend(&mut self) {
        if !self.suspended {
            self.suspended = true;
            self.latched |= gint::ESUSP | gint::USBSUSP;
        }
    }

    fn resume(&mut self) {
        if self.suspended {
            self.suspended = false;
            self.latched |= gint::WKUPINT;
        }
    }

    fn start_of_frame(&mut self, number: u16) {
        self.suspended = false;
        self.frame = number;
        self.latched |= gint::SOF;
    }

    fn setup(&mut self, address: u8, endpoint: u8, data: [u8; 8]) -> Handshake {
        let meant = endpoint == 0 && self.is_meant(address, &self.outputs[0]);
        if !meant || !self.receive.has_room_for_setup(self.rx_depth()) {
            return Handshake::NoResponse;
        }
        self.receive.push(0, pktsts::SETUP_DATA, false, &data);
        self.in_setup = true;
        for endpoint in [&mut self.inputs[0], &mut self.outputs[0]] {
            endpoint.clear(epctl::STALL);
            endpoint.set(epctl::NAKSTS | epctl::DPID);
        }
        let setups = &mut self.outputs[0].size;
        let left = (*setups & eptsiz::STUPCNT).saturating_sub(1 << eptsiz::STUPCNT_SHIFT);
        *setups = *setups & !eptsiz::STUPCNT | left & eptsiz::STUPCNT;
        Handshake::Ack
    }

    fn out(&mut self, address: u8, endpoint: u8, toggle: Toggle, data: &[u8]) -> Handshake {
        let Some(output) = self.outputs.get(number(endpoint)).copied() else {
            return Handshake::NoResponse;
        };
        if !self.is_meant(address, &output) {
            return Handshake::NoResponse;
        }
        self.end_setup(endpoint);
        if output.is(epctl::STALL) {
            return Handshake::Stall;
        }
        if data.len() > output.packet() {
            return Handshake::NoResponse;
        }
        if output.is(epctl::NAKSTS) || !self.receive.has_room(data.len(), self.rx_depth()) {
            return Handshake::Nak;
        }
        if toggle != output.toggle() {
            return Handshake::Ack;
        }
        let number = number(endpoint);
        self.receive.push(number, pktsts::OUT_DATA, toggle == Toggle::Data1, data);
        let output = &mut self.outputs[number];
        output.flip();
        if output.count(data.len()) || data.len() < output.packet() {
            output.set(epctl::NAKSTS);
            self.receive.push(number, pktsts::OUT_DONE, false, &[]);
        }
        Handshake::Ack
    }

    fn input(&mut self, address: u8, endpoint: u8) -> Input {
        let Some(input) = self.inputs.get(number(endpoint)).copied() else {
            return Input::NoResponse;
        };
        if !self.is_meant(address, &input) {
            return Input::NoResponse;
        }
        self.end_setup(endpoint);
        if input.is(epctl::STALL) {
            return Input::Stall;
        }
        match self.packet(&input) {
            Some(data) => Input::Data(input.toggle(), data),
            None => {
                self.inputs[number(endpoint)].flags |= epint::ITTXFE;
                Input::Nak
            }
        }
    }

    fn input_acknowledged(&mut self, address: u8, endpoint: u8) {
        let number = number(endpoint);
        let Some(input) =
            self.inputs.get(number).copied().filter(|input| self.is_meant(address, input))
        else {
            return;
        };
        let length = input.bytes().min(input.packet());
        if let Some(transmit) = self.transmit.get_mut(input.fifo()) {
            transmit.drop_bytes(length);
        }
        let input = &mut self.inputs[number];
        input.flip();
        if input.count(length) {
            input.clear(epctl::EPENA);
            input.flags |= epint::XFRC;
        }
        if number == 0 {
            // The status stage of SET_ADDRESS was answered under the old one.
            self.address = self.new_address();
        }
    }
}
