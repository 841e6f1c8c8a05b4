//! A DMA controller of the STM32G474: eight channels, each with a count, an address in a peripheral
//! and one in memory.
//!
//! Sources: the registers in stm32-metapac 21 (`bdma_v1`), the drivers of embassy-stm32 0.6.0
//! (`dma`), and the emulator's model of the STM32H743's BDMA, which has the same channels and cites
//! RM0433 chapter 16. The request multiplexer says when a channel has something to do. Not
//! modelled: priorities between channels, transfers from memory to memory.

use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange};
use rigless::snapshot::store;
use rigless::soc::{RegisterSpec, Width};
use serde::{Deserialize, Serialize};

use super::{multiplexer, tables};
use crate::row::Row;

/// Channels of a controller.
pub const CHANNELS: usize = 8;
/// Offsets: ISR, IFCR, then four registers for each channel.
const ISR: u32 = 0x00;
const IFCR: u32 = 0x04;
const FIRST_CHANNEL: u32 = 0x08;
const CHANNEL_BYTES: u32 = 0x14;
/// Flags of a channel, four bits for each.
const GLOBAL: u64 = 1 << 0;
const COMPLETE: u64 = 1 << 1;
const HALF: u64 = 1 << 2;
const ERROR: u64 = 1 << 3;
const FLAG_BITS: usize = 4;
/// Bits of a channel's CR; TCIE, HTIE and TEIE lie at the places of their flags.
const EN: u64 = 1 << 0;
const DIR: u64 = 1 << 4;
const CIRC: u64 = 1 << 5;
const PINC: u64 = 1 << 6;
const MINC: u64 = 1 << 7;
const PSIZE: u32 = 8;
const MSIZE: u32 = 10;
const MEM2MEM: u64 = 1 << 14;
/// The CCM SRAM at the address that only the processor reaches (RM0440, memory organisation).
const UNREACHABLE: std::ops::Range<u64> = 0x1000_0000..0x1000_8000;

/// A register of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Of {
    Control = 0,
    Count = 1,
    Peripheral = 2,
    Memory = 3,
}

/// The access of a transfer that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Under {
    Reading,
    Writing,
}

#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Channel {
    /// Where the next item is read from and written to.
    peripheral: u64,
    memory: u64,
    remaining: u64,
    total: u64,
    under: Option<Under>,
    /// The level of its request.
    requested: bool,
    /// What CR and the other registers held, as they keep it while the channel is on.
    kept: [u64; 4],
    raised: bool,
}

/// One controller.
#[derive(Debug)]
pub struct Dma {
    table: &'static [RegisterSpec],
    /// The multiplexer's output that is this controller's first.
    first: usize,
    channels: [Channel; CHANNELS],
}

store!(Dma { values: [channels], parts: [], built: [table, first] });

impl Dma {
    /// The controller of that name, whose channels hear the multiplexer's outputs from `first` on.
    pub fn new(name: &str, first: usize) -> Self {
        let table = tables::named(name).registers;
        Self { table, first, channels: [Channel::default(); CHANNELS] }
    }

    fn row_at(&self, offset: u32) -> Row {
        Row(self
            .table
            .iter()
            .position(|row| row.offset == offset)
            .expect("a register of the controller"))
    }

    fn row(&self, channel: usize, of: Of) -> Row {
        let channel = u32::try_from(channel).expect("one of eight");
        self.row_at(FIRST_CHANNEL + channel * CHANNEL_BYTES + 4 * of as u32)
    }

    fn raise_flags(&self, channel: usize, flags: u64, registers: &mut RegisterFile) {
        let status = self.row_at(ISR);
        registers.set(status, registers.get(status) | (flags | GLOBAL) << (FLAG_BITS * channel));
    }

    fn refresh(
        &mut self,
        channel: usize,
        registers: &RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let flags = registers.get(self.row_at(ISR)) >> (FLAG_BITS * channel);
        let enabled = registers.get(self.row(channel, Of::Control));
        let raise = flags & enabled & (COMPLETE | HALF | ERROR) != 0;
        if self.channels[channel].raised != raise {
            self.channels[channel].raised = raise;
            context.interrupt(channel, Level::from(raise));
        }
    }

    fn start(&mut self, channel: usize, registers: &RegisterFile) {
        let [count, peripheral, memory] =
            [Of::Count, Of::Peripheral, Of::Memory].map(|of| registers.get(self.row(channel, of)));
        let state = &mut self.channels[channel];
        (state.total, state.remaining) = (count & 0xFFFF, count & 0xFFFF);
        (state.peripheral, state.memory) = (peripheral, memory);
    }

    /// Begins with the next item, if it is asked for.
    fn pump(
        &mut self,
        channel: usize,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let control = registers.get(self.row(channel, Of::Control));
        let state = &mut self.channels[channel];
        if control & EN == 0 || state.under.is_some() || state.remaining == 0 || !state.requested {
            return;
        }
        if UNREACHABLE.contains(&state.memory) || UNREACHABLE.contains(&state.peripheral) {
            self.fail(channel, registers, context);
            return;
        }
        let (address, width) = if control & DIR == 0 {
            (state.peripheral, width(control, PSIZE))
        } else {
            (state.memory, width(control, MSIZE))
        };
        state.under = Some(Under::Reading);
        context.read_from(address, width, token(channel));
    }

    /// The item has been read.
    fn carry(
        &mut self,
        channel: usize,
        value: u64,
        registers: &RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let control = registers.get(self.row(channel, Of::Control));
        let state = &mut self.channels[channel];
        let (address, width) = if control & DIR == 0 {
            (state.memory, width(control, MSIZE))
        } else {
            (state.peripheral, width(control, PSIZE))
        };
        state.under = Some(Under::Writing);
        context.write_to(address, width, value & width.mask(), token(channel));
    }

    /// The item has been written.
    fn finish(
        &mut self,
        channel: usize,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let control = registers.get(self.row(channel, Of::Control));
        let count = self.row(channel, Of::Count);
        let state = &mut self.channels[channel];
        state.under = None;
        let step = |on: u64, size| {
            if control & on == 0 { 0 } else { u64::from(width(control, size).bytes()) }
        };
        state.peripheral += step(PINC, PSIZE);
        state.memory += step(MINC, MSIZE);
        state.remaining -= 1;
        let (remaining, total) = (state.remaining, state.total);
        registers.set(count, remaining);
        // Half of an odd count is the smaller half (RM0440, DMA chapter, "half-transfer": the
        // model's choice).
        if remaining == total - total / 2 {
            self.raise_flags(channel, HALF, registers);
        }
        if remaining == 0 {
            self.raise_flags(channel, COMPLETE, registers);
            if control & CIRC != 0 {
                registers.set(count, total);
                self.start(channel, registers);
            }
        }
        self.refresh(channel, registers, context);
        self.pump(channel, registers, context);
    }

    fn fail(
        &mut self,
        channel: usize,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let control = self.row(channel, Of::Control);
        self.channels[channel].under = None;
        registers.set(control, registers.get(control) & !EN);
        self.raise_flags(channel, ERROR, registers);
        self.refresh(channel, registers, context);
    }

    fn write_channel(
        &mut self,
        channel: usize,
        of: Of,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let row = self.row(channel, of);
        let was_on = self.channels[channel].kept[Of::Control as usize] & EN != 0;
        if of != Of::Control && was_on {
            // While the channel is on its count and addresses stay.
            let kept = if of == Of::Count {
                self.channels[channel].remaining
            } else {
                self.channels[channel].kept[of as usize]
            };
            registers.set(row, kept);
            context.tell("CR", "a channel's registers are written while it is on");
            return;
        }
        self.channels[channel].kept[of as usize] = value;
        if of != Of::Control {
            return;
        }
        if value & MEM2MEM != 0 {
            context.tell("CR", "transfers from memory to memory are not modelled");
        }
        match (was_on, value & EN != 0) {
            (false, true) => {
                self.start(channel, registers);
                self.pump(channel, registers, context);
            }
            (true, false) => self.channels[channel].under = None,
            _ => {}
        }
        self.refresh(channel, registers, context);
    }
}

fn width(control: u64, size: u32) -> Width {
    match control >> size & 0b11 {
        0 => Width::W8,
        1 => Width::W16,
        _ => Width::W32,
    }
}

fn token(channel: usize) -> u64 {
    u64::try_from(channel).expect("one of eight")
}

fn channel(token: u64) -> usize {
    usize::try_from(token).expect("one of eight")
}

impl Device for Dma {
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
        match self.table[row.0].offset {
            ISR => {}
            IFCR => {
                let status = self.row_at(ISR);
                for channel in 0..CHANNELS {
                    let written = value >> (FLAG_BITS * channel) & 0xF;
                    // A global flag clears the others, and goes with the last of them.
                    let cleared = if written & GLOBAL != 0 { 0xF } else { written };
                    let left = registers.get(status) >> (FLAG_BITS * channel) & 0xF & !cleared;
                    let left = if left & !GLOBAL == 0 { 0 } else { left };
                    let others = registers.get(status) & !(0xF << (FLAG_BITS * channel));
                    registers.set(status, others | left << (FLAG_BITS * channel));
                    self.refresh(channel, registers, context);
                }
            }
            offset => {
                let (number, within) = (
                    (offset - FIRST_CHANNEL) / CHANNEL_BYTES,
                    (offset - FIRST_CHANNEL) % CHANNEL_BYTES,
                );
                let of = match within {
                    0x0 => Of::Control,
                    0x4 => Of::Count,
                    0x8 => Of::Peripheral,
                    _ => Of::Memory,
                };
                self.write_channel(number as usize, of, value, registers, context);
            }
        }
    }

    fn on_request(
        &mut self,
        request: RequestChange,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let channel = request.request.checked_sub(self.first).filter(|channel| *channel < CHANNELS);
        if let (multiplexer::NAME, Some(channel)) = (request.instance, channel) {
            self.channels[channel].requested = request.level == Level::High;
            self.pump(channel, registers, context);
        }
    }

    fn on_access(
        &mut self,
        token: u64,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let channel = channel(token);
        match self.channels[channel].under {
            Some(Under::Reading) => self.carry(channel, value, registers, context),
            Some(Under::Writing) => self.finish(channel, registers, context),
            // It was switched off in between.
            None => {}
        }
    }

    fn on_refused(
        &mut self,
        token: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.fail(channel(token), registers, context);
    }

    fn reset(&mut self) {
        self.channels = [Channel::default(); CHANNELS];
    }
}

#[cfg(test)]
mod tests;
