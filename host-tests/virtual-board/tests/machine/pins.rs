//! Pins: what the firmware drives, and what is driven from outside.

use std::time::Duration;

use rigless::device::Level;
use rigless::mcu::Operate;
use rigless::soc::Width;
use virtual_board::machine::Machine;
use virtual_board::nodes::instant;
use virtual_board::pins::Change;
use virtual_stm32::pins::Port;

use crate::started;

/// RCC_AHB4ENR (RM0433 §8.7.43) and the bit of port E.
const AHB4ENR: u64 = 0x5802_44E0;
const GPIOE_ENABLED: u64 = 1 << 4;
/// GPIOE_MODER, GPIOE_PUPDR and GPIOE_ODR (RM0433 §11.4).
const MODER: u64 = 0x5802_1000;
const PUPDR: u64 = 0x5802_100C;

/// As if the firmware had written it.
fn poke(machine: &mut Machine, address: u64, bits: u64, value: u64) {
    let now = instant(machine.now());
    let part = machine.part_mut();
    let before = part.read(now, address, Width::W32).unwrap();
    part.write(now, address, Width::W32, before & !bits | value).unwrap();
}

#[test]
fn an_output_is_logged_to_the_access_that_changed_it() {
    let mut machine = Machine::builder().power_on();
    assert_eq!(machine.light().driven(), None, "no output out of reset");
    machine.run_for(Duration::from_millis(1_700));
    let changes = machine.light().changes();
    assert!(changes.len() >= 3, "it blinks: {changes:?}");
    assert!(
        changes.windows(2).all(|pair| pair[0].at <= pair[1].at && pair[0].level != pair[1].level)
    );
    let on: Vec<_> = changes.iter().filter(|change| change.level == Some(Level::High)).collect();
    assert!(!on.is_empty(), "{changes:?}");
    let last = *changes.last().unwrap();
    assert_eq!(machine.light().driven(), last.level);
    assert_eq!(machine.light().changed(), Some(last.at));
    assert_ne!(last.at.subsec_nanos() % 10_000, 0, "not when the test looked");
}

#[test]
fn a_reset_lets_go_of_every_output() {
    let mut machine = started();
    assert!(machine.light().driven().is_some());
    let at = machine.now();
    machine.reset_by_pin();
    assert_eq!(machine.light().changes().last(), Some(&Change { at, level: None }));
    let mut copy = Machine::builder().resume(&started().snapshot());
    assert_eq!(copy.light().changes(), started().light().changes(), "a snapshot keeps them");
}

/// Pulled up inside the part, to ground through the chain of emergency stops.
#[test]
fn the_chain_of_emergency_stops_is_closed_until_it_is_opened() {
    let mut machine = started();
    poke(&mut machine, AHB4ENR, 0, GPIOE_ENABLED);
    poke(&mut machine, PUPDR, 3 << 22, 1 << 22);
    poke(&mut machine, MODER, 3 << 22, 0);
    machine.run_for(Duration::from_micros(10));
    assert!(!machine.e_stop().reads_high(), "closed");
    machine.open_e_stop(true);
    assert!(machine.e_stop().reads_high(), "open: the pull-up's level");
    machine.open_e_stop(false);
    assert!(!machine.e_stop().reads_high());
    machine.pin(Port::E, 11).drive(Some(Level::High));
    assert!(machine.e_stop().reads_high());
    assert_eq!(machine.e_stop().changes(), [], "the firmware does not drive it");
}
