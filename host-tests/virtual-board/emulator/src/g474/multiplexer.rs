//! The DMA request multiplexer of the STM32G474: which peripheral's request reaches which channel.
//!
//! Sources: the registers and the numbers of the requests in stm32-metapac 21 (`dmamux_v1`).
//! Channels 0 to 7 are those of DMA1, 8 to 15 those of DMA2. Not modelled, and told:
//! synchronisation and request generators.

use std::collections::BTreeMap;

use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange};
use rigless::snapshot::store;
use rigless::soc::RegisterSpec;
use rigless::soc::stm32h743::peripherals::usart::{RECEIVE_REQUEST, TRANSMIT_REQUEST};

use super::tables;
use crate::edges;
use crate::row::Row;

/// The instance's name.
pub const NAME: &str = "DMAMUX1";
/// Its channels.
const CHANNELS: usize = 16;
/// CCR: the request, and that it waits for an event. (EGE, which the driver sets, makes events;
/// nobody hears them.)
const REQUEST: u64 = 0x7F;
const SE: u64 = 1 << 16;
/// RGCR: a generator is on.
const GE: u64 = 1 << 16;

/// The multiplexer.
#[derive(Debug)]
pub struct Multiplexer {
    table: &'static [RegisterSpec],
    /// By peripheral and its output: the number of the request.
    inputs: BTreeMap<(&'static str, usize), usize>,
    /// The requests that are up.
    up: u128,
    driven: [bool; CHANNELS],
}

store!(Multiplexer { values: [up, driven], parts: [], built: [table, inputs] });

impl Multiplexer {
    /// That hears the serial ports of those names.
    pub fn new(serial: &[&'static str]) -> Self {
        let inputs = serial.iter().flat_map(|port| {
            [(RECEIVE_REQUEST, "RX"), (TRANSMIT_REQUEST, "TX")].map(|(output, signal)| {
                let request =
                    tables::dma_request(port, signal).expect("a serial port has both requests");
                ((*port, output), request)
            })
        });
        let table = tables::named(NAME).registers;
        Self { table, inputs: inputs.collect(), up: 0, driven: [false; CHANNELS] }
    }

    fn refresh(&mut self, registers: &RegisterFile, context: &mut DeviceContext<'_>) {
        let up = |channel: usize| {
            // The first rows are the channels' registers.
            let request = registers.get(Row(channel)) & REQUEST;
            request != 0 && self.up >> request & 1 == 1
        };
        edges::follow(&mut self.driven, up, |channel, level| context.request(channel, level));
    }
}

impl Device for Multiplexer {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.table
    }

    fn write(
        &mut self,
        row: Row,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        // CFR has nothing to clear: without synchronisation no request is lost.
        let unknown = match self.table[row.0].name {
            register if register.starts_with("CCR") => SE,
            register if register.starts_with("RGCR") => GE,
            _ => 0,
        };
        if value & unknown != 0 {
            context.tell(
                self.table[row.0].name,
                "synchronisation and request generators are not modelled",
            );
        }
        self.refresh(registers, context);
    }

    fn on_request(
        &mut self,
        request: RequestChange,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let Some(number) = self.inputs.get(&(request.instance, request.request)) else { return };
        let bit = 1 << number;
        self.up = if request.level == Level::High { self.up | bit } else { self.up & !bit };
        self.refresh(registers, context);
    }

    fn reset(&mut self) {
        (self.up, self.driven) = (0, [false; CHANNELS]);
    }
}
