//! The FDCAN of the STM32G4: the same controller, with three elements in each queue at fixed places
//! of its 212 words of message RAM, and so without the registers that choose them; the bits that
//! are left stand closer together in some registers.
//!
//! Sources: stm32-metapac 21 (`can_fdcan_v1` beside `can_fdcan_h7`), embassy-stm32 0.6.0 (`can/fd`)
//! for the layout, RM0440's "FDCAN SRAM" as our driver cites it.

use rigless::device::DeviceContext;
use rigless::soc::RegisterSpec;
use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::time::VirtualNanos;

use super::controller::{Activity, Controller};

/// Words of the message RAM that one controller has.
pub const WORDS: u32 = 212;
/// Where its queues begin, in words: filters for 11-bit ids (28 of one word), for 29-bit ids (8 of
/// two), receive FIFOs (3 elements of 18 words each), event FIFO (3 of 2), transmit buffers (3 of
/// 18).
const STANDARD_FILTERS: u32 = 0;
const EXTENDED_FILTERS: u32 = 28;
const RECEIVE: [u32; 2] = [44, 98];
const EVENTS: u32 = 152;
const TRANSMIT: u32 = 158;
const ELEMENTS: u32 = 3;
/// RXESC and TXESC of elements with 64 bytes.
const RECEIVE_SIZES: u32 = 0x777;
const TRANSMIT_SIZE: u32 = 0x7;
/// The bits of IR and IE, in the order in which they stand here, by their places in the controller
/// of the STM32H7.
const FLAGS: [u32; 24] =
    [0, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 14, 15, 16, 17, 18, 22, 23, 24, 25, 26, 27, 28, 29];
/// Which flags a bit of ILS stands for, as first and last place in [`FLAGS`]: RXFIFO0, RXFIFO1,
/// SMSG, TFERR, MISC, BERR, PERR.
const GROUPS: [(usize, usize); 7] = [(0, 2), (3, 5), (6, 8), (9, 12), (13, 15), (16, 17), (18, 23)];

/// What a register stands for in the controller that the model is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Meaning {
    /// The same register.
    Same(Register),
    /// IR or IE.
    Flags(Register),
    /// ILS.
    Lines,
    /// RXGFC: GFC, the lengths of both filter lists, and whether full FIFOs overwrite.
    Filters,
    /// TXBC: queue or FIFO.
    Transmit,
    /// CKDIV.
    Divider,
}

fn meaning(offset: u32) -> Option<Meaning> {
    use Meaning::{Divider, Filters, Flags, Lines, Same, Transmit};
    Some(match offset {
        0x00 => Same(Register::FdcanCrel),
        0x04 => Same(Register::FdcanEndn),
        0x0C => Same(Register::FdcanDbtp),
        0x10 => Same(Register::FdcanTest),
        0x14 => Same(Register::FdcanRwd),
        0x18 => Same(Register::FdcanCccr),
        0x1C => Same(Register::FdcanNbtp),
        0x20 => Same(Register::FdcanTscc),
        0x24 => Same(Register::FdcanTscv),
        0x28 => Same(Register::FdcanTocc),
        0x2C => Same(Register::FdcanTocv),
        0x40 => Same(Register::FdcanEcr),
        0x44 => Same(Register::FdcanPsr),
        0x48 => Same(Register::FdcanTdcr),
        0x50 => Flags(Register::FdcanIr),
        0x54 => Flags(Register::FdcanIe),
        0x58 => Lines,
        0x5C => Same(Register::FdcanIle),
        0x80 => Filters,
        0x84 => Same(Register::FdcanXidam),
        0x88 => Same(Register::FdcanHpms),
        0x90 => Same(Register::FdcanRxf0s),
        0x94 => Same(Register::FdcanRxf0a),
        0x98 => Same(Register::FdcanRxf1s),
        0x9C => Same(Register::FdcanRxf1a),
        0xC0 => Transmit,
        0xC4 => Same(Register::FdcanTxfqs),
        0xC8 => Same(Register::FdcanTxbrp),
        0xCC => Same(Register::FdcanTxbar),
        0xD0 => Same(Register::FdcanTxbcr),
        0xD4 => Same(Register::FdcanTxbto),
        0xD8 => Same(Register::FdcanTxbcf),
        0xDC => Same(Register::FdcanTxbtie),
        0xE0 => Same(Register::FdcanTxbcie),
        0xE4 => Same(Register::FdcanTxefs),
        0xE8 => Same(Register::FdcanTxefa),
        0x100 => Divider,
        _ => return None,
    })
}

/// Where a controller's part of the message RAM lies, and its registers.
#[derive(Debug, Clone, Copy)]
pub struct FixedLayout {
    /// Its registers.
    pub table: &'static [RegisterSpec],
    /// Its first word.
    pub first_word: u32,
}

impl FixedLayout {
    /// The values that the controller's registers would hold if it had them.
    pub(super) fn lay_out(&self, controller: &mut Controller) {
        let at = |word: u32| (self.first_word + word) << 2;
        let [first, second] = RECEIVE;
        for (register, value) in [
            (Register::FdcanSidfc, at(STANDARD_FILTERS)),
            (Register::FdcanXidfc, at(EXTENDED_FILTERS)),
            (Register::FdcanRxf0c, at(first) | ELEMENTS << 16),
            (Register::FdcanRxf1c, at(second) | ELEMENTS << 16),
            (Register::FdcanRxesc, RECEIVE_SIZES),
            (Register::FdcanTxefc, at(EVENTS) | ELEMENTS << 16),
            (Register::FdcanTxbc, at(TRANSMIT) | ELEMENTS << 24),
            (Register::FdcanTxesc, TRANSMIT_SIZE),
        ] {
            let known = controller.lay_out(register, value);
            debug_assert!(known, "a register of the layout");
        }
    }

    /// What a row reads, and what reading does.
    pub(super) fn read(
        &self,
        row: usize,
        controller: &mut Controller,
        now: VirtualNanos,
        activity: Activity,
    ) -> u32 {
        match meaning(self.table[row].offset) {
            Some(Meaning::Same(register)) => controller.read(register, now, activity),
            _ => self.peek(row, controller, now, activity),
        }
    }

    /// What a row reads, with nothing changed.
    pub(super) fn peek(
        &self,
        row: usize,
        controller: &Controller,
        now: VirtualNanos,
        activity: Activity,
    ) -> u32 {
        let get = |register| controller.peek(register, now, activity);
        match meaning(self.table[row].offset) {
            Some(Meaning::Same(register)) => get(register),
            Some(Meaning::Flags(register)) => gathered(get(register)),
            Some(Meaning::Lines) => {
                let flags = gathered(get(Register::FdcanIls));
                (0..).zip(GROUPS).map(|(bit, (first, _))| (flags >> first & 1) << bit).sum()
            }
            Some(Meaning::Filters) => {
                let overwrites = |fifo| get(fifo) >> 31;
                get(Register::FdcanGfc)
                    | overwrites(Register::FdcanRxf1c) << 8
                    | overwrites(Register::FdcanRxf0c) << 9
                    | (get(Register::FdcanSidfc) >> 16 & 0x1F) << 16
                    | (get(Register::FdcanXidfc) >> 16 & 0xF) << 24
            }
            Some(Meaning::Transmit) => (get(Register::FdcanTxbc) >> 30 & 1) << 24,
            Some(Meaning::Divider) | None => 0,
        }
    }

    /// A row is written.
    pub(super) fn write(
        &self,
        row: usize,
        value: u32,
        controller: &mut Controller,
        context: &mut DeviceContext<'_>,
    ) {
        match meaning(self.table[row].offset) {
            Some(Meaning::Same(register)) => controller.write(register, value, context),
            Some(Meaning::Flags(register)) => controller.write(register, scattered(value), context),
            Some(Meaning::Lines) => {
                let group = |(bit, (first, last)): (u32, (usize, usize))| {
                    if value >> bit & 1 == 1 {
                        (first..=last).map(|flag| 1 << flag).sum()
                    } else {
                        0
                    }
                };
                let flags: u32 = (0..).zip(GROUPS).map(group).sum();
                controller.write(Register::FdcanIls, scattered(flags), context);
            }
            Some(Meaning::Filters) => {
                let [first, second] = RECEIVE;
                let at = |word: u32| (self.first_word + word) << 2;
                let fifo =
                    |word: u32, overwrites: u32| at(word) | ELEMENTS << 16 | overwrites << 31;
                controller.write(Register::FdcanGfc, value & 0x3F, context);
                controller.write(
                    Register::FdcanSidfc,
                    at(STANDARD_FILTERS) | (value >> 16 & 0x1F) << 16,
                    context,
                );
                controller.write(
                    Register::FdcanXidfc,
                    at(EXTENDED_FILTERS) | (value >> 24 & 0xF) << 16,
                    context,
                );
                controller.write(Register::FdcanRxf0c, fifo(first, value >> 9 & 1), context);
                controller.write(Register::FdcanRxf1c, fifo(second, value >> 8 & 1), context);
            }
            Some(Meaning::Transmit) => {
                let queue = (value >> 24 & 1) << 30;
                let config = (self.first_word + TRANSMIT) << 2 | ELEMENTS << 24 | queue;
                controller.write(Register::FdcanTxbc, config, context);
            }
            Some(Meaning::Divider) if value != 0 => {
                context.tell("CKDIV", "the divider of the kernel clock is not modelled");
            }
            Some(Meaning::Divider) | None => {}
        }
    }
}

/// The flags of the STM32H7's places at their places here.
fn gathered(flags: u32) -> u32 {
    (0..).zip(FLAGS).map(|(here, there)| (flags >> there & 1) << here).sum()
}

/// The other way round.
fn scattered(flags: u32) -> u32 {
    (0..).zip(FLAGS).map(|(here, there): (u32, u32)| (flags >> here & 1) << there).sum()
}

#[cfg(test)]
mod tests;
