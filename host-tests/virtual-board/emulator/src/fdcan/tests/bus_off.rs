//! Bus-off, and the way back.

use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{Bench, MBIT, MICROSECOND, QUEUE_OF_3, short_frame, standard};
use crate::fdcan::{FrameEnd, Wiring};

/// 129 sequences of 11 bits.
const RECOVERY: u64 = 1_419 * MICROSECOND;

/// A controller that 32 destroyed frames have put off the bus, and the node that did it.
fn bus_off() -> (Bench, usize) {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach_disturbing(32);
    bench.send(0, &short_frame());
    bench.run_for(3_000 * MICROSECOND);
    (bench, node)
}

#[test]
fn the_32nd_destroyed_frame_puts_it_off_the_bus() {
    let (mut bench, _) = bus_off();
    assert_eq!(bench.log(), [(0x123, FrameEnd::Destroyed); 32]);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0001, "INIT is set");
    assert_eq!(bench.read(Register::FdcanIr), 0x0B80_0000, "PEA, BO, EW, EP");
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_07E4, "BO, EW, EP, bit error");
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFFFF, 0x00F8);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001, "the frame stays");
    bench.run_for(10 * RECOVERY);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0x80, "it does not come back by itself");
}

#[test]
fn it_comes_back_129_sequences_after_init_is_cleared() {
    let (mut bench, node) = bus_off();
    bench.write(Register::FdcanIr, 0xFFFF_FFFF);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.run_for(11 * MICROSECOND);
    assert_eq!(
        bench.read(Register::FdcanPsr),
        0x0000_07E5,
        "each sequence is told as a bit-0 error"
    );
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFFFF, 0x01F8, "and counted in REC");
    bench.run_for(127 * 11 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFFFF, 0xFFF8, "128: RP and 127");
    bench.run_for(11 * MICROSECOND - 1);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0x80);
    bench.run_for(1);
    assert_eq!(bench.read(Register::FdcanPsr) & 0xE0, 0x00);
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFFFF, 0);
    assert_eq!(bench.read(Register::FdcanIr), 0x0380_0000, "BO, EW, EP changed");
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxbto), 0x0000_0001, "what was pending goes out now");
    assert_eq!(bench.node(node).heard().len(), 1);
}

#[test]
fn setting_init_again_does_not_shorten_the_way_back() {
    let (mut bench, _) = bus_off();
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.run_for(1_000 * MICROSECOND);
    bench.write(Register::FdcanCccr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0x80);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.run_for(RECOVERY - 1);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0x80);
    bench.run_for(1);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0);
}

#[test]
fn each_frame_of_others_counts_as_one_sequence() {
    let (mut bench, node) = bus_off();
    bench.attach_at(Some(1_000_000), &[]);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    for _ in 0..10 {
        bench.offer(node, short_frame());
    }
    // Ten frames of 65 bits each, the last 11 of them recessive.
    bench.run_for(650 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFF00, 0x0A00);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0, "none of them is received");
}

#[test]
fn a_request_can_be_taken_back_while_it_is_off() {
    let (mut bench, node) = bus_off();
    bench.write(Register::FdcanTxbcr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.run_for(RECOVERY + 100 * MICROSECOND);
    assert_eq!(bench.node(node).heard(), []);
}

#[test]
fn cce_takes_everything_back_while_it_is_off() {
    let (mut bench, _) = bus_off();
    bench.write(Register::FdcanCccr, 0x0000_0003);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0x80, "the counters are unchanged");
}

#[test]
fn a_short_puts_it_off_within_half_a_millisecond_and_only_when_it_sends() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.wire(Wiring::Shorted);
    bench.run_for(10_000 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_070F, "nothing sent, nothing noticed");
    bench.send(0, &short_frame());
    bench.run_for(2 * MICROSECOND);
    assert_eq!(
        bench.read(Register::FdcanEcr) & 0xFF,
        0x80,
        "16 bit errors: the start of frame, 15 of the flag"
    );
    bench.run_for(498 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_07E5, "bus-off, bit-0 error");
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0001);
    assert_eq!(bench.log().len(), 17, "16 more attempts, passive");
}

#[test]
fn it_comes_back_on_a_shorted_bus_and_goes_off_again() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.wire(Wiring::Shorted);
    bench.send(0, &short_frame());
    bench.run_for(1_000 * MICROSECOND);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.run_for(RECOVERY + 500 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0x80);
    bench.wire(Wiring::Connected);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.run_for(RECOVERY + 100 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x80, 0);
    assert_eq!(bench.node(node).heard().len(), 1);
}

#[test]
fn leaving_the_bus_in_mid_frame_breaks_the_frame_off() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.send(0, &standard(0x100, &[0; 8]));
    bench.run_for(30 * MICROSECOND);
    bench.write(Register::FdcanCccr, 0x0000_0001);
    bench.run_for(500 * MICROSECOND);
    assert_eq!(bench.log(), [(0x100, FrameEnd::Destroyed)]);
    assert_eq!(bench.node(node).heard(), []);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanEcr), 0, "its own counters are unchanged");
}
