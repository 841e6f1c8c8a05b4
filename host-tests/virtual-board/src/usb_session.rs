//! What an operating system does with the board on its USB: enumerates it, opens its serial port,
//! asks it to detach.

use std::time::Duration;

use virtual_stm32::usb::host::{Control, Ended};

use crate::machine::Machine;

/// Requests of chapter 9 of USB 2.0.
const GET_DESCRIPTOR: u8 = 6;
const SET_ADDRESS: u8 = 5;
const SET_CONFIGURATION: u8 = 9;
/// Types of descriptors.
const DEVICE: u16 = 1 << 8;
const CONFIGURATION: u16 = 2 << 8;
const STRING: u16 = 3 << 8;
const ENDPOINT: u8 = 5;
/// US English.
const LANGUAGE: u16 = 0x0409;
/// A request of a class, to an interface.
const TO_INTERFACE: u8 = 0x21;
/// Requests of a serial port (CDC PSTN 1.2 §6.3): 115200 baud, 8 data bits, no parity; DTR and RTS.
const SET_LINE_CODING: u8 = 0x20;
const LINE_CODING: [u8; 7] = [0x00, 0xC2, 0x01, 0x00, 0, 0, 8];
const SET_CONTROL_LINE_STATE: u8 = 0x22;
const DTR_AND_RTS: u16 = 3;
/// The address that the device is given.
const ADDRESS: u8 = 5;
/// An endpoint that the host reads, and one that carries bulk.
const IN: u8 = 0x80;
const BULK: u8 = 2;
/// How long a device may take for a reset, and for a request (USB 2.0 §9.2.6.4: 5 s; Linux gives up
/// after as long).
const RESET: Duration = Duration::from_millis(50);
const REQUEST: Duration = Duration::from_secs(5);
/// After SET_ADDRESS (USB 2.0 §9.2.6.3).
const ADDRESS_RECOVERY: Duration = Duration::from_millis(2);
/// How long a device may take to show itself.
const SHOWS_ITSELF: Duration = Duration::from_millis(100);
/// How often it is looked whether something has happened.
const LOOK: Duration = Duration::from_micros(250);

/// What a device has said of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Described {
    /// The device descriptor.
    pub device: Vec<u8>,
    /// The configuration with everything in it.
    pub configuration: Vec<u8>,
    /// Manufacturer, product, serial number.
    pub strings: [String; 3],
}

/// Runs until something has happened; says whether it has in time.
fn wait(
    machine: &mut Machine,
    limit: Duration,
    mut happened: impl FnMut(&mut Machine) -> bool,
) -> bool {
    let end = machine.now() + limit;
    while !happened(machine) {
        if machine.now() >= end {
            return false;
        }
        machine.run_for(LOOK);
    }
    true
}

/// Carries out one control transfer.
/// Panics if it does not end within the 5 s that a device has.
pub fn control(machine: &mut Machine, request: Control) -> Ended {
    machine.usb().control(request);
    let mut ended = None;
    wait(machine, REQUEST, |machine| {
        ended = machine.usb().take_ended();
        ended.is_some()
    });
    ended.expect("a control transfer ends")
}

/// Carries out one that must succeed, and returns what the device has sent.
/// Panics if it does not.
pub fn request(machine: &mut Machine, request: Control) -> Vec<u8> {
    let setup = request.setup;
    match control(machine, request) {
        Ended::Done(data) => data,
        other => panic!("{setup:02X?}: {other:?}"),
    }
}

/// Plugs the cable in and waits until the device shows itself. Says whether it does.
pub fn plug(machine: &mut Machine) -> bool {
    machine.usb().plug();
    wait(machine, SHOWS_ITSELF, |machine| machine.usb().sees_device())
}

/// Resets the bus and waits for the device to recover.
/// Panics without a device.
pub fn reset(machine: &mut Machine) {
    machine.usb().reset();
    let ready = wait(machine, RESET, |machine| {
        let now = machine.now();
        machine.usb().is_ready(now)
    });
    assert!(ready, "no device after the reset");
}

/// Resets the bus, and reads and configures the device as Linux does: eight bytes of the device
/// descriptor, a reset, an address, all descriptors and strings, the configuration.
/// Panics if a request fails, or the device describes no bulk endpoint in each direction.
pub fn enumerate(machine: &mut Machine) -> Described {
    reset(machine);
    request(machine, Control::read(0, GET_DESCRIPTOR, DEVICE, 0, 64));
    reset(machine);
    request(machine, Control::write(0, SET_ADDRESS, ADDRESS.into(), 0, &[]));
    machine.usb().use_address(ADDRESS);
    machine.run_for(ADDRESS_RECOVERY);
    let device = request(machine, Control::read(0, GET_DESCRIPTOR, DEVICE, 0, 18));
    let head = request(machine, Control::read(0, GET_DESCRIPTOR, CONFIGURATION, 0, 9));
    let total = u16::from_le_bytes([head[2], head[3]]);
    let configuration = request(machine, Control::read(0, GET_DESCRIPTOR, CONFIGURATION, 0, total));
    let strings = [14, 15, 16].map(|place: usize| string(machine, device[place]));
    request(machine, Control::write(0, SET_CONFIGURATION, u16::from(configuration[5]), 0, &[]));
    let (out, input) = bulk_endpoints(&configuration);
    machine.usb().open(out, input);
    Described { device, configuration, strings }
}

fn string(machine: &mut Machine, index: u8) -> String {
    let read = Control::read(0, GET_DESCRIPTOR, STRING | u16::from(index), LANGUAGE, 255);
    let descriptor = request(machine, read);
    let text: Vec<u16> = descriptor[2..]
        .chunks_exact(2)
        .map(|unit| u16::from_le_bytes([unit[0], unit[1]]))
        .collect();
    String::from_utf16(&text).expect("UTF-16")
}

/// Length, type and bytes of each descriptor of a configuration.
pub fn descriptors(configuration: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = configuration;
    std::iter::from_fn(move || {
        let length = usize::from(*rest.first()?);
        let (first, behind) = rest.split_at_checked(length)?;
        rest = behind;
        Some(first)
    })
}

/// The numbers of the bulk endpoints, OUT and IN.
fn bulk_endpoints(configuration: &[u8]) -> (u8, u8) {
    let of = |direction| {
        let mut all = descriptors(configuration).filter(|descriptor| descriptor[1] == ENDPOINT);
        let found = all.find(|endpoint| endpoint[3] & 3 == BULK && endpoint[2] & IN == direction);
        found.expect("a bulk endpoint")[2] & 0xF
    };
    (of(0), of(IN))
}

/// Opens the serial port as a program does: line coding, DTR and RTS.
/// Panics if the device refuses.
pub fn open_port(machine: &mut Machine) {
    request(machine, Control::write(TO_INTERFACE, SET_LINE_CODING, 0, 0, &LINE_CODING));
    request(machine, Control::write(TO_INTERFACE, SET_CONTROL_LINE_STATE, DTR_AND_RTS, 0, &[]));
}

/// Plugs in, enumerates and opens the serial port.
/// Panics if one of these fails.
pub fn connect(machine: &mut Machine) -> Described {
    assert!(plug(machine), "the board does not show itself");
    let described = enumerate(machine);
    open_port(machine);
    described
}
