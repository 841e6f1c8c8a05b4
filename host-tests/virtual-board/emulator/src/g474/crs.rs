//! The clock recovery system of the STM32G474, and HSI48, the oscillator that it trims.
//!
//! Sources: the registers in stm32-metapac 21 (`crs_v1`), whose TRIM lacks the seventh bit; reset
//! values of stm32g4 0.16; RM0440's CRS chapter. A start of a frame compares what HSI48 has counted
//! since the one before with RELOAD + 1:
//!
//! | Off by | Flag | TRIM, with AUTOTRIMEN |
//! |---|---|---|
//! | less than FELIM | SYNCOK | stays |
//! | less than 3 × FELIM | SYNCOK | one step |
//! | less than 128 × FELIM | SYNCWARN | two steps |
//! | more | SYNCERR or SYNCMISS | stays |
//!
//! Not modelled, and told: other sources than USB, a divider, interrupts, SWSYNC.

use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange};
use rigless::snapshot::store;
use rigless::soc::{Access, Clock, FieldSpec, RegisterSpec};
use rigless::time::VirtualNanos;

use super::{tables, usb};
use crate::row::Row;

/// The instance's name.
pub const NAME: &str = "CRS";
/// Its clock output: HSI48.
pub const CLOCK: Clock = Clock::output(NAME, HSI48);
const HSI48: usize = 0;
/// Reset values that are not 0 (stm32g4 0.16).
pub const RESETS: [(&str, u64); 2] = [("CR", 0x0000_4000), ("CFGR", 0x2022_BB7F)];
/// The seventh bit of TRIM, bit 14 of CR.
pub static TRIM_6: FieldSpec = FieldSpec::new("TRIM_6", 14, 1, Access::ReadWrite);

/// CR.
const INTERRUPTS: u64 = 0xF;
const CEN: u64 = 1 << 5;
const AUTOTRIMEN: u64 = 1 << 6;
const SWSYNC: u64 = 1 << 7;
const TRIM_SHIFT: u32 = 8;
const TRIM: u64 = 0x7F << TRIM_SHIFT;
/// CFGR: SYNCSRC and SYNCDIV, of which only the USB without a divider is modelled.
const SYNCSRC_AND_DIV: u64 = 3 << 28 | 7 << 24;
const USB: u64 = 2 << 28;
/// ISR: flags that ICR clears, among them those that ERRC clears together, and what was captured.
const SYNCOKF: u64 = 1 << 0;
const SYNCWARNF: u64 = 1 << 1;
const ERRF: u64 = 1 << 2;
const ESYNCF: u64 = 1 << 3;
const SYNCERR: u64 = 1 << 8;
const SYNCMISS: u64 = 1 << 9;
const TRIMOVF: u64 = 1 << 10;
const FEDIR: u64 = 1 << 15;
const FECAP_SHIFT: u32 = 16;

/// HSI48 as it should be, at half of its trimming range.
const NOMINAL_HZ: u64 = 48_000_000;
const MIDDLE: u64 = 64;
/// How far off it is unless told otherwise, in millionths: more than USB allows, so that a firmware
/// has to have it trimmed.
const ERROR_PPM: i64 = 6_000;
/// What a step of TRIM changes, in millionths: 0.14 % (RM0440).
const STEP_PPM: i64 = 1_400;

/// HSI48 and what trims it.
#[derive(Debug)]
pub struct Crs {
    table: &'static [RegisterSpec],
    /// How far off the oscillator is by itself, in millionths.
    error_ppm: i64,
    configuration: u64,
    /// The last start of a frame.
    synchronised: Option<VirtualNanos>,
    driven: u64,
}

store!(Crs { values: [error_ppm, configuration, synchronised, driven], parts: [], built: [table] });

impl Crs {
    /// Out of reset, with an oscillator that is off by 0.6 %.
    #[must_use]
    pub fn new() -> Self {
        Self {
            table: tables::named(NAME).registers,
            error_ppm: ERROR_PPM,
            configuration: RESETS[1].1,
            synchronised: None,
            driven: 0,
        }
    }

    /// How far off HSI48 is before it is trimmed, in millionths. That acts with the next frame or
    /// write to CR.
    pub fn set_error(&mut self, ppm: i64) {
        self.error_ppm = ppm;
    }

    /// What HSI48 runs at, in hertz, whether it is on or not.
    #[must_use]
    pub const fn hsi48_hz(&self) -> u64 {
        self.driven
    }

    /// The part has been reset.
    pub fn restarted(&mut self, registers: &RegisterFile, context: &mut DeviceContext<'_>) {
        self.driven = 0;
        self.follow(registers, context);
    }

    fn row(&self, register: &str) -> Row {
        tables::row(self.table, register)
    }

    fn follow(&mut self, registers: &RegisterFile, context: &mut DeviceContext<'_>) {
        let trim = (registers.get(self.row("CR")) & TRIM) >> TRIM_SHIFT;
        let steps = i64::try_from(trim).expect("seven bits") - MIDDLE.cast_signed();
        let off = NOMINAL_HZ.cast_signed() / 1_000_000 * (self.error_ppm + steps * STEP_PPM);
        let hz = NOMINAL_HZ.saturating_add_signed(off);
        if hz != self.driven {
            self.driven = hz;
            context.clock(HSI48, hz);
        }
    }

    /// What HSI48 has counted in this time beyond RELOAD, one frame's worth.
    fn off_by(&self, since: VirtualNanos, now: VirtualNanos) -> i64 {
        let counted = (now.0 - since.0) * (self.driven / 1_000) / 1_000_000;
        let reload = self.configuration & 0xFFFF;
        counted.cast_signed() - reload.cast_signed() - 1
    }

    fn synchronise(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let Some(since) = self.synchronised.replace(context.now()) else { return };
        let off_by = self.off_by(since, context.now());
        let (control, status) = (self.row("CR"), self.row("ISR"));
        let limit = self.configuration >> 16 & 0xFF;
        let (flag, steps) = match off_by.unsigned_abs() {
            off if off < limit => (SYNCOKF, 0),
            off if off < 3 * limit => (SYNCOKF, 1),
            off if off < 128 * limit => (SYNCWARNF, 2),
            _ if off_by < 0 => (ERRF | SYNCERR, 0),
            _ => (ERRF | SYNCMISS, 0),
        };
        let direction = if off_by < 0 { FEDIR } else { 0 };
        let captured = off_by.unsigned_abs().min(0xFFFF) << FECAP_SHIFT;
        let flags = registers.get(status)
            & (SYNCOKF | SYNCWARNF | ERRF | ESYNCF | SYNCERR | SYNCMISS | TRIMOVF);
        let mut now = flags | flag | direction | captured | ESYNCF;
        if registers.get(control) & AUTOTRIMEN != 0 {
            let trim = (registers.get(control) & TRIM) >> TRIM_SHIFT;
            let wanted = if off_by < 0 { trim + steps } else { trim.saturating_sub(steps) };
            let trimmed = wanted.min(TRIM >> TRIM_SHIFT);
            if trimmed.abs_diff(trim) != steps {
                now |= ERRF | TRIMOVF;
            }
            registers.set(control, registers.get(control) & !TRIM | trimmed << TRIM_SHIFT);
        }
        registers.set(status, now);
        self.follow(registers, context);
    }
}

impl Default for Crs {
    fn default() -> Self {
        Self::new()
    }
}

impl Device for Crs {
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
        let (control, configuration) = (self.row("CR"), self.row("CFGR"));
        let enabled = registers.get(control) & CEN != 0;
        match self.table[row.0].name {
            "CR" => {
                if value & (INTERRUPTS | SWSYNC) != 0 {
                    context.tell("CR", "interrupts and SWSYNC are not modelled");
                }
                if !enabled {
                    self.synchronised = None;
                } else if self.configuration & SYNCSRC_AND_DIV != USB {
                    context.tell("CFGR", "only the frames of the USB, undivided, are modelled");
                }
                self.follow(registers, context);
            }
            "CFGR" if enabled => {
                context.tell("CFGR", "written while CEN is set");
                registers.set(configuration, self.configuration);
            }
            "CFGR" => self.configuration = value,
            "ICR" => {
                let errors = if value & ERRF == 0 { 0 } else { SYNCERR | SYNCMISS | TRIMOVF };
                let status = self.row("ISR");
                registers.set(status, registers.get(status) & !(value & 0xF | errors));
            }
            _ => {}
        }
    }

    /// A frame has started.
    fn on_request(
        &mut self,
        request: RequestChange,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let frame = (usb::NAME, usb::START_OF_FRAME, Level::High);
        let enabled = registers.get(self.row("CR")) & CEN != 0;
        if (request.instance, request.request, request.level) == frame
            && enabled
            && self.configuration & SYNCSRC_AND_DIV == USB
        {
            self.synchronise(registers, context);
        }
    }

    fn reset(&mut self) {
        (self.configuration, self.synchronised) = (RESETS[1].1, None);
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.reset();
        self.follow(registers, context);
    }
}

#[cfg(test)]
mod tests;
