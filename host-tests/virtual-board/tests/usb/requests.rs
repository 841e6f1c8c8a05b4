//! Requests that a host may make at any time.

use std::time::Duration;

use virtual_board::board::Board;
use virtual_board::usb_session::{control, request};
use virtual_stm32::usb::host::{Control, Ended};

use crate::rig::Rig;

on_each_board!(an_abandoned_control_transfer_is_forgotten, what_is_not_there_is_refused,);

/// Standard requests, to the device and to an endpoint.
const TO_ENDPOINT: u8 = 2;
const SET_FEATURE: u8 = 3;
const GET_DESCRIPTOR: u8 = 6;
const SET_CONFIGURATION: u8 = 9;
const ENDPOINT_HALT: u16 = 0;
/// A type of descriptors that there is none of.
const UNKNOWN: u16 = 0x77 << 8;

/// USB 2.0 §8.5.3: a SETUP ends whatever was under way.
fn an_abandoned_control_transfer_is_forgotten(board: Board) {
    let rig = Rig::connected(board);
    let configuration = Control::read(0, GET_DESCRIPTOR, 2 << 8, 0, 96);
    for micros in [20, 60, 100, 150, 200, 260] {
        let mut machine = rig.machine.borrow_mut();
        machine.usb().control(configuration.clone());
        machine.run_for(Duration::from_micros(1000 + micros));
        machine.usb().abandon_control();
        machine.run_for(Duration::from_millis(2));
        assert_eq!(
            request(&mut machine, configuration.clone()).len(),
            96,
            "abandoned after {micros} µs"
        );
    }
}

fn what_is_not_there_is_refused(board: Board) {
    let rig = Rig::connected(board);
    let mut machine = rig.machine.borrow_mut();
    let refused = [
        Control::read(0, GET_DESCRIPTOR, UNKNOWN, 0, 10),
        Control::write(0, SET_CONFIGURATION, 9, 0, &[]),
        Control::write(0x21, 0x7F, 0, 0, &[]),
        Control::write(0x40, 1, 0, 0, &[1; 64]),
    ];
    for unknown in refused {
        assert_eq!(control(&mut machine, unknown.clone()), Ended::Stalled, "{unknown:02X?}");
    }
    // Endpoints that the chip does not have must not end in a panic of the driver.
    for endpoint in [0x0F, 0x8F, 0x83, 0x05] {
        control(
            &mut machine,
            Control::write(TO_ENDPOINT, SET_FEATURE, ENDPOINT_HALT, endpoint, &[]),
        );
    }
    drop(machine);
    assert!(rig.is_answered(1));
    assert!(rig.machine.borrow_mut().reports().resets.is_empty());
}
