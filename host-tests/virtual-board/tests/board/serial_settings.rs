//! How the firmware has set its three serial ports up: read from the registers, as the port's far
//! end sees them, and in the configuration of the pins.

use std::time::Duration;

use rigless::mcu::Operate;
use rigless::soc::Width;
use virtual_board::board::Board;
use virtual_board::machine::Machine;
use virtual_board::nodes::instant;
use virtual_board::usual;
use virtual_stm32::serial_port::DriverEnable;

use crate::lab::{Lab, bus_rs485};

/// Registers (RM0433, RM0440): offsets.
const CR1: u64 = 0x00;
const CR3: u64 = 0x08;
const BRR: u64 = 0x0C;
const MODER: u64 = 0x00;
const AFRL: u64 = 0x20;
/// Two bits of MODER: alternate function.
const ALTERNATE: u32 = 0b10;
/// PD4 to PD6 as USART2 (DS12110), PB10, PB11 and PB14 as USART3 (DS12288): tables of alternate
/// functions.
const AF_USART: u32 = 7;

/// What the RS485 port of the board is to be.
struct Rs485 {
    /// The USART's registers, and those of the port of its pins.
    usart: u64,
    gpio: u64,
    /// DE, TX and RX.
    pins: [u32; 3],
    /// BRR and what it makes of 115200.
    divider: u32,
    bits_per_second: u64,
}

impl Rs485 {
    fn of_board() -> Self {
        let (usart, gpio, pins, divider, bits_per_second) = match Board::chosen() {
            // 100 MHz / 868.
            Board::NucleoH743zi => (0x4000_4400, 0x5802_0C00, [4, 5, 6], 868, 115_207),
            // 168 MHz / 1458.
            Board::NucleoG474re => (0x4000_4800, 0x4800_0400, [14, 10, 11], 1458, 115_226),
        };
        Self { usart, gpio, pins, divider, bits_per_second }
    }
}

fn register(machine: &mut Machine, address: u64) -> u32 {
    let at = instant(machine.now());
    let value = machine.part_mut().peek(at, address, Width::W32).expect("a register");
    u32::try_from(value).expect("32 bits")
}

/// Within half a per cent of 921600, where two per cent are allowed: 100 MHz / 109; 256 × 168 MHz /
/// 46667 and 168 MHz / 182.
#[test]
fn both_host_links_run_at_921600_baud() {
    let lab = Lab::configured();
    let expected = match Board::chosen() {
        Board::NucleoH743zi => [917_431, 917_431],
        Board::NucleoG474re => [921_594, 923_077],
    };
    for (host, expected) in lab.outside.hosts.into_iter().zip(expected) {
        let settings = lab.machine.borrow_mut().line(host).settings();
        assert_eq!(settings.bits_per_second(), expected);
        assert_eq!(settings.driver_enable, None);
    }
}

#[test]
fn the_rs485_port_drives_its_transceiver_by_hardware() {
    let lab = Lab::configured();
    let mut machine = lab.machine.borrow_mut();
    let settings = machine.line(lab.outside.rs485).settings();
    let expected = Rs485::of_board();
    assert_eq!(settings.bits_per_second(), expected.bits_per_second);
    let enable = DriverEnable { assertion: 16, deassertion: 16, active_low: false };
    assert_eq!(settings.driver_enable, Some(enable));
    // The same in the registers: DEM; DEAT and DEDT of one bit each; the divider.
    assert_eq!(
        register(&mut machine, expected.usart + CR3) >> 14 & 0b11,
        0b01,
        "DEM, and DEP for an active-high output"
    );
    let control = register(&mut machine, expected.usart + CR1);
    assert_eq!((control >> 21 & 0x1F, control >> 16 & 0x1F), (16, 16), "DEAT, DEDT");
    assert_eq!(register(&mut machine, expected.usart + BRR), expected.divider);
}

#[test]
fn the_pins_of_the_rs485_port_belong_to_the_usart() {
    let lab = Lab::configured();
    let mut machine = lab.machine.borrow_mut();
    let Rs485 { gpio, pins, .. } = Rs485::of_board();
    let modes = register(&mut machine, gpio + MODER);
    for pin in pins {
        assert_eq!(modes >> (2 * pin) & 0b11, ALTERNATE, "pin {pin}");
        let functions = register(&mut machine, gpio + AFRL + 4 * u64::from(pin / 8));
        assert_eq!(functions >> (4 * (pin % 8)) & 0xF, AF_USART, "pin {pin}");
    }
}

/// Each bitrate that the board offers is what the port then runs at, within the two per cent that a
/// byte survives.
#[test]
fn every_bitrate_of_the_rs485_port_is_what_it_says() {
    let mut lab = Lab::configured();
    for bitrate in [115_200, 500_000, 1_000_000, 1_500_000, 2_000_000] {
        usual::start_rmd_bus(&mut lab.client, bus_rs485(), bitrate).expect("configured");
        lab.run_for(Duration::from_millis(1));
        let line = lab.outside.rs485;
        let real = lab.machine.borrow_mut().line(line).settings().bits_per_second();
        assert!(real.abs_diff(bitrate.into()) * 100 < u64::from(bitrate) * 2, "{bitrate}: {real}");
    }
}
