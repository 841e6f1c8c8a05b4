//! What a host may do to an endpoint: halt it, end its halt, begin anew.

use std::cell::RefCell;
use std::rc::Rc;

use mgw_client::Client;
use virtual_board::board::Board;
use virtual_board::machine::Machine;
use virtual_board::transport::BoardTransport;
use virtual_board::usb_session::{self, request};
use virtual_stm32::usb::host::{Control, Errors};

use crate::rig::{STARTED, builder};

on_each_board!(an_endpoint_begins_anew);

/// Requests of chapter 9 of USB 2.0, and to whom.
const CLEAR_FEATURE: u8 = 1;
const SET_FEATURE: u8 = 3;
const SET_CONFIGURATION: u8 = 9;
const TO_DEVICE: u8 = 0x00;
const TO_ENDPOINT: u8 = 0x02;
const ENDPOINT_HALT: u16 = 0;

/// The numbers of the bulk endpoints, OUT and IN.
const fn bulk(board: Board) -> (u8, u8) {
    match board {
        Board::NucleoH743zi => (1, 2),
        Board::NucleoG474re => (2, 2),
    }
}

/// USB 2.0 §9.4.5 and §9.1.1.5: the first packet after the end of a halt, of one that was none,
/// too, and after the choice of a configuration is DATA0. Programs and systems ask for it when they
/// open a port.
fn an_endpoint_begins_anew(board: Board) {
    let (out, input) = bulk(board);
    let of_halt = |feature, endpoint: u8| {
        Control::write(TO_ENDPOINT, feature, ENDPOINT_HALT, endpoint.into(), &[])
    };
    let endings = [of_halt(CLEAR_FEATURE, out), of_halt(CLEAR_FEATURE, input | 0x80)];
    let halts = [of_halt(SET_FEATURE, out), of_halt(SET_FEATURE, input | 0x80)];
    let configuration = [Control::write(TO_DEVICE, SET_CONFIGURATION, 1, 0, &[])];
    let machine = Rc::new(RefCell::new(builder(board).power_on()));
    machine.borrow_mut().run_for(STARTED);
    usb_session::connect(&mut machine.borrow_mut());
    let mut client = Client::connect_as(BoardTransport::usb(&machine), 1, 1).expect("hello");
    let begin_anew = |requests: &[Control]| {
        let machine: &mut Machine = &mut machine.borrow_mut();
        for asked in requests {
            request(machine, asked.clone());
        }
        machine.usb().open(out, input);
    };
    for requests in [&endings[..], &[halts, endings.clone()].concat(), &configuration] {
        // After an even number of packets, and after an odd one.
        for _ in 0..3 {
            begin_anew(requests);
            client.gateway_status().expect("a status");
        }
    }
    let mut machine = machine.borrow_mut();
    // While it is configured again an endpoint does not answer.
    let Errors { toggles, babble, .. } = machine.usb().errors();
    assert_eq!((toggles, babble), (0, 0));
    assert!(machine.reports().resets.is_empty());
}
