//! Error counters, error-warning, error-passive; alone on the bus; damaged frames.

use rigless::chip::can::Fault;
use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{Bench, MBIT, MICROSECOND, QUEUE_OF_3, short_frame, standard};
use crate::fdcan::FrameEnd;

/// From the start of [`short_frame`] to the next attempt, when nobody acknowledges it: 54 bits, 6 +
/// 8 of error frame, 3 of intermission.
const ATTEMPT: u64 = 71 * MICROSECOND;
/// The same while error-passive: 8 bits more.
const PASSIVE_ATTEMPT: u64 = 79 * MICROSECOND;

#[test]
fn alone_on_the_bus_it_becomes_passive_and_never_bus_off() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.send(0, &short_frame());
    bench.run_for(60 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanEcr), 0x0001_0008, "CEL 1, TEC 8");
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_070B, "acknowledge error");
    assert_eq!(bench.read(Register::FdcanIr), 0x0800_0000, "PEA");
    bench.run_for(11 * ATTEMPT);
    assert_eq!(bench.read(Register::FdcanEcr), 0x000B_0060, "TEC 96");
    assert_eq!(bench.read(Register::FdcanIr), 0x0900_0000, "EW");
    bench.run_for(4 * ATTEMPT);
    assert_eq!(bench.read(Register::FdcanEcr), 0x0004_0080, "TEC 128");
    assert_eq!(bench.read(Register::FdcanIr), 0x0980_0000, "EP");
    assert_eq!(bench.read(Register::FdcanPsr) & 0xE0, 0x60, "EW and EP");
    bench.run_for(1_000 * PASSIVE_ATTEMPT);
    assert_eq!(bench.read(Register::FdcanEcr), 0x0000_0080, "and there it stays");
    assert_eq!(bench.read(Register::FdcanPsr) & 0xE0, 0x60);
    assert_eq!(bench.read(Register::FdcanCccr), 0);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001, "and goes on trying");
    assert!(bench.log().iter().all(|(_, end)| *end == FrameEnd::Unacknowledged));
}

#[test]
fn attempts_follow_each_other_and_a_passive_sender_waits_eight_bits_more() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.send(0, &short_frame());
    bench.run_for(30 * PASSIVE_ATTEMPT);
    let starts: Vec<u64> = bench.fdcan().log().iter().map(|record| record.start.0).collect();
    let gaps: Vec<u64> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(gaps[..15], [ATTEMPT; 15]);
    assert_eq!(gaps[15..25], [PASSIVE_ATTEMPT; 10]);
}

#[test]
fn when_a_node_comes_back_the_frame_goes_out_and_the_counter_falls() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.silence(node, true);
    bench.send(0, &short_frame());
    bench.run_for(10_000 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFF, 0x80);
    bench.write(Register::FdcanIr, 0xFFFF_FFFF);
    bench.silence(node, false);
    bench.run_for(2 * PASSIVE_ATTEMPT);
    assert_eq!(bench.read(Register::FdcanTxbto), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFF, 0x7F);
    assert_eq!(bench.read(Register::FdcanIr) & 0x0380_0000, 0x0080_0000, "EP changed, EW did not");
    assert_eq!(bench.node(node).heard().len(), 1);
}

#[test]
fn a_damaged_frame_is_a_receive_error_of_its_kind() {
    for (fault, code) in [(Fault::Stuff, 1), (Fault::Form, 2), (Fault::Crc, 6)] {
        let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
        let node = bench.attach(&[]);
        bench.offer_with(node, short_frame(), Some(fault));
        bench.run_for(60 * MICROSECOND);
        assert_eq!(bench.read(Register::FdcanEcr), 0x0001_0100, "CEL 1, REC 1");
        assert_eq!(bench.read(Register::FdcanPsr) & 7, code);
        assert_eq!(bench.read(Register::FdcanRxf0s), 0);
        assert_eq!(bench.node(node).outcomes(), [false]);
    }
}

#[test]
fn good_frames_bring_the_receive_counter_down() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.offer_with(node, short_frame(), Some(Fault::Crc));
    bench.run_for(60 * MICROSECOND);
    bench.silence(node, true);
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFF00, 0x0100);
    bench.attach(&[standard(0x7F, &[])]);
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFF00, 0x0000);
    assert_eq!(bench.read(Register::FdcanPsr) & 7, 0);
}

#[test]
fn a_disturbed_frame_is_a_bit_error_and_sent_again() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach_disturbing(2);
    bench.send(0, &short_frame());
    bench.run_for(60 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr) & 7, 4);
    bench.run_for(300 * MICROSECOND);
    let destroyed = (0x123, FrameEnd::Destroyed);
    assert_eq!(bench.log(), [destroyed, destroyed, (0x123, FrameEnd::Acknowledged)]);
    assert_eq!(bench.read(Register::FdcanEcr), 0x0002_000F, "2 × 8 − 1");
    assert_eq!(bench.node(node).heard().len(), 1);
}
