//! A host that goes away: suspended, reset, unplugged, or not reading.

use std::time::Duration;

use host_protocol::{Request, requests};
use virtual_board::board::Board;
use virtual_board::usb_session;
use virtual_stm32::usb::host::{Control, Errors};

use crate::rig::{Rig, frame, pings};

on_each_board!(
    a_suspended_bus_is_resumed,
    a_reset_bus_is_enumerated_again,
    a_host_that_goes_within_a_control_transfer_finds_the_device_again,
    a_cable_pulled_in_the_middle_of_a_frame_loses_that_frame,
    a_host_that_stops_reading_holds_up_nobody_else,
    frames_for_an_absent_host_are_dropped,
);

/// The standard request for a descriptor.
const GET_DESCRIPTOR: u8 = 6;
/// So long the device may wait for the rest of a control transfer.
const CONTROL: Duration = Duration::from_millis(600);
/// How often a host reads nothing at all until it is said to be away.
const WHILE: Duration = Duration::from_millis(200);

fn a_suspended_bus_is_resumed(board: Board) {
    let rig = Rig::connected(board);
    assert!(rig.is_answered(1));
    rig.machine.borrow_mut().usb().suspend();
    rig.run_for(WHILE);
    assert!(rig.machine.borrow_mut().usb().is_suspended());
    rig.machine.borrow_mut().usb().resume();
    rig.run_for(Duration::from_millis(30));
    assert!(rig.is_answered(2));
    assert_eq!(rig.machine.borrow_mut().usb().errors(), Errors::default());
}

/// In the middle of a frame to the board, and with one from it under way.
fn a_reset_bus_is_enumerated_again(board: Board) {
    let rig = Rig::connected(board);
    for sequence in [10, 20] {
        let mut machine = rig.machine.borrow_mut();
        machine.usb().send(&pings(300, sequence).0[..293]);
        machine.run_for(Duration::from_micros(400));
        let described = usb_session::enumerate(&mut machine);
        usb_session::open_port(&mut machine);
        assert_eq!(described.device.len(), 18);
        drop(machine);
        assert!(rig.is_answered(sequence + 50), "{:?}", rig.log());
    }
    assert_eq!(rig.machine.borrow_mut().usb().errors(), Errors::default());
}

/// By a reset of the bus, or the cable: behind what it had asked for, the answer, or its end.
fn a_host_that_goes_within_a_control_transfer_finds_the_device_again(board: Board) {
    let rig = Rig::connected(board);
    let configuration = Control::read(0, GET_DESCRIPTOR, 2 << 8, 0, 96);
    let mut sequence = 10;
    for micros in (0..480).step_by(20) {
        for is_pulled in [false, true] {
            let mut machine = rig.machine.borrow_mut();
            machine.usb().control(configuration.clone());
            machine.run_for(Duration::from_micros(1000 + micros));
            if is_pulled {
                machine.usb().unplug();
                machine.run_for(WHILE);
                assert!(usb_session::plug(&mut machine), "after {micros} µs");
            }
            machine.run_for(CONTROL);
            usb_session::enumerate(&mut machine);
            usb_session::open_port(&mut machine);
            drop(machine);
            assert!(rig.is_answered(sequence), "{micros} µs, {is_pulled}: {:?}", rig.log());
            sequence += 1;
        }
    }
}

fn a_cable_pulled_in_the_middle_of_a_frame_loses_that_frame(board: Board) {
    let rig = Rig::connected(board);
    {
        let mut machine = rig.machine.borrow_mut();
        // A packet and the beginning of the next: within a frame, and within a transaction.
        machine.usb().send(&pings(300, 10).0[1..]);
        machine.run_for(Duration::from_micros(130));
        assert!(machine.usb().unsent() > 0, "in mid-transfer");
        machine.usb().unplug();
        machine.run_for(WHILE);
        assert!(!machine.usb().sees_device());
        usb_session::connect(&mut machine);
    }
    assert!(rig.is_answered(50), "{:?}", rig.log());
    assert_eq!(rig.machine.borrow_mut().usb().errors(), Errors::default());
}

/// The firmware gives each frame 50 ms, then drops it.
fn a_host_that_stops_reading_holds_up_nobody_else(board: Board) {
    let rig = Rig::connected(board);
    let mut uart = rig.uart();
    rig.log();
    rig.machine.borrow_mut().usb().set_reading(false);
    rig.machine.borrow_mut().usb().send(&pings(64 * 40, 1).0);
    for _ in 0..50 {
        let asked = rig.now();
        uart.gateway_status().expect("a status");
        let taken = rig.now() - asked;
        assert!(taken < Duration::from_millis(2), "the other link waits {taken:?}");
        rig.run_for(Duration::from_millis(4));
    }
    let log = rig.log();
    assert!(
        log.iter()
            .any(|line| line == "INFO host link 2: 1 frames dropped so far, as no host took them"),
        "{log:?}"
    );
    rig.machine.borrow_mut().usb().set_reading(true);
    rig.run_for(WHILE);
    assert!(rig.is_answered(5000), "{:?}", rig.log());
}

/// Nobody has enumerated the board: what is to be told to that link goes nowhere, and the link
/// works when somebody has.
fn frames_for_an_absent_host_are_dropped(board: Board) {
    let rig = Rig::connected(board);
    let subscribe = frame(&Request::GatewayStatus(requests::GatewayStatus {}), 9);
    {
        let mut machine = rig.machine.borrow_mut();
        machine.usb().send(&subscribe);
        machine.run_for(Duration::from_micros(60));
        machine.usb().unplug();
        machine.run_for(WHILE);
        usb_session::connect(&mut machine);
    }
    assert!(rig.is_answered(10), "{:?}", rig.log());
}
