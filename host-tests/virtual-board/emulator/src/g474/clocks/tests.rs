use rigless::mcu::{Mcu, Operate};
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::*;
use crate::g474::Stm32g474;

const CR: u64 = 0x4002_1000;
const CFGR: u64 = 0x4002_1008;
const PLLCFGR: u64 = 0x4002_100C;
const CCIPR: u64 = 0x4002_1088;
const CSR: u64 = 0x4002_1094;

fn part() -> Stm32g474 {
    let mut part = Stm32g474::new().expect("a part");
    part.attach_hse(VirtualNanos(0), 24_000_000);
    part
}

fn write(part: &mut Stm32g474, address: u64, value: u64) {
    part.write(VirtualNanos(0), address, Width::W32, value).expect("a register");
}

fn read(part: &mut Stm32g474, address: u64) -> u64 {
    part.read(VirtualNanos(0), address, Width::W32).expect("a register")
}

fn hz(part: &Stm32g474, source: Source) -> u64 {
    part.clocks.frequency(source, part.bus().registers(NAME).expect("it is there"))
}

#[test]
fn the_sequence_of_the_board_gives_168_mhz_and_84_for_can() {
    let mut part = part();
    assert_eq!(hz(&part, Source::Core), 16_000_000, "HSI after a reset");
    // HSE on; PLL from it, / 2 x 28, Q / 4, R / 2, both on.
    write(&mut part, CR, 0x0001_0500);
    assert_eq!(read(&mut part, CR), 0x0003_0500);
    write(&mut part, PLLCFGR, 3 | 1 << 4 | 28 << 8 | 1 << 20 | 1 << 21 | 1 << 24);
    write(&mut part, CR, 0x0101_0500);
    assert_eq!(read(&mut part, CR), 0x0303_0500);
    write(&mut part, CFGR, 0x3);
    assert_eq!(read(&mut part, CFGR), 0xF, "SWS follows");
    write(&mut part, CCIPR, 1 << 24);
    assert_eq!(hz(&part, Source::Core), 168_000_000);
    assert_eq!(hz(&part, Source::Timer1), 168_000_000);
    assert_eq!(hz(&part, Source::Can), 84_000_000);
    // AHB by 4, APB1 by 2: timers there run at twice its clock.
    write(&mut part, CFGR, 0x3 | 0b1001 << 4 | 0b100 << 8);
    assert_eq!(hz(&part, Source::Core), 42_000_000);
    assert_eq!(hz(&part, Source::Timer1), 42_000_000);
    assert_eq!(hz(&part, Source::Serial("USART3SEL", Apb::First)), 21_000_000);
}

#[test]
fn without_a_crystal_it_is_never_ready_and_nothing_switches_to_it() {
    let mut part = Stm32g474::new().expect("a part");
    write(&mut part, CR, 0x0001_0500);
    assert_eq!(read(&mut part, CR), 0x0001_0500);
    write(&mut part, CFGR, 0x2);
    assert_eq!(read(&mut part, CFGR), 0x6, "SWS stays at HSI");
}

/// The firmware only reads CR while it waits.
#[test]
fn a_crystal_that_comes_late_is_ready_without_another_write() {
    let mut part = Stm32g474::new().expect("a part");
    write(&mut part, CR, 0x0001_0500);
    part.attach_hse(VirtualNanos(0), 24_000_000);
    assert_eq!(read(&mut part, CR), 0x0003_0500);
    assert_eq!(hz(&part, Source::Can), 24_000_000);
}

#[test]
fn the_flags_say_why_until_they_are_cleared() {
    let mut part = part();
    assert_eq!(read(&mut part, CSR), 0x0C00_0000, "power-on");
    write(&mut part, CSR, 1 << 23);
    assert_eq!(read(&mut part, CSR), 0);
    part.reset(VirtualNanos(0), ResetCause::Model("IWDG"));
    assert_eq!(read(&mut part, CSR), 0x2400_0000);
    part.reset(VirtualNanos(0), ResetCause::Core);
    assert_eq!(read(&mut part, CSR), 0x3400_0000, "both, as nobody has cleared them");
    part.reset(VirtualNanos(0), ResetCause::PowerOn);
    assert_eq!(read(&mut part, CSR), 0x0C00_0000);
}
