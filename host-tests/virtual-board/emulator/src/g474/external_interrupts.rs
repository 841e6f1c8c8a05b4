//! The EXTI of the STM32G474, as far as its pins go: lines 0 to 15, each of which SYSCFG_EXTICR
//! gives to a port.
//!
//! Sources: the registers in stm32-metapac 21 (`exti_v1`, `syscfg_g4`), the driver of embassy-stm32
//! 0.6.0 (`exti`), and the emulator's model of the STM32H743's EXTI, which takes edges in the same
//! way. Not modelled: the lines above 15, and events.

use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange};
use rigless::snapshot::store;
use rigless::soc::{RegisterSpec, Width};

use super::{PORTS, tables};
use crate::edges;
use crate::row::Row;

/// The instance's name.
pub const NAME: &str = "EXTI";
/// Lines that pins have.
const LINES: usize = 16;
/// Which lines each interrupt of the instance stands for: EXTI0 to EXTI4, EXTI9_5, EXTI15_10.
const INTERRUPTS: [u64; 7] = [1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 0x03E0, 0xFC00];
/// Numbers of those interrupts.
pub const INTERRUPT_NUMBERS: [u16; 7] = [6, 7, 8, 9, 10, 23, 40];
/// SYSCFG_EXTICR1, four lines in each of four registers.
const EXTICR1: u64 = 0x08;

/// The controller.
#[derive(Debug)]
pub struct ExternalInterrupts {
    table: &'static [RegisterSpec],
    syscfg: u64,
    /// The levels of the ports' pins.
    levels: [u16; PORTS.len()],
    raised: [bool; INTERRUPTS.len()],
}

store!(ExternalInterrupts { values: [levels, raised], parts: [], built: [table, syscfg] });

impl Default for ExternalInterrupts {
    /// With every pin low.
    fn default() -> Self {
        Self {
            table: tables::named(NAME).registers,
            syscfg: tables::named("SYSCFG").base,
            levels: [0; PORTS.len()],
            raised: [false; INTERRUPTS.len()],
        }
    }
}

impl ExternalInterrupts {
    fn row(&self, register: &str) -> Row {
        tables::row(self.table, register)
    }

    fn pend(&self, lines: u64, registers: &mut RegisterFile) {
        let pending = self.row("PR0");
        registers.set(pending, registers.get(pending) | lines);
    }

    fn refresh(&mut self, registers: &RegisterFile, context: &mut DeviceContext<'_>) {
        let active = registers.get(self.row("PR0")) & registers.get(self.row("IMR0"));
        let raised = |interrupt: usize| active & INTERRUPTS[interrupt] != 0;
        edges::follow(&mut self.raised, raised, |interrupt, level| {
            context.interrupt(interrupt, level)
        });
    }
}

impl Device for ExternalInterrupts {
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
        if row == self.row("SWIER0") {
            self.pend(value, registers);
        }
        // PR itself is cleared by what is written to it: see `super::bus`.
        self.refresh(registers, context);
    }

    /// A pin has changed: whether its port has the line, SYSCFG knows.
    fn on_request(
        &mut self,
        request: RequestChange,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let Some(port) = PORTS.iter().position(|port| *port == request.instance) else { return };
        let (line, bit) = (request.request, 1 << request.request);
        let high = request.level == Level::High;
        if line >= LINES || (self.levels[port] & bit != 0) == high {
            return;
        }
        self.levels[port] ^= bit;
        let edge = self.row(if high { "RTSR0" } else { "FTSR0" });
        if registers.get(edge) >> line & 1 == 1 {
            let group = u64::try_from(line / 4).expect("one of four");
            context.read_from(self.syscfg + EXTICR1 + 4 * group, Width::W32, token(port, line));
        }
    }

    fn on_access(
        &mut self,
        token: u64,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let (port, line) = (token / 16, token % 16);
        if value >> (4 * (line % 4)) & 0xF == port {
            self.pend(1 << line, registers);
            self.refresh(registers, context);
        }
    }

    fn on_refused(&mut self, _: u64, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        context.tell("EXTICR", "an edge came while SYSCFG had no clock");
    }

    fn reset(&mut self) {
        (self.levels, self.raised) = ([0; PORTS.len()], [false; INTERRUPTS.len()]);
    }
}

fn token(port: usize, line: usize) -> u64 {
    u64::try_from(port * 16 + line).expect("a small number")
}
