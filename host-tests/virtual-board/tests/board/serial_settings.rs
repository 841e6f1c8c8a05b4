//! How the firmware has set its three serial ports up: read from the registers, as the port's far end sees them, and in
//! the configuration of the pins.

use rigless::mcu::Operate;
use rigless::soc::Width;
use virtual_board::machine::Machine;
use virtual_board::nodes::instant;
use virtual_stm32::serial_port::DriverEnable;

use crate::lab::Lab;

/// Registers (RM0433): base addresses and offsets.
const USART2: u64 = 0x4000_4400;
const CR1: u64 = 0x00;
const CR3: u64 = 0x08;
const BRR: u64 = 0x0C;
const GPIOD: u64 = 0x5802_0C00;
const MODER: u64 = 0x00;
const AFRL: u64 = 0x20;
/// Two bits of MODER: alternate function.
const ALTERNATE: u32 = 0b10;
/// PD4 to PD6 as USART2 (DS12110, table of alternate functions).
const AF_USART2: u32 = 7;

fn register(machine: &mut Machine, address: u64) -> u32 {
    let at = instant(machine.now());
    let value = machine.part_mut().peek(at, address, Width::W32).expect("a register");
    u32::try_from(value).expect("32 bits")
}

/// 100 MHz / 109: half a per cent off 921600, where two per cent are allowed.
#[test]
fn both_host_links_run_at_921600_baud() {
    let lab = Lab::configured();
    for host in lab.outside.hosts {
        let settings = lab.machine.borrow_mut().line(host).settings();
        assert_eq!(settings.bits_per_second(), 917_431);
        assert_eq!(settings.driver_enable, None);
    }
}

#[test]
fn the_rs485_port_drives_its_transceiver_by_hardware() {
    let lab = Lab::configured();
    let mut machine = lab.machine.borrow_mut();
    let settings = machine.line(lab.outside.rs485).settings();
    assert_eq!(settings.bits_per_second(), 115_207, "100 MHz / 868");
    let enable = DriverEnable { assertion: 16, deassertion: 16, active_low: false };
    assert_eq!(settings.driver_enable, Some(enable));
    // The same in the registers: DEM; DEAT and DEDT of one bit each; the divider.
    assert_eq!(
        register(&mut machine, USART2 + CR3) >> 14 & 0b11,
        0b01,
        "DEM, and DEP for an active-high output"
    );
    let control = register(&mut machine, USART2 + CR1);
    assert_eq!((control >> 21 & 0x1F, control >> 16 & 0x1F), (16, 16), "DEAT, DEDT");
    assert_eq!(register(&mut machine, USART2 + BRR), 868);
}

#[test]
fn the_pins_of_the_rs485_port_belong_to_the_usart() {
    let lab = Lab::configured();
    let mut machine = lab.machine.borrow_mut();
    let (modes, functions) = (register(&mut machine, GPIOD + MODER), register(&mut machine, GPIOD + AFRL));
    for (pin, name) in [(4, "PD4 DE"), (5, "PD5 TX"), (6, "PD6 RX")] {
        assert_eq!(modes >> (2 * pin) & 0b11, ALTERNATE, "{name}");
        assert_eq!(functions >> (4 * pin) & 0xF, AF_USART2, "{name}");
    }
}

/// Each bitrate that the board offers is what the port then runs at, within the two per cent that a byte survives.
#[test]
fn every_bitrate_of_the_rs485_port_is_what_it_says() {
    use host_protocol::{Protocol, ProtocolSet};
    let mut lab = Lab::configured();
    for bitrate in [115_200, 500_000, 1_000_000, 1_500_000, 2_000_000] {
        let window = std::time::Duration::from_millis(5);
        let rmd = ProtocolSet::of(&[Protocol::Rmd]);
        lab.client.configure_bus(crate::lab::BUS_RS485, bitrate, rmd, false, window).expect("configured");
        lab.run_for(std::time::Duration::from_millis(1));
        let line = lab.outside.rs485;
        let real = lab.machine.borrow_mut().line(line).settings().bits_per_second();
        assert!(real.abs_diff(bitrate.into()) * 100 < u64::from(bitrate) * 2, "{bitrate}: {real}");
    }
}
