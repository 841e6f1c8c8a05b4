//! Where the emulator does not do what the part would: every place that the image may reach, with
//! its reason. A gap that is not here fails the test that meets it, and so does an entry that a
//! whole life of the board no longer meets.

use std::collections::BTreeSet;
use std::fmt;

use rigless::device::Told;
use rigless::soc::Bus;
use virtual_board::board::Board;
use virtual_board::machine::Machine;

/// What the emulator said of an access.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A register that no model implements.
    Unimplemented,
    /// No register at this address.
    Unmapped,
    /// Refused, as while a clock gate is shut.
    Refused,
    /// An address between a peripheral's registers.
    Undefined,
    /// An interrupt that the core has no line for; the address is its number.
    Unrouted,
    /// A model was asked for what it does not do, or what the manual forbids.
    Told,
}

/// A gap that may be met.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    pub kind: Kind,
    pub address: u64,
    pub register: &'static str,
    pub reason: &'static str,
}

/// The list of the board.
pub fn known() -> &'static [Known] {
    match Board::chosen() {
        Board::NucleoH743zi => H743,
        Board::NucleoG474re => G474,
    }
}

const H743: &[Known] = &[
    gap(
        Kind::Told,
        0x5802_4428,
        "RCC.PLLCKSELR",
        "embassy-stm32 writes the dividers of PLL2 and PLL3 while PLL1 runs; their fields, which \
         hold nothing in use, are in the register that also holds PLL1's",
    ),
    gap(
        Kind::Told,
        0x5802_4470,
        "RCC.BDCR",
        "embassy-stm32 writes RTCSEL, the value that stands there already; no RTC is used",
    ),
];

/// Settings of the STM32G474 that have no effect here.
const G474: &[Known] = &[
    without_effect(0x4000_7000, "PWR.CR1"),
    without_effect(0x4000_7008, "PWR.CR3"),
    without_effect(0x4000_7080, "PWR.CR5"),
    without_effect(0x4001_0000, "SYSCFG.MEMRMP"),
    without_effect(0x4001_000C, "SYSCFG.EXTICR1"),
    without_effect(0xE004_2004, "DBGMCU.CR"),
];

const fn without_effect(address: u64, register: &'static str) -> Known {
    let reason = "it keeps what is written, and nothing else depends on it";
    gap(Kind::Unimplemented, address, register, reason)
}

/// A gap that may be met.
pub const fn gap(kind: Kind, address: u64, register: &'static str, reason: &'static str) -> Known {
    Known { kind, address, register, reason }
}

/// A gap that was met.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Met {
    pub kind: Kind,
    pub address: u64,
    pub what: String,
}

impl fmt::Display for Met {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} {:#010x} {}", self.kind, self.address, self.what)
    }
}

/// The gaps that a board has met since it was switched on.
pub fn met(machine: &mut Machine) -> BTreeSet<Met> {
    let reports = machine.reports();
    let bus = machine.part().bus();
    let mut met = BTreeSet::new();
    let mut add = |kind, address, what: String| met.insert(Met { kind, address, what });
    for (address, gap) in &reports.unimplemented {
        add(Kind::Unimplemented, *address, format!("{}.{}", gap.instance, gap.register));
    }
    for gap in &reports.unmapped {
        add(Kind::Unmapped, gap.address, format!("from {:#010x}", gap.program_counter));
    }
    for (address, fault) in &reports.refused {
        add(Kind::Refused, *address, fault.to_string());
    }
    for (address, gap) in &reports.undefined {
        add(Kind::Undefined, *address, gap.instance.to_owned());
    }
    for (instance, number) in &reports.unrouted {
        add(Kind::Unrouted, u64::from(*number), (*instance).to_owned());
    }
    for told in &reports.told {
        add(
            Kind::Told,
            address_of(bus, told),
            format!("{}.{}: {}", told.instance, told.register, told.reason),
        );
    }
    met
}

/// Where a register is; an instance's first address where it has no register of that name, 0
/// without the instance.
fn address_of(bus: &Bus, told: &Told) -> u64 {
    let mut peripherals = bus.slots().iter().map(|slot| slot.peripheral());
    let Some(peripheral) = peripherals.find(|peripheral| peripheral.name == told.instance) else {
        return 0;
    };
    let register = peripheral.registers.iter().find(|register| register.name == told.register);
    peripheral.base + register.map_or(0, |register| u64::from(register.offset))
}

impl Known {
    fn is(&self, met: &Met) -> bool {
        (self.kind, self.address) == (met.kind, met.address)
    }
}

/// Nothing was met that is not in the list.
/// Fails with what was.
pub fn check_known(met: &BTreeSet<Met>, known: &[Known]) -> Result<(), String> {
    let new: Vec<_> = met.iter().filter(|met| !known.iter().any(|known| known.is(met))).collect();
    if new.is_empty() {
        return Ok(());
    }
    let lines: Vec<_> = new.iter().map(ToString::to_string).collect();
    Err(format!(
        "the emulator has gaps that tests/board/gaps.rs does not list:\n{}",
        lines.join("\n")
    ))
}

/// Every entry of the list was met.
/// Fails with those that were not.
pub fn check_met(met: &BTreeSet<Met>, known: &[Known]) -> Result<(), String> {
    let gone: Vec<_> = known.iter().filter(|known| !met.iter().any(|met| known.is(met))).collect();
    if gone.is_empty() {
        return Ok(());
    }
    let line = |Known { kind, address, register, reason }: &&Known| {
        format!("{kind:?} {address:#010x} {register}: {reason}")
    };
    let lines: Vec<_> = gone.into_iter().map(|known| line(&known)).collect();
    Err(format!("tests/board/gaps.rs lists what no longer occurs:\n{}", lines.join("\n")))
}
