//! The way into the ROM bootloader over USB (DFU 1.1 §5.1).

use std::ops::ControlFlow;
use std::time::Duration;

use mgw_client::Client;
use rigless::device::ResetCause;
use rigless::emulator::Watch;
use virtual_board::board::Board;
use virtual_board::machine::bootloader_entry;
use virtual_board::transport::BoardTransport;
use virtual_board::usb_session::{control, request};
use virtual_stm32::usb::host::{Control, Ended};

use crate::rig::{AXIS, Rig};

on_each_board!(a_detach_is_refused_while_an_axis_is_armed_and_granted_at_rest);

/// Requests to the update interface, number 2.
const TO_INTERFACE: u8 = 0x21;
const INTERFACE: u16 = 2;
const DETACH: u8 = 0;
const GET_STATE: u8 = 5;
/// Within which the host is told that the device detaches.
const TIMEOUT_MS: u16 = 1000;

fn detach() -> Control {
    Control::write(TO_INTERFACE, DETACH, TIMEOUT_MS, INTERFACE, &[])
}

/// Stays in command for as long as a motor takes to stop.
fn stay(client: &mut Client<BoardTransport>) {
    client
        .hold(Duration::from_millis(200), |_| Ok(ControlFlow::Continue(())))
        .expect("the link lives");
}

fn a_detach_is_refused_while_an_axis_is_armed_and_granted_at_rest(board: Board) {
    let rig = Rig::connected(board);
    let entry = Watch::Instruction(bootloader_entry(board));
    rig.machine.borrow_mut().watch(entry);
    let mut client = rig.client();
    client.arm(AXIS).expect("armed");
    assert_eq!(control(&mut rig.machine.borrow_mut(), detach()), Ended::Stalled);
    // A stall lasts until the next request.
    let state = Control::read(TO_INTERFACE, GET_STATE, 0, INTERFACE, 1);
    assert_eq!(request(&mut rig.machine.borrow_mut(), state.clone()), [0], "appIDLE");
    client.disarm(AXIS).expect("disarmed");
    stay(&mut client);
    client.output_off(AXIS).expect("let go");
    stay(&mut client);
    assert_eq!(control(&mut rig.machine.borrow_mut(), detach()), Ended::Done(vec![]));
    assert_eq!(request(&mut rig.machine.borrow_mut(), state), [1], "appDETACH");
    rig.run_for(Duration::from_millis(60));
    let mut machine = rig.machine.borrow_mut();
    assert!(!machine.take_hits().is_empty(), "in the bootloader");
    assert!(!machine.usb().sees_device(), "off the bus");
    let resets: Vec<_> = machine.reports().resets.iter().map(|reset| reset.cause).collect();
    assert_eq!(resets, [ResetCause::Core]);
}
