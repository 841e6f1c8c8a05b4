//! The controller through its registers, as the firmware's driver uses them, and through its end of
//! the cable.

mod bench;
mod packets;
mod power;

use bench::{Bench, EPR, named_bits};

use super::endpoint::{CTR_RX, CTR_TX, EA, EP_KIND, EP_TYPE, Endpoint, SETUP, STAT_RX, STAT_TX};
use super::registers::*;
use super::*;
use crate::usb::function::{Handshake, Input, Toggle, UsbFunction};

#[test]
fn the_bits_are_those_of_the_metadata() {
    for (register, offset) in
        [("CNTR", CNTR), ("ISTR", ISTR), ("FNR", FNR), ("DADDR", DADDR)].into_iter().chain([
            ("BTABLE", BTABLE),
            ("LPMCSR", LPMCSR),
            ("BCDR", BCDR),
            ("EPR0", 0),
            ("EPR7", 0x1C),
        ])
    {
        let table = tables::named(NAME).registers;
        assert_eq!(table[tables::row(table, register).0].offset, offset, "{register}");
    }
    let cntr = ["FRES", "PDWN", "LPMODE", "FSUSP", "RESUME", "L1RESUME"]
        .map(|name| named_bits("CNTR", name));
    assert_eq!(cntr, [FRES, PDWN, LPMODE, FSUSP, 1 << 4, 1 << 5]);
    let istr =
        ["ESOF", "SOF", "RESET", "SUSP", "WKUP", "CTR", "DIR"].map(|name| named_bits("ISTR", name));
    assert_eq!(istr, [ESOF, SOF, RESET, SUSP, WKUP, CTR, DIR]);
    let enables =
        ["ESOFM", "SOFM", "RESETM", "SUSPM", "WKUPM", "CTRM"].map(|name| named_bits("CNTR", name));
    assert_eq!(enables, [ESOF, SOF, RESET, SUSP, WKUP, CTR], "where ISTR has the flags");
    let others =
        [("FNR", "LSOF"), ("FNR", "LCK"), ("FNR", "RXDP"), ("DADDR", "EF"), ("DADDR", "ADD")]
            .map(|(register, name)| named_bits(register, name));
    assert_eq!(others, [LSOF, LCK, RXDP, EF, ADD]);
    assert_eq!([named_bits("BTABLE", "BTABLE"), named_bits("BCDR", "DPPU")], [BTABLE_BITS, DPPU]);
    let epr = ["EA", "STAT_TX", "DTOG_TX", "CTR_TX", "EP_KIND", "EP_TYPE", "SETUP"]
        .into_iter()
        .chain(["STAT_RX", "DTOG_RX", "CTR_RX"]);
    let mine = [EA, STAT_TX, endpoint::DTOG_TX, CTR_TX, EP_KIND, EP_TYPE, SETUP]
        .into_iter()
        .chain([STAT_RX, endpoint::DTOG_RX, CTR_RX]);
    for (name, bits) in epr.zip(mine) {
        assert_eq!(named_bits("EPR0", name), bits, "{name}");
    }
    assert_eq!(tables::named(NAME).interrupts, [19, 20, 42], "USB_HP, USB_LP, USBWAKEUP");
}

#[test]
fn an_endpoint_register_toggles_clears_and_sets() {
    let mut endpoint = Endpoint::default();
    endpoint.write(0x3 | 1 << 9 | EP_KIND | STAT_RX | endpoint::DTOG_TX | CTR_RX | CTR_TX | SETUP);
    // CTR and SETUP cannot be set by writing.
    assert_eq!(endpoint.read(), 0x3 | 1 << 9 | EP_KIND | STAT_RX | endpoint::DTOG_TX);
    endpoint.write(0x5 | STAT_RX & 0x1000 | STAT_TX | endpoint::DTOG_TX | endpoint::DTOG_RX);
    assert_eq!(
        endpoint.read(),
        0x5 | 0x2000 | STAT_TX | endpoint::DTOG_RX,
        "a 1 toggles, a 0 leaves"
    );
    endpoint.received();
    assert_eq!(
        endpoint.read(),
        0x5 | 0x2000 | STAT_TX | CTR_RX,
        "NAK, and the toggle is the other"
    );
    assert_eq!(endpoint.read(), 0x5 | 0x2000 | STAT_TX | CTR_RX, "reading changes nothing");
    endpoint.sent();
    endpoint.write(0x5 | CTR_RX);
    assert!(endpoint.has(CTR_RX) && !endpoint.has(CTR_TX), "a 0 clears, a 1 leaves");
    endpoint.reset();
    assert_eq!(endpoint.read(), CTR_RX, "what was received is not lost in a reset");
}

#[test]
fn the_interrupt_follows_the_endpoints_the_lowest_register_first() {
    let mut bench = Bench::enumerated();
    bench.control_endpoint();
    bench.bulk_endpoint(2);
    assert_eq!(bench.read(ISTR) & CTR, 0);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 2, Toggle::Data0, &[1])), Handshake::Ack);
    assert_eq!(bench.read(ISTR) & (CTR | DIR | EA), CTR | DIR | 2);
    assert!(bench.interrupt_is_up());
    assert_eq!(bench.at_cable(|usb| usb.setup(0, 0, [0; 8])), Handshake::Ack);
    assert_eq!(bench.read(ISTR) & (CTR | DIR | EA), CTR | DIR);
    bench.write(ISTR, 0);
    assert_eq!(bench.read(ISTR) & CTR, CTR, "only the endpoint's own bits end it");
    bench.clear_received(0);
    assert_eq!(bench.read(ISTR) & EA, 2);
    bench.clear_received(2);
    assert_eq!(bench.read(ISTR) & (CTR | DIR | EA), 0);
    assert!(!bench.interrupt_is_up());
    // What was sent comes with the other direction.
    bench.put_packet(2, &[7]);
    bench.at_cable(|usb| usb.input_acknowledged(0, 2));
    assert_eq!(bench.read(ISTR) & (CTR | DIR | EA), CTR | 2);
}

#[test]
fn flags_are_cleared_by_zeros() {
    let mut bench = Bench::enumerated();
    bench.at_cable(|usb| usb.start_of_frame(5));
    bench.wait(3_000_000);
    assert_eq!(bench.read(ISTR), SOF | SUSP | ESOF);
    bench.write(ISTR, !SUSP);
    assert_eq!(bench.read(ISTR), SOF | ESOF);
    bench.write(ISTR, 0xFFFF);
    assert_eq!(bench.read(ISTR), SOF | ESOF, "nor can they be set");
}

#[test]
fn isochronous_and_double_buffered_endpoints_are_told() {
    for kind in [2 << 9, EP_KIND] {
        let mut bench = Bench::enumerated();
        bench.write(EPR + 4, 1 | kind | STAT_RX);
        assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, &[])), Handshake::NoResponse);
        assert_eq!(bench.told(), ["EPR"]);
    }
}
