//! The core, register by register, as a driver uses it.

use rigless::time::VirtualNanos;

use super::core::{Core, ROLE_NANOS};
use super::registers::{FDMOD, PHYSEL, PWRDWN, gotgctl, pktsts};
use super::registers::{FIFO, dctl, device, epctl, epint, eptsiz, gint, global, grstctl};
use crate::usb::function::{Handshake, Input, Toggle, UsbFunction};

const START: VirtualNanos = VirtualNanos(0);
const READY: VirtualNanos = VirtualNanos(ROLE_NANOS);
/// GET_DESCRIPTOR of the device, and how its words read.
const SETUP: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 64, 0];
const SETUP_WORDS: [u32; 2] = [0x0100_0680, 0x0040_0000];
/// An endpoint's registers.
const IN_0: u64 = device::IN;
const OUT_0: u64 = device::OUT;
const IN_1: u64 = device::IN + device::ENDPOINT;
const OUT_1: u64 = device::OUT + device::ENDPOINT;
/// A bulk endpoint of 64 bytes that is active.
const BULK: u32 = 2 << 18 | epctl::USBAEP | 64;

/// A core that shows itself, after a reset of the bus, with 64 words to receive and 16 for each of
/// two FIFOs.
fn connected() -> Core {
    let mut core = Core::default();
    let mut write = |offset, value| core.write(offset, value, START);
    write(global::GUSBCFG, FDMOD | PHYSEL);
    write(global::GCCFG, PWRDWN);
    write(global::GOTGCTL, gotgctl::BVALOEN | gotgctl::BVALOVAL);
    write(global::GRXFSIZ, 64);
    write(global::DIEPTXF0, 16 << 16 | 64);
    write(global::DIEPTXF1, 16 << 16 | 80);
    core.bus_reset();
    core.bus_reset_ended();
    core
}

fn read(core: &mut Core, offset: u64) -> u32 {
    core.read(offset, READY)
}

fn pop(core: &mut Core) -> (u32, u32, u32) {
    let status = read(core, global::GRXSTSP);
    (status & 0xF, status >> 4 & 0x7FF, status >> 17 & 0xF)
}

#[test]
fn it_is_a_device_only_with_its_own_transceiver_and_after_25_ms() {
    let mut core = Core::default();
    for (value, mode) in [(FDMOD, gint::CMOD), (FDMOD | PHYSEL, 0)] {
        core.write(global::GUSBCFG, value, START);
        let before = core.read(global::GINTSTS, VirtualNanos(ROLE_NANOS - 1));
        assert_eq!(before & gint::CMOD, gint::CMOD);
        assert_eq!(core.read(global::GINTSTS, READY) & gint::CMOD, mode);
    }
}

#[test]
fn it_shows_itself_until_the_driver_disconnects() {
    let mut core = connected();
    assert!(core.is_pulled_up());
    core.write(device::DCTL, dctl::SDIS, READY);
    assert!(!core.is_pulled_up());
    core.write(device::DCTL, 0, READY);
    core.write(global::GRSTCTL, grstctl::CSRST, READY);
    assert!(!core.is_pulled_up(), "a reset of the core switches the transceiver off");
}

#[test]
fn a_reset_of_the_bus_is_told_at_its_beginning_and_its_end() {
    let mut core = connected();
    assert_eq!(
        read(&mut core, global::GINTSTS) & (gint::USBRST | gint::ENUMDNE),
        gint::USBRST | gint::ENUMDNE
    );
    core.write(global::GINTSTS, gint::USBRST, READY);
    assert_eq!(read(&mut core, global::GINTSTS) & (gint::USBRST | gint::ENUMDNE), gint::ENUMDNE);
    core.write(global::GAHBCFG, 1, READY);
    assert!(!core.interrupts(READY), "masked");
    core.write(global::GINTMSK, gint::ENUMDNE, READY);
    assert!(core.interrupts(READY));
    core.write(IN_1, BULK, READY);
    core.bus_reset();
    assert_eq!(read(&mut core, IN_1) & epctl::USBAEP, 0);
    assert_ne!(read(&mut core, IN_0) & epctl::USBAEP, 0);
}

#[test]
fn a_setup_is_taken_at_any_time_and_ends_with_the_next_token() {
    let mut core = connected();
    core.write(OUT_0, epctl::STALL, READY);
    assert_eq!(core.setup(0, 0, SETUP), Handshake::Ack);
    assert_eq!(pop(&mut core), (0, 8, pktsts::SETUP_DATA));
    assert_eq!([FIFO, FIFO].map(|fifo| read(&mut core, fifo)), SETUP_WORDS);
    assert_eq!(read(&mut core, OUT_0) & (epctl::STALL | epctl::NAKSTS), epctl::NAKSTS);
    assert_eq!(read(&mut core, global::GINTSTS) & gint::RXFLVL, 0, "its end is not told yet");
    assert_eq!(core.input(0, 0), Input::Nak);
    assert_eq!(pop(&mut core), (0, 0, pktsts::SETUP_DONE));
    assert_eq!(read(&mut core, OUT_0 + device::INT), epint::STUP);
    assert_eq!(core.setup(0, 1, SETUP), Handshake::NoResponse);
    assert_eq!(core.setup(9, 0, SETUP), Handshake::NoResponse);
    assert!(core.take_complaints().is_empty());
}

#[test]
fn a_new_address_is_in_force_after_the_status_stage() {
    let mut core = connected();
    core.setup(0, 0, [0, 5, 9, 0, 0, 0, 0, 0]);
    core.write(device::DCFG, 9 << 4, READY);
    core.write(IN_0 + device::SIZ, 1 << eptsiz::PKTCNT_SHIFT, READY);
    core.write(IN_0, epctl::CNAK | epctl::EPENA, READY);
    assert_eq!(core.input(9, 0), Input::NoResponse);
    assert_eq!(core.input(0, 0), Input::Data(Toggle::Data1, vec![]));
    core.input_acknowledged(0, 0);
    assert_eq!(core.input(0, 0), Input::NoResponse);
    assert_eq!(core.input(9, 0), Input::Nak);
}

#[test]
fn a_packet_is_sent_when_it_is_there_as_a_whole_and_until_it_is_acknowledged() {
    let mut core = connected();
    core.write(IN_1, BULK | 1 << epctl::TXFNUM_SHIFT | epctl::SD0PID | epctl::SNAK, READY);
    core.write(IN_1 + device::SIZ, 1 << eptsiz::PKTCNT_SHIFT | 5, READY);
    core.write(IN_1, BULK | 1 << epctl::TXFNUM_SHIFT | epctl::CNAK | epctl::EPENA, READY);
    core.write(FIFO + 0x1000, 0x0403_0201, READY);
    assert_eq!(core.input(0, 1), Input::Nak, "a word is missing");
    core.write(FIFO + 0x1000, 0x0000_0005, READY);
    assert_eq!(read(&mut core, IN_1 + device::TXFSTS), 14);
    for _ in 0..2 {
        assert_eq!(core.input(0, 1), Input::Data(Toggle::Data0, vec![1, 2, 3, 4, 5]));
    }
    core.input_acknowledged(0, 1);
    assert_eq!(read(&mut core, IN_1) & (epctl::EPENA | epctl::DPID), epctl::DPID);
    assert_eq!(read(&mut core, IN_1 + device::INT) & epint::XFRC, epint::XFRC);
    assert_eq!(read(&mut core, IN_1 + device::TXFSTS), 16);
    assert_eq!(core.input(0, 1), Input::Nak);
}

#[test]
fn an_out_packet_is_taken_once_and_then_refused_until_nak_is_cleared() {
    let mut core = connected();
    core.write(OUT_1 + device::SIZ, 1 << eptsiz::PKTCNT_SHIFT | 64, READY);
    core.write(OUT_1, BULK | epctl::SD0PID | epctl::CNAK | epctl::EPENA, READY);
    assert_eq!(core.out(0, 1, Toggle::Data0, &[1, 2, 3, 4, 5]), Handshake::Ack);
    assert_eq!(core.out(0, 1, Toggle::Data1, &[6]), Handshake::Nak);
    assert_eq!(pop(&mut core), (1, 5, pktsts::OUT_DATA));
    assert_eq!([FIFO, FIFO].map(|fifo| read(&mut core, fifo)), [0x0403_0201, 0x0000_0005]);
    assert_eq!(pop(&mut core), (1, 0, pktsts::OUT_DONE));
    assert_eq!(read(&mut core, OUT_1) & epctl::EPENA, 0);
    core.write(OUT_1 + device::SIZ, 1 << eptsiz::PKTCNT_SHIFT | 64, READY);
    core.write(OUT_1, BULK | epctl::CNAK, READY);
    assert_eq!(
        core.out(0, 1, Toggle::Data0, &[1, 2, 3, 4, 5]),
        Handshake::Ack,
        "sent again: the host missed it"
    );
    assert_eq!(pop(&mut core), (0, 0, 0), "and dropped");
    assert_eq!(core.out(0, 1, Toggle::Data1, &[6]), Handshake::Ack);
    assert_eq!(pop(&mut core), (1, 1, pktsts::OUT_DATA));
    assert_eq!(
        core.out(0, 1, Toggle::Data0, &[0; 65]),
        Handshake::NoResponse,
        "longer than a packet"
    );
}

#[test]
fn a_full_receive_fifo_refuses_data_and_takes_a_setup() {
    let mut core = connected();
    core.write(global::GRXFSIZ, 16 + 2 + 10, READY);
    core.write(OUT_1 + device::SIZ, 2 << eptsiz::PKTCNT_SHIFT | 128, READY);
    core.write(OUT_1, BULK | epctl::SD0PID | epctl::CNAK | epctl::EPENA, READY);
    assert_eq!(core.out(0, 1, Toggle::Data0, &[0; 64]), Handshake::Ack);
    assert_eq!(core.out(0, 1, Toggle::Data1, &[0; 64]), Handshake::Nak);
    assert_eq!(core.setup(0, 0, SETUP), Handshake::Ack);
}

#[test]
fn a_halted_endpoint_stalls_and_a_disabled_one_stops() {
    let mut core = connected();
    core.write(IN_1, BULK | epctl::STALL, READY);
    assert_eq!(core.input(0, 1), Input::Stall);
    core.write(IN_1, BULK, READY);
    assert_eq!(core.input(0, 1), Input::Nak);
    core.write(IN_1, BULK | epctl::EPENA, READY);
    core.write(IN_1, BULK | epctl::SNAK | epctl::EPDIS, READY);
    assert_eq!(read(&mut core, IN_1) & (epctl::EPENA | epctl::NAKSTS), epctl::NAKSTS);
    assert_eq!(read(&mut core, IN_1 + device::INT) & epint::EPDISD, epint::EPDISD);
}

#[test]
fn a_suspended_core_tells_it_once_and_answers_nothing() {
    let mut core = connected();
    core.write(global::GINTSTS, u32::MAX, READY);
    core.suspend();
    assert_eq!(read(&mut core, device::DSTS) & 1, 1);
    core.write(global::GINTSTS, u32::MAX, READY);
    core.suspend();
    assert_eq!(read(&mut core, global::GINTSTS) & gint::USBSUSP, 0);
    assert_eq!(core.setup(0, 0, SETUP), Handshake::NoResponse);
    core.resume();
    assert_eq!(read(&mut core, global::GINTSTS) & gint::WKUPINT, gint::WKUPINT);
    assert_eq!(core.setup(0, 0, SETUP), Handshake::Ack);
}

#[test]
fn what_it_does_not_model_it_says() {
    let mut core = connected();
    core.read(FIFO, READY);
    core.write(0x400, 1, READY);
    core.write(IN_1, 1 << 18, READY);
    core.write(device::DCTL, dctl::RWUSIG, READY);
    assert_eq!(core.take_complaints().len(), 4);
}
