//! The USB device controller of the STM32G474 at full speed, one transaction at a time.
//!
//! Sources: the registers in stm32-metapac 21 (`usb_v3`, `usbram_16x2_1024`), the driver of
//! embassy-stm32 0.6.0 (`usb/usb.rs`), and the USB chapter of RM0440, whose words RM0008 and RM0365
//! share.
//!
//! | What | Behaviour |
//! |---|---|
//! | EPnR | [`endpoint`]; NAK after each packet until the firmware allows another |
//! | SETUP | taken whatever STAT_RX is, unless disabled; not answered while CTR_RX is set |
//! | a packet of the toggle before | acknowledged and forgotten |
//! | a packet that is longer than its buffer | STALL, and no event |
//! | ISTR | CTR, DIR and EP_ID follow the endpoints, the lowest register first; the other flags are cleared by writing 0 |
//! | FRES, a reset on the bus | endpoints and address are forgotten, and no packet is taken until RESET is cleared |
//! | FSUSP | no packet is taken; resume and reset set WKUP and clear LPMODE |
//! | SUSP | 3 ms after the last frame; without a host, too: D+ is then held high by the pull-up alone |
//! | clock | off 48 MHz by more than 0.25 % (USB 2.0 §7.1.11) no packet is understood; the start of a frame is |
//! | told | isochronous and double-buffered endpoints, remote wake-up, LPM, charger detection, buffers outside the memory |

mod controller;
mod endpoint;
pub mod packet_memory;
mod registers;

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::RegisterSpec;
use rigless::time::{EventId, VirtualNanos};

use super::tables;
use crate::row::Row;
use crate::usb::host::Host;
use controller::{Controller, Function};
use packet_memory::PacketMemory;

/// The instance's name.
pub const NAME: &str = "USB";
/// The request output that is high for an instant when a frame starts.
pub const START_OF_FRAME: usize = 0;

/// The controller with its cable and its host.
#[derive(Debug)]
pub struct Usb {
    table: &'static [RegisterSpec],
    controller: Controller,
    /// The other end of the cable.
    pub host: Host,
}

store!(Usb { values: [host], parts: [controller], built: [table] });

impl Usb {
    /// Out of reset, with its packets in `memory` and no cable.
    #[must_use]
    pub fn new(memory: PacketMemory) -> Self {
        Self {
            table: tables::named(NAME).registers,
            controller: Controller::new(memory),
            host: Host::new(),
        }
    }

    /// Carries out what the host does, and schedules what comes.
    fn advance(&mut self, context: &mut DeviceContext<'_>) {
        let now = context.now();
        let next = self.host.advance(now, &mut Function::new(&mut self.controller, context));
        if let Some(next) = next {
            context.schedule(next);
        }
    }
}

impl Device for Usb {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.table
    }

    fn read(
        &mut self,
        row: Row,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        self.peek(row, registers, context.now())
    }

    fn peek(&self, row: Row, _: &RegisterFile, _: VirtualNanos) -> Option<u64> {
        Some(self.controller.read(self.table[row.0].offset).into())
    }

    /// The upper half of every register is reserved.
    fn write(
        &mut self,
        row: Row,
        value: u64,
        _: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let [low, high, ..] = value.to_le_bytes();
        self.controller.write(self.table[row.0].offset, u16::from_le_bytes([low, high]), context);
        self.advance(context);
    }

    fn on_event(&mut self, event: EventId, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.controller.on_event(event, context);
        self.advance(context);
    }

    fn on_clock(&mut self, hz: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {
        self.controller.set_clock(hz);
    }

    fn poll(&mut self, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.advance(context);
    }

    /// The host and the cable stay as they are.
    fn reset(&mut self) {
        self.controller.reset();
    }
}

#[cfg(test)]
mod tests;
