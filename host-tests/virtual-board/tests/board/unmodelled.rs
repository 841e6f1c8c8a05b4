//! The report of what the emulator does not model, after everything that the firmware can do with
//! its peripherals.

use std::time::Duration;

use virtual_board::machine::CanPort;
use virtual_stm32::fdcan::Wiring;

use crate::gaps;
use crate::lab::{AXES, Lab, SEED};

/// Start, configuration, motion on every bus, bus-off and return, line errors, a reset, and all of
/// the start again.
#[test]
fn a_whole_life_meets_the_listed_gaps_and_no_others() {
    let mut lab = Lab::power_on(SEED);
    lab.configure();
    let holds = lab.moving(&AXES);
    lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Shorted);
    lab.keep(&holds, Duration::from_millis(50));
    lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Connected);
    let host = lab.outside.hosts[1];
    lab.machine.borrow_mut().line(host).send_damaged(&[0x55; 20]);
    lab.stay(Duration::from_secs(1));
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_millis(50));
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.list_axes().expect("a list").len(), AXES.len(), "configured as before");
    let met = gaps::met(&mut lab.machine.borrow_mut());
    gaps::check_known(&met, gaps::known()).unwrap_or_else(|error| panic!("{error}"));
    gaps::check_met(&met, gaps::known()).unwrap_or_else(|error| panic!("{error}"));
}
