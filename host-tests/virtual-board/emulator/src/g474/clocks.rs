//! The reset and clock controller of the STM32G474, as far as it clocks what has a model:
//! oscillators and PLL that are ready at once, the system clock, and what of it reaches the
//! peripherals that count time.
//!
//! Sources: the fields in stm32-metapac 21 (`rcc_g4`), the sequences and formulas of embassy-stm32
//! 0.6.0 (`rcc/g4`), the reset values and flags of RM0440's RCC chapter as stm32g4 0.16 (SVD) has
//! them.
//!
//! | Register | Behaviour |
//! |---|---|
//! | CR, CRRCR, CSR, BDCR | an oscillator or the PLL is ready as soon as it is on; an HSE without a crystal never is |
//! | CFGR | SWS follows SW if that clock runs |
//! | CSR | the flags of the last resets, until RMVF |
//! | CR CSSON | a crystal that stops moves the system to the HSI, stops the PLL that it feeds and sets CIFR CSSF; the NMI is up to the caller |
//! | not modelled | start-up times, the low-speed crystal |

use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange, ResetCause};
use rigless::snapshot::store;
use rigless::soc::{Clock, FieldSpec, RegisterSpec};

use super::tables;
use crate::row::Row;

/// The internal oscillators but HSI48, of which [`super::crs`] tells.
const HSI_HZ: u64 = 16_000_000;
const LSI_HZ: u64 = 32_000;
/// The instance's name.
pub const NAME: &str = "RCC";
/// The code of SW and SWS for the HSI.
const HSI: u64 = 1;
/// RCC_CSR after power-on: BORRSTF and PINRSTF.
const POWER_ON_FLAGS: u64 = 0x0C00_0000;
/// Reset values that are not 0 (stm32g4 0.16).
pub const RESETS: [(&str, u64); 6] = [
    ("CR", 0x0000_0500),
    ("ICSCR", 0x4000_0000),
    ("CFGR", 0x0000_0005),
    ("PLLCFGR", 0x0000_1000),
    ("AHB1ENR", 0x0000_0100),
    ("APB1ENR1", 0x0000_0400),
];

/// What clocks a peripheral that counts time.
#[derive(Debug, Clone, Copy)]
enum Source {
    /// The core.
    Core,
    /// The timers of the first peripheral bus.
    Timer1,
    /// The field of CCIPR that selects among a peripheral bus's clock, SYSCLK, HSI and LSE.
    Serial(&'static str, Apb),
    /// FDCANSEL.
    Can,
    /// CLK48SEL.
    Usb,
    /// The LSI.
    Watchdog,
}

#[derive(Debug, Clone, Copy)]
enum Apb {
    First,
    Second,
}

/// The controller's clock outputs, by number.
const OUTPUTS: [(&str, Source); 13] = [
    (rigless::cpu::armv7m::DWT, Source::Core),
    ("TIM2", Source::Timer1),
    ("LPUART1", Source::Serial("LPUART1SEL", Apb::First)),
    ("USART1", Source::Serial("USART1SEL", Apb::Second)),
    ("USART2", Source::Serial("USART2SEL", Apb::First)),
    ("USART3", Source::Serial("USART3SEL", Apb::First)),
    ("UART4", Source::Serial("UART4SEL", Apb::First)),
    ("UART5", Source::Serial("UART5SEL", Apb::First)),
    ("FDCAN1", Source::Can),
    ("FDCAN2", Source::Can),
    ("FDCAN3", Source::Can),
    ("IWDG", Source::Watchdog),
    ("USB", Source::Usb),
];

/// Who runs on which output.
pub fn clocked() -> impl Iterator<Item = (&'static str, Clock)> {
    OUTPUTS
        .iter()
        .enumerate()
        .map(|(number, (instance, _))| (*instance, Clock::output(NAME, number)))
}

/// The controller.
#[derive(Debug)]
pub struct Clocks {
    table: &'static [RegisterSpec],
    /// The crystal or the clock on the HSE pins; 0 where there is none.
    hse_hz: u64,
    /// HSI48 while it is on.
    hsi48_hz: u64,
    /// The watchdog runs, and so does the LSI.
    watchdog: bool,
    /// SWS: what clocks the system.
    system: u64,
    /// Why the part was reset: the top byte of CSR.
    flags: u64,
    driven: [Option<u64>; OUTPUTS.len()],
}

store!(Clocks {
    values: [hse_hz, hsi48_hz, watchdog, system, flags, driven],
    parts: [],
    built: [table]
});

impl Default for Clocks {
    /// Without a crystal.
    fn default() -> Self {
        let table = tables::named(NAME).registers;
        Self {
            table,
            hse_hz: 0,
            hsi48_hz: 0,
            watchdog: false,
            system: HSI,
            flags: 0,
            driven: [None; OUTPUTS.len()],
        }
    }
}

impl Clocks {
    /// Puts a crystal on the HSE pins: ready at once if the HSE is on.
    pub fn attach_crystal(
        &mut self,
        hz: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.hse_hz = hz;
        self.follow(registers, context);
    }

    /// The crystal stops. Whether the clock security system has noticed (RM0440, RCC chapter).
    pub fn lose_crystal(
        &mut self,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> bool {
        let watched =
            ["CSSON", "HSERDY"].into_iter().all(|field| self.get(registers, "CR", field) == 1);
        self.hse_hz = 0;
        if watched {
            self.set(registers, "CR", "HSEON", false);
            if self.get(registers, "PLLCFGR", "PLLSRC") == 3 {
                self.set(registers, "CR", "PLLON", false);
            }
            let (config, sw) = (self.row("CFGR"), self.field("CFGR", "SW"));
            registers.set(config, sw.set(registers.get(config), HSI));
            self.set(registers, "CIFR", "CSSF", true);
        }
        self.follow(registers, context);
        watched
    }

    /// The part was reset. What the flags said before stays, until RMVF or the loss of power.
    pub fn restarted(
        &mut self,
        cause: ResetCause,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let flag = |name| self.field("CSR", name).mask();
        let kept = self.flags;
        self.flags = match cause {
            ResetCause::PowerOn => POWER_ON_FLAGS,
            ResetCause::Core => kept | flag("SFTRSTF") | flag("PINRSTF"),
            ResetCause::Model("IWDG") => kept | flag("IWDGRSTF") | flag("PINRSTF"),
            _ => kept | flag("PINRSTF"),
        };
        (self.watchdog, self.system) = (false, HSI);
        self.driven = [None; OUTPUTS.len()];
        self.follow(registers, context);
    }

    fn row(&self, register: &str) -> Row {
        tables::row(self.table, register)
    }

    fn field(&self, register: &str, field: &str) -> &'static FieldSpec {
        tables::field(self.table, register, field)
    }

    fn get(&self, registers: &RegisterFile, register: &str, field: &str) -> u64 {
        self.field(register, field).get(registers.get(self.row(register)))
    }

    fn set(&self, registers: &mut RegisterFile, register: &str, field: &str, value: bool) {
        let (row, field) = (self.row(register), self.field(register, field));
        registers.set(row, field.set(registers.get(row), value.into()));
    }

    /// Settles what reads back, and drives the clocks that have changed.
    fn follow(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let hse = self.hse_hz > 0 && self.get(registers, "CR", "HSEON") == 1;
        self.set(registers, "CR", "HSERDY", hse);
        for (register, on, ready) in
            [("CR", "HSION", "HSIRDY"), ("CR", "PLLON", "PLLRDY"), ("CRRCR", "HSI48ON", "HSI48RDY")]
        {
            let on = self.get(registers, register, on) == 1;
            self.set(registers, register, ready, on);
        }
        let lsi = self.watchdog || self.get(registers, "CSR", "LSION") == 1;
        let csr = self.row("CSR");
        let switch = self.field("CSR", "LSION").mask();
        registers.set(csr, registers.get(csr) & switch | self.flags);
        self.set(registers, "CSR", "LSIRDY", lsi);
        let (config, sw, sws) =
            (self.row("CFGR"), self.field("CFGR", "SW"), self.field("CFGR", "SWS"));
        let wanted = sw.get(registers.get(config));
        if self.system_of(wanted, registers) > 0 {
            self.system = wanted;
        }
        registers.set(config, sws.set(registers.get(config), self.system));
        for (number, (_, source)) in OUTPUTS.iter().enumerate() {
            let hz = self.frequency(*source, registers);
            if self.driven[number] != Some(hz) {
                self.driven[number] = Some(hz);
                context.clock(number, hz);
            }
        }
    }

    fn frequency(&self, source: Source, registers: &RegisterFile) -> u64 {
        let core = self.system(registers) / self.ahb_divider(registers);
        match source {
            Source::Core => core,
            Source::Timer1 => match self.apb_divider(Apb::First, registers) {
                1 => core,
                divider => 2 * core / divider,
            },
            Source::Serial(select, apb) => match self.get(registers, "CCIPR", select) {
                0 => core / self.apb_divider(apb, registers),
                1 => self.system(registers),
                2 => HSI_HZ * self.get(registers, "CR", "HSIRDY"),
                _ => 0,
            },
            Source::Can => match self.get(registers, "CCIPR", "FDCANSEL") {
                0 => self.hse(registers),
                1 => self.pll(registers, "PLLQEN", "PLLQ"),
                2 => core / self.apb_divider(Apb::First, registers),
                _ => 0,
            },
            Source::Usb => match self.get(registers, "CCIPR", "CLK48SEL") {
                0 => self.hsi48_hz * self.get(registers, "CRRCR", "HSI48RDY"),
                2 => self.pll(registers, "PLLQEN", "PLLQ"),
                _ => 0,
            },
            Source::Watchdog => LSI_HZ * self.get(registers, "CSR", "LSIRDY"),
        }
    }

    fn hse(&self, registers: &RegisterFile) -> u64 {
        self.hse_hz * self.get(registers, "CR", "HSERDY")
    }

    fn system(&self, registers: &RegisterFile) -> u64 {
        self.system_of(self.system, registers)
    }

    /// The clock that a code of SW selects; 0 while it does not run.
    fn system_of(&self, code: u64, registers: &RegisterFile) -> u64 {
        match code {
            HSI => HSI_HZ * self.get(registers, "CR", "HSIRDY"),
            2 => self.hse(registers),
            3 => self.pll(registers, "PLLREN", "PLLR"),
            _ => 0,
        }
    }

    /// An output of the PLL with a divider of 2, 4, 6 or 8.
    fn pll(&self, registers: &RegisterFile, enable: &str, divider: &str) -> u64 {
        if self.get(registers, "CR", "PLLRDY") == 0 || self.get(registers, "PLLCFGR", enable) == 0 {
            return 0;
        }
        let input = match self.get(registers, "PLLCFGR", "PLLSRC") {
            2 => HSI_HZ * self.get(registers, "CR", "HSIRDY"),
            3 => self.hse(registers),
            _ => 0,
        };
        let [multiplier, before, after] =
            ["PLLN", "PLLM", divider].map(|field| self.get(registers, "PLLCFGR", field));
        input / (before + 1) * multiplier / (2 * (after + 1))
    }

    fn ahb_divider(&self, registers: &RegisterFile) -> u64 {
        match self.get(registers, "CFGR", "HPRE") {
            code @ 0b1000..=0b1011 => 2 << (code & 0b11),
            code @ 0b1100.. => 64 << (code & 0b11),
            _ => 1,
        }
    }

    fn apb_divider(&self, apb: Apb, registers: &RegisterFile) -> u64 {
        let field = match apb {
            Apb::First => "PPRE1",
            Apb::Second => "PPRE2",
        };
        match self.get(registers, "CFGR", field) {
            code @ 0b100.. => 2 << (code & 0b11),
            _ => 1,
        }
    }
}

impl Device for Clocks {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.table
    }

    fn write(
        &mut self,
        row: Row,
        _: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if row == self.row("CSR") && self.get(registers, "CSR", "RMVF") == 1 {
            self.flags = 0;
        }
        self.follow(registers, context);
    }

    /// HSI48 has been trimmed.
    fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.hsi48_hz = hz;
        self.follow(registers, context);
    }

    /// The watchdog starts the LSI.
    fn on_request(
        &mut self,
        request: RequestChange,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if request.instance == "IWDG" && request.level == Level::High {
            self.watchdog = true;
            self.follow(registers, context);
        }
    }
}

#[cfg(test)]
mod tests;
