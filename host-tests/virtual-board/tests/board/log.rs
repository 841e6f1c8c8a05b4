//! The firmware's own log.

use std::time::Duration;

use virtual_board::board::Board;
use virtual_board::machine::{CanPort, Machine, image_path};
use virtual_stm32::fdcan::Wiring;

use crate::lab::{BUS_D5, BUS_RMD_AND_THRUSTER, Lab, bus_rs485};
use crate::rtt;

/// Takes the lines that the firmware has logged since the last time.
pub fn take(machine: &mut Machine) -> Vec<String> {
    rtt::take(machine, &image_path().expect("an image"))
}

/// What lines there are that begin like this.
fn beginning<'a>(lines: &'a [String], begin: &str) -> Vec<&'a str> {
    lines.iter().map(String::as_str).filter(|line| line.starts_with(begin)).collect()
}

#[test]
fn the_start_and_the_buses_are_logged() {
    let lab = Lab::configured();
    let (firmware, build) =
        (lab.client.hello().firmware.clone(), lab.client.hello().build_id.clone());
    let lines = take(&mut lab.machine.borrow_mut());
    let board = Board::chosen().name();
    let boot =
        format!("INFO motor gateway {firmware}, build {build}, on {board}, started by PowerOn");
    assert_eq!(lines[0], boot, "{lines:?}");
    for (bus, text) in [
        (BUS_RMD_AND_THRUSTER, "CAN at 1000000 bit/s, Normal"),
        (BUS_D5, "CAN at 210526 bit/s, Normal"),
        (bus_rs485(), "RS485 at 115200 baud"),
    ] {
        let line = format!("INFO bus {bus}: {text}");
        assert!(lines.contains(&line), "{line} in {lines:?}");
    }
    let active = "INFO bus 0: ErrorState { state: Active, transmit_errors: 0, receive_errors: 0 }";
    assert!(lines.iter().any(|line| line == active), "{lines:?}");
    assert_eq!(beginning(&lines, "WARN"), [""; 0]);
    assert_eq!(beginning(&lines, "ERROR"), [""; 0]);
}

#[test]
fn a_bus_that_goes_off_is_a_warning_and_its_return_is_told() {
    let mut lab = Lab::configured();
    take(&mut lab.machine.borrow_mut());
    lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Shorted);
    assert!(lab.client.read_state(0).is_err(), "nothing answers on a short");
    lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Connected);
    lab.stay(Duration::from_millis(300));
    let lines = take(&mut lab.machine.borrow_mut());
    let off = "WARN bus 0: ErrorState { state: BusOff, transmit_errors: 248, receive_errors: 0 }";
    let active = "INFO bus 0: ErrorState { state: Active, transmit_errors: 0, receive_errors: 0 }";
    let since: Vec<_> = lines.iter().skip_while(|line| *line != off).collect();
    // Off; started again, off until it has seen 129 times 11 recessive bits; back.
    assert_eq!(since, [off, "INFO bus 0: CAN at 1000000 bit/s, Normal", off, active], "{lines:?}");
}

#[test]
fn line_errors_of_a_host_link_are_logged_at_powers_of_two() {
    let lab = Lab::configured();
    let host = lab.outside.hosts[1];
    take(&mut lab.machine.borrow_mut());
    for _ in 0..5 {
        let mut machine = lab.machine.borrow_mut();
        machine.line(host).send_damaged(&[0xFF]);
        machine.run_for(Duration::from_millis(1));
    }
    let lines = take(&mut lab.machine.borrow_mut());
    let expected = [1, 2, 4].map(|errors| format!("WARN host link 1: {errors} line errors so far"));
    assert_eq!(beginning(&lines, "WARN"), expected);
}
