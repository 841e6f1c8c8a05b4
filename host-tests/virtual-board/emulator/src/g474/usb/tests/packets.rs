//! Packets, one transaction at a time.

use super::bench::{Bench, EPR, ROOM_64};
use super::*;

const REQUEST: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 64, 0];

#[test]
fn after_a_packet_the_endpoint_says_nak_until_the_firmware_allows_another() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, &[1, 2, 3])), Handshake::Ack);
    assert_eq!(bench.packet(1), [1, 2, 3]);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data1, &[4])), Handshake::Nak);
    bench.clear_received(1);
    // NAK to VALID, as embassy's driver does.
    bench.toggle(1, 0x1000);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data1, &[4])), Handshake::Ack);
    assert_eq!(bench.packet(1), [4]);
    assert!(bench.told().is_empty());
}

#[test]
fn a_repeated_packet_is_acknowledged_and_forgotten() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data1, &[9])), Handshake::Ack);
    assert_eq!(bench.read(ISTR) & CTR, 0);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, &[1])), Handshake::Ack);
    assert_eq!(bench.packet(1), [1]);
}

#[test]
fn a_packet_is_sent_until_it_is_acknowledged() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    assert_eq!(bench.at_cable(|usb| usb.input(0, 1)), Input::Nak);
    bench.put_packet(1, &[1, 2, 3]);
    for _ in 0..2 {
        assert_eq!(
            bench.at_cable(|usb| usb.input(0, 1)),
            Input::Data(Toggle::Data0, vec![1, 2, 3])
        );
    }
    bench.at_cable(|usb| usb.input_acknowledged(0, 1));
    assert_eq!(bench.at_cable(|usb| usb.input(0, 1)), Input::Nak);
    bench.put_packet(1, &[]);
    assert_eq!(bench.at_cable(|usb| usb.input(0, 1)), Input::Data(Toggle::Data1, vec![]));
}

#[test]
fn a_setup_is_taken_whatever_the_endpoint_says_but_not_before_the_last_was_seen() {
    let mut bench = Bench::enumerated();
    bench.control_endpoint();
    assert_eq!(bench.at_cable(|usb| usb.setup(0, 0, REQUEST)), Handshake::Ack);
    let after = bench.read(EPR);
    assert_eq!(after, CTR_RX | SETUP | 0x2020 | endpoint::DTOG_RX | endpoint::DTOG_TX | 1 << 9);
    assert_eq!(bench.packet(0), REQUEST);
    assert_eq!(
        bench.at_cable(|usb| usb.setup(0, 0, REQUEST)),
        Handshake::NoResponse,
        "CTR_RX is set"
    );
    bench.clear_received(0);
    // NAK to STALL, both ways.
    bench.toggle(0, 0x3030);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 0, Toggle::Data1, &[])), Handshake::Stall);
    assert_eq!(bench.at_cable(|usb| usb.input(0, 0)), Input::Stall);
    assert_eq!(bench.at_cable(|usb| usb.setup(0, 0, REQUEST)), Handshake::Ack, "it ends the stall");
    assert_eq!(bench.at_cable(|usb| usb.input(0, 0)), Input::Nak);
}

#[test]
fn a_status_stage_with_data_is_stalled() {
    let mut bench = Bench::enumerated();
    bench.control_endpoint();
    bench.write(EPR, 1 << 9 | EP_KIND | 0x1000 | CTR_RX | CTR_TX);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 0, Toggle::Data0, &[1])), Handshake::Stall);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 0, Toggle::Data0, &[])), Handshake::Ack);
}

#[test]
fn a_buffer_holds_as_many_blocks_as_its_row_says() {
    for (room, bytes) in [(ROOM_64, 64), (0x8000, 32), (5 << 10, 10), (31 << 10, 62)] {
        let mut bench = Bench::enumerated();
        bench.bulk_endpoint(1);
        bench.describe(1, room);
        let data: Vec<u8> = (1..=65).collect();
        bench.put(0x40 + 128 + bytes, 0x5A5A);
        let too_long = &data[..usize::from(bytes) + 1];
        assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, too_long)), Handshake::Stall);
        assert_eq!(bench.get(0x40 + 128 + bytes), 0x5A5A, "nothing is written behind it");
        assert_eq!(bench.read(ISTR) & CTR, 0, "and nobody is told");
        let full = &data[..bytes.into()];
        assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, full)), Handshake::Ack);
        assert_eq!(bench.packet(1), full);
        assert_eq!(bench.get(8 + 6), room | bytes, "BL_SIZE and NUM_BLOCK stay");
    }
}

#[test]
fn the_crc_lies_behind_the_data() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, b"123456789"));
    // The check value of CRC-16/USB.
    assert_eq!([bench.get(0x40 + 128 + 8), bench.get(0x40 + 128 + 10)], [0xC839, 0xB4]);
}

#[test]
fn buffers_outside_the_memory_are_told() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    // A receive buffer of 64 bytes, 32 before the end.
    bench.put(8 + 4, 1024 - 32);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, &[0; 64])), Handshake::NoResponse);
    bench.put_packet(1, &[1; 10]);
    bench.put(8, 1020);
    assert_eq!(bench.at_cable(|usb| usb.input(0, 1)), Input::NoResponse);
    bench.write(BTABLE, 0xFFF8);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, &[0; 64])), Handshake::NoResponse);
    assert_eq!(bench.told(), ["BTABLE"; 3]);
}

#[test]
fn the_packet_memory_is_accessed_by_half_words() {
    let mut bench = Bench::new();
    bench.put(2, 0x1234);
    bench.write_at(0x4000_6000, rigless::soc::Width::W32, 0xFFFF_FFFF);
    assert_eq!([bench.get(0), bench.get(2)], [0, 0x1234], "it was not written");
    assert_eq!(bench.told(), [packet_memory::NAME]);
}

#[test]
fn only_its_own_address_and_endpoints_are_heard() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    bench.put_packet(1, &[1]);
    assert_eq!(bench.at_cable(|usb| usb.input(5, 1)), Input::NoResponse);
    assert_eq!(bench.at_cable(|usb| usb.input(0, 2)), Input::NoResponse);
    bench.write(DADDR, EF | 5);
    assert_eq!(bench.at_cable(|usb| usb.input(5, 1)), Input::Data(Toggle::Data0, vec![1]));
    bench.write(DADDR, 5);
    assert_eq!(bench.at_cable(|usb| usb.input(5, 1)), Input::NoResponse, "not without EF");
    assert!(bench.told().is_empty());
}
