//! The DFU interface of the running firmware (USB Device Firmware Upgrade 1.1, chapter 5): it only
//! knows the request to detach.
//!
//! The device then leaves the bus by itself and comes back as the chip's ROM bootloader, another
//! device, which the update tool waits for. The host that loads the new firmware starts it from
//! there.

use embassy_time::Duration;
use embassy_usb::control::{InResponse, OutResponse, Recipient, Request, RequestType};
use embassy_usb::types::InterfaceNumber;
use embassy_usb::{Builder, Handler};
use static_cell::StaticCell;

use super::{Driver, PACKET};
use crate::shared_gateway::SharedGateway;

/// Class, subclass and protocol of the interface: application specific, device firmware upgrade, at
/// run time.
const CLASS: u8 = 0xFE;
const SUBCLASS: u8 = 0x01;
const RUN_TIME: u8 = 0x01;

/// Type of the functional descriptor, and its attributes: can be written (bit 0), detaches by
/// itself (bit 3).
const FUNCTIONAL: u8 = 0x21;
const CAN_DOWNLOAD: u8 = 1 << 0;
const WILL_DETACH: u8 = 1 << 3;
/// bcdDFUVersion.
const DFU_1_1: u16 = 0x0110;

/// Requests of the interface.
const DETACH: u8 = 0;
const GET_STATUS: u8 = 3;
const GET_STATE: u8 = 5;
/// States of the interface.
const APP_IDLE: u8 = 0;
const APP_DETACH: u8 = 1;
/// Bytes of the reply to `GET_STATUS`: status, poll timeout of three bytes, state, string.
const STATUS_LENGTH: usize = 6;

/// The host may finish its request before the device leaves; the tool is told to wait no longer
/// than this.
pub const GRACE: Duration = Duration::from_millis(50);
/// [`GRACE`] in milliseconds, as the descriptor has it.
const GRACE_MS: u16 = 50;

/// The interface.
pub struct Detach {
    gateway: &'static SharedGateway,
    interface: InterfaceNumber,
    state: u8,
}

impl Detach {
    /// Adds the interface to a device.
    pub fn add_to(
        builder: &mut Builder<'static, Driver>,
        place: &'static StaticCell<Self>,
        gateway: &'static SharedGateway,
    ) {
        let [grace_low, grace_high] = GRACE_MS.to_le_bytes();
        let [transfer_low, transfer_high] = PACKET.to_le_bytes();
        let [version_low, version_high] = DFU_1_1.to_le_bytes();
        let functional = [
            CAN_DOWNLOAD | WILL_DETACH,
            grace_low,
            grace_high,
            transfer_low,
            transfer_high,
            version_low,
            version_high,
        ];
        let mut function = builder.function(CLASS, SUBCLASS, RUN_TIME);
        let mut interface = function.interface();
        let number = interface.interface_number();
        interface.alt_setting(CLASS, SUBCLASS, RUN_TIME, None).descriptor(FUNCTIONAL, &functional);
        drop(function);
        builder.handler(place.init(Self { gateway, interface: number, state: APP_IDLE }));
    }

    fn is_mine(&self, request: &Request) -> bool {
        (request.request_type, request.recipient, request.index)
            == (RequestType::Class, Recipient::Interface, u16::from(u8::from(self.interface)))
    }
}

impl Handler for Detach {
    fn reset(&mut self) {
        self.state = APP_IDLE;
    }

    fn control_out(&mut self, request: Request, _: &[u8]) -> Option<OutResponse> {
        if !self.is_mine(&request) {
            return None;
        }
        if request.request != DETACH {
            return Some(OutResponse::Rejected);
        }
        if !self.gateway.may_detach() {
            defmt::warn!("USB: refused to detach: not at rest, on trial, or signed images only");
            return Some(OutResponse::Rejected);
        }
        self.state = APP_DETACH;
        super::bootloader::ASKED_FOR.signal(());
        Some(OutResponse::Accepted)
    }

    fn control_in<'a>(
        &'a mut self,
        request: Request,
        reply: &'a mut [u8],
    ) -> Option<InResponse<'a>> {
        if !self.is_mine(&request) {
            return None;
        }
        let length = match request.request {
            GET_STATUS => {
                let [status, timeout @ .., state, string] =
                    reply.first_chunk_mut::<STATUS_LENGTH>()?;
                (*status, *timeout, *state, *string) = (0, [0; 3], self.state, 0);
                STATUS_LENGTH
            }
            GET_STATE => {
                *reply.first_mut()? = self.state;
                1
            }
            _ => return Some(InResponse::Rejected),
        };
        reply.get(..length).map(InResponse::Accepted)
    }
}
