//! A host reads and configures the board.

use virtual_board::board::Board;
use virtual_board::usb_session::{self, Described};
use virtual_stm32::usb::host::Errors;

use crate::rig::{STARTED, builder, image};
use crate::rtt;

on_each_board!(a_host_enumerates_it);

/// USB 2.1, class of several functions with associations, packets of 64; pid.codes' number for
/// tests, version 0.1.0; strings 1 to 3, one configuration.
const DEVICE: [u8; 18] =
    [18, 1, 0x10, 0x02, 0xEF, 2, 1, 64, 0x09, 0x12, 0x01, 0x00, 0x10, 0x00, 1, 2, 3, 1];
/// Three interfaces; powered by the board, takes nothing from the cable.
const CONFIGURATION: [u8; 9] = [9, 2, 96, 0, 3, 1, 0, 0xC0, 0];
/// The serial port: an interface for its control with an interrupt endpoint, and one for its data
/// with two of bulk. The G474's driver gives an endpoint one type for both directions.
fn serial_port(board: Board) -> [u8; 61] {
    let bulk_out = match board {
        Board::NucleoH743zi => 0x01,
        Board::NucleoG474re => 0x02,
    };
    [
        8, 11, 0, 2, 2, 2, 0, 0, // association
        9, 4, 0, 0, 1, 2, 2, 0, 0, // communications, abstract control model
        5, 0x24, 0, 0x10, 0x01, 4, 0x24, 2, 2, 5, 0x24, 6, 0,
        1, // CDC 1.10, line coding, union of 0 and 1
        7, 5, 0x81, 3, 8, 0, 255, // interrupt IN 1
        9, 4, 1, 0, 2, 0x0A, 0, 0, 0, // data
        7, 5, bulk_out, 2, 64, 0, 0, // bulk OUT
        7, 5, 0x82, 2, 64, 0, 0, // bulk IN 2
    ]
}
/// The update interface at run time (DFU 1.1 §4.1): can be written, detaches by itself within 50
/// ms, packets of 64.
const UPDATE: [u8; 26] = [
    8, 11, 2, 1, 0xFE, 1, 1, 0, // association
    9, 4, 2, 0, 0, 0xFE, 1, 1, 0, // application specific, upgrade, run time
    9, 0x21, 0x09, 50, 0, 64, 0, 0x10, 0x01,
];

fn a_host_enumerates_it(board: Board) {
    let mut machine = builder(board).power_on();
    machine.run_for(STARTED);
    let Described { device, configuration, strings } = usb_session::connect(&mut machine);
    assert_eq!(device, DEVICE);
    let expected: Vec<u8> = [&CONFIGURATION[..], &serial_port(board), &UPDATE].concat();
    assert_eq!(configuration, expected);
    let [manufacturer, product, serial] = strings;
    assert_eq!([manufacturer, product], ["Motor gateway", "Motor gateway"]);
    let logged = format!("INFO host link 2: USB, serial number {serial}");
    assert!(rtt::take(&mut machine, &image(board)).contains(&logged), "{logged}");
    assert_eq!(machine.usb().errors(), Errors::default());
    let told = machine.reports().told;
    assert!(told.iter().all(|told| told.instance == "RCC"), "{told:?}");
}
