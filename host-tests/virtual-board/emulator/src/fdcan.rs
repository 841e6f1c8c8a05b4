//! A model of the FDCAN controller of the STM32H743 (Bosch M_CAN), for classic CAN, with its bus.
//!
//! Sources, as the reference manual itself cannot be read here: the registers and their fields in
//! stm32-metapac 21 (`can_fdcan_h7`) and in the emulator's table of the SVD file; what
//! embassy-stm32 0.6.0 (`can/fd`) relies on; the descriptions of the same M_CAN core by Microchip
//! (onlinedocs.microchip.com, chapters MCAN: software initialization, PSR, TXBCF, Tx FIFO, Tx event
//! handling) and by TI (SPRUJ52); the way back from bus-off also after TI's SPRUHX5; issue 68953 of
//! Zephyr for what a controller keeps while it is bus-off; frames and error counters after ISO
//! 11898-1, which could not be read either, as the emulator's CAN seam and its models cite it.
//! Where these say nothing of a bit, the model follows what is generally known of the M_CAN, and a
//! board has the last word.
//!
//! | Feature | Behaviour |
//! |---|---|
//! | INIT, CCE | after reset set; configuration registers keep what they hold without both; CCE clears HPMS, FIFO states, requests |
//! | bit time | (NBRP+1)·(3+NTSEG1+NTSEG2) kernel clocks; 11 recessive bits before it joins |
//! | filters | ranges, pairs, masks, XIDAM, GFC, priority, dedicated buffers |
//! | reception | two FIFOs, blocking or overwriting, watermark, loss; dedicated buffers with NDAT |
//! | transmission | dedicated buffers, FIFO or queue, DAR, TXP, cancellation, event FIFO |
//! | errors | TEC, REC, CEL, LEC, warning, passive, bus-off; no acknowledgement: passive, never bus-off |
//! | bus-off | INIT set, requests stay pending; back after INIT is cleared and 129 × 11 recessive bits |
//! | restricted operation | after a sender's failed access to the message RAM, until ASM is cleared or the block is reset: it receives and acknowledges, sends neither frames nor error flags |
//! | not modelled, and told | CAN FD, TTCAN, test modes, timeout counter, RAM watchdog, external timestamps, debug messages |
//!
//! Choices where no source says: INIT, TXBAR and TXBCR act at once instead of after a few clocks;
//! TEC stays at its last value when the controller goes bus-off; a cancellation while INIT is set
//! is carried out at once.

mod bit_time;
mod controller;
mod element;
mod errors;
mod event_fifo;
mod filter;
pub(crate) mod fixed_layout;
mod interrupts;
mod node;
mod registers;
mod rx;
#[cfg(test)]
mod tests;
mod timestamp;
mod tx;
mod wire;

pub use bit_time::BitTime;
pub use node::{Node, Wiring};
pub use wire::{FrameEnd, FrameRecord, Sender};

use rigless::chip::can;
use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::soc::{Layout, RegisterSpec, Width};
use rigless::time::{EventId, VirtualNanos};

use crate::edges;
use crate::message_ram::MessageRam;
use crate::row::Row;
use controller::{Activity, Controller};
use fixed_layout::FixedLayout;
use interrupts::LINES;
use wire::Wire;

/// One controller, with the bus it is on and the nodes there.
#[derive(Debug)]
pub struct Fdcan {
    controller: Controller,
    wire: Wire,
    /// The levels that the interrupt lines were last driven to.
    driven: [bool; LINES],
    /// Where the message RAM is laid out for good: other registers.
    fixed: Option<FixedLayout>,
}

store!(Fdcan { values: [driven], parts: [controller, wire], built: [fixed] });

impl Fdcan {
    /// Out of reset, with nobody else on its bus, over the message RAM.
    #[must_use]
    pub fn new(ram: MessageRam) -> Self {
        Self {
            controller: Controller::new(ram),
            wire: Wire::new(),
            driven: [false; LINES],
            fixed: None,
        }
    }

    /// The same of an STM32G4, with its part of the message RAM.
    pub(crate) fn with_fixed_layout(ram: MessageRam, layout: FixedLayout) -> Self {
        let mut fdcan = Self { fixed: Some(layout), ..Self::new(ram) };
        Device::reset(&mut fdcan);
        fdcan
    }

    /// Hangs a node on the bus. `bitrate`: bits per second at which it runs, `None` for the
    /// controller's own. Returns its index.
    pub fn attach(&mut self, peer: impl can::Peer, bitrate: Option<u32>) -> usize {
        self.wire.nodes.push(Node::new(Box::new(peer), bitrate));
        self.wire.nodes.len() - 1
    }

    /// The nodes of the bus.
    pub fn nodes_mut(&mut self) -> &mut [Node] {
        &mut self.wire.nodes
    }

    /// How the controller is wired to the bus.
    pub fn set_wiring(&mut self, wiring: Wiring) {
        self.wire.set_wiring(wiring);
    }

    /// An access of its sender to the message RAM fails, as it may when the RAM is busy for too
    /// long: MRAF, and restricted operation.
    pub fn fail_message_ram(&mut self) {
        self.controller.restrict();
    }

    /// Every frame that was on the line since the last [`Fdcan::take_log`], failed ones too; at
    /// least the last 100 000 of them.
    #[must_use]
    pub fn log(&self) -> &[FrameRecord] {
        self.wire.log()
    }

    /// Takes the log away.
    pub fn take_log(&mut self) -> Vec<FrameRecord> {
        self.wire.take_log()
    }

    /// The duration of a bit as the controller is set up; `None` while its kernel clock stands.
    #[must_use]
    pub fn bit_time(&self) -> Option<BitTime> {
        self.controller.bit()
    }

    /// Whether the controller takes part in the bus: INIT is clear, and the line has been recessive
    /// for long enough.
    #[must_use]
    pub fn is_on_bus(&self) -> bool {
        self.controller.is_on()
    }

    /// Whether a frame of the controller is on the line.
    #[must_use]
    pub fn is_sending(&self) -> bool {
        self.activity() == Activity::Transmitter
    }

    /// The part restarted: the nodes did not.
    pub fn restarted(&mut self, context: &mut DeviceContext<'_>) {
        self.wire.controller_left(context.now());
        self.wire.part_restarted(context);
        self.advance(context);
    }

    fn activity(&self) -> Activity {
        if self.controller.is_on() { self.wire.activity() } else { Activity::Synchronizing }
    }

    fn write_word(&mut self, row: Row, value: u32, context: &mut DeviceContext<'_>) {
        if let Some(fixed) = self.fixed {
            fixed.write(row.0, value, &mut self.controller, context);
        } else if let Some(register) = Register::from_index(row.0) {
            self.controller.write(register, value, context);
        }
    }

    /// Carries out what is due, schedules what comes, and drives the interrupt lines.
    fn advance(&mut self, context: &mut DeviceContext<'_>) {
        let now = context.now();
        if !self.controller.is_on() {
            self.wire.controller_left(now);
        }
        let next = loop {
            let next = self.wire.advance(&mut self.controller, context);
            let recessive = self.controller.bit().and_then(|bit| self.wire.recessive(bit, now));
            let joined = self.controller.count_recessive(recessive);
            let stopped = self.controller.stop_clock(self.wire.is_free());
            if !joined && !stopped {
                break [
                    next,
                    self.controller.next_sequence(recessive),
                    self.controller.pass_time(now),
                ];
            }
        };
        for instant in next.into_iter().flatten() {
            context.schedule(instant);
        }
        self.drive(context);
    }

    fn drive(&mut self, context: &mut DeviceContext<'_>) {
        let lines = self.controller.lines();
        edges::follow(
            &mut self.driven,
            |line| lines[line],
            |line, level| context.interrupt(line, level),
        );
    }
}

impl Device for Fdcan {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.fixed.map_or(Register::REGISTERS, |fixed| fixed.table)
    }

    fn read(
        &mut self,
        row: Row,
        _: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        if context.access_width() != Some(Width::W32) {
            context.tell("FDCAN", "a register read otherwise than as a word");
        }
        let activity = self.activity();
        let value = match self.fixed {
            Some(fixed) => fixed.read(row.0, &mut self.controller, context.now(), activity),
            None => self.controller.read(Register::from_index(row.0)?, context.now(), activity),
        };
        Some(value.into())
    }

    fn peek(&self, row: Row, _: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        let value = match self.fixed {
            Some(fixed) => fixed.peek(row.0, &self.controller, now, self.activity()),
            None => self.controller.peek(Register::from_index(row.0)?, now, self.activity()),
        };
        Some(value.into())
    }

    fn write(
        &mut self,
        row: Row,
        value: u64,
        _: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match u32::try_from(value) {
            Ok(value) if context.access_width() == Some(Width::W32) => {
                self.write_word(row, value, context)
            }
            _ => context.tell("FDCAN", "a register written otherwise than as a word"),
        }
        self.advance(context);
    }

    fn on_event(&mut self, event: EventId, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.advance(context);
        self.wire.on_event(event, context);
        self.advance(context);
    }

    fn on_clock(&mut self, hz: u64, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.controller.follow_clock(context.now(), hz);
        self.advance(context);
    }

    fn poll(&mut self, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.advance(context);
    }

    fn reset(&mut self) {
        self.controller.reset();
        if let Some(fixed) = self.fixed {
            fixed.lay_out(&mut self.controller);
        }
        self.driven = [false; LINES];
    }

    fn reset_line(&mut self, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.reset();
        self.restarted(context);
    }
}
