//! Other nodes: wrong bit rates, silence, a cut cable, the same id twice.

use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{Bench, MBIT, MICROSECOND, QUEUE_OF_3, short_frame, standard};
use crate::fdcan::{FrameEnd, Sender, Wiring};

#[test]
fn a_node_at_another_rate_destroys_frames_until_it_is_passive() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let wrong = bench.attach_at(Some(500_000), &[]);
    bench.send(0, &short_frame());
    bench.run_for(60 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr) & 7, 4, "bit error");
    assert_eq!(bench.fdcan().nodes_mut()[wrong].error_counters(), (0, 9));
    bench.run_for(10_000 * MICROSECOND);
    // It counts nine for each frame: passive after 15. Then nobody acknowledges.
    let ends: Vec<FrameEnd> = bench.log().into_iter().map(|(_, end)| end).collect();
    assert_eq!(ends[..15], [FrameEnd::Destroyed; 15]);
    assert!(ends[15..].iter().all(|end| *end == FrameEnd::Unacknowledged));
    assert_eq!(bench.read(Register::FdcanEcr) & 0xFF, 0x80);
    assert_eq!(bench.read(Register::FdcanPsr) & 0xE0, 0x60, "passive, not bus-off");
    assert_eq!(bench.node(wrong).heard(), []);
}

#[test]
fn with_a_node_at_the_right_rate_the_wrong_one_only_delays() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach_at(Some(500_000), &[]);
    let right = bench.attach_at(Some(1_000_000), &[]);
    bench.send(0, &short_frame());
    bench.run_for(2_000 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x123]);
    assert_eq!(bench.log().len(), 16);
    assert_eq!(bench.node(right).heard().len(), 1);
}

#[test]
fn a_controller_at_the_wrong_rate_destroys_what_others_send() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let sender = bench.attach_at(Some(500_000), &[]);
    let receiver = bench.attach_at(Some(500_000), &[]);
    bench.offer(sender, short_frame());
    bench.run_for(120 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanEcr), 0x0001_0900, "REC 9");
    assert_eq!(bench.read(Register::FdcanPsr) & 7, 1, "stuff error");
    bench.run_for(5_000 * MICROSECOND);
    assert_eq!(bench.node(receiver).heard().len(), 1, "passive it no longer can");
    assert_eq!(bench.read(Register::FdcanPsr) & 0xE0, 0x60);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0);
}

#[test]
fn rates_that_differ_by_less_than_a_percent_agree() {
    // The controller at 80 MHz / 19 / 20 = 210526.3 bit/s.
    let mut bench = Bench::on_bus(0x0412_0F02, QUEUE_OF_3);
    bench.run_for(1_000 * MICROSECOND);
    bench.attach_at(Some(212_000), &[]);
    bench.send(0, &short_frame());
    bench.run_for(400 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x123]);
}

#[test]
fn a_silent_node_neither_hears_nor_acknowledges_nor_sends() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.silence(node, true);
    bench.offer(node, standard(0x001, &[]));
    bench.send(0, &short_frame());
    bench.run_for(60 * MICROSECOND);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Unacknowledged)]);
    bench.silence(node, false);
    bench.run_for(300 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x001, 0x123]);
}

#[test]
fn a_cut_cable_leaves_it_alone_and_a_frame_in_between_breaks_off() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.offer(node, short_frame());
    bench.run_for(30 * MICROSECOND);
    bench.wire(Wiring::Cut);
    bench.run_for(1_000 * MICROSECOND);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Destroyed)]);
    assert_eq!(bench.read(Register::FdcanEcr), 0x0001_0100, "it sees a frame that stops");
    bench.send(0, &standard(0x100, &[]));
    bench.run_for(1_000 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001);
    bench.wire(Wiring::Connected);
    bench.run_for(300 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x100, 0x123]);
}

#[test]
fn two_nodes_with_one_id_and_other_data_destroy_each_other() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[standard(0x241, &[1])]);
    bench.attach(&[standard(0x241, &[2])]);
    bench.run_for(300 * MICROSECOND);
    let log = bench.log();
    assert!(log.len() > 2 && log.iter().all(|end| *end == (0x241, FrameEnd::Destroyed)), "{log:?}");
    assert_ne!(bench.read(Register::FdcanEcr) & 0xFF00, 0, "the controller sees it");
}

#[test]
fn two_nodes_with_the_very_same_frame_do_not_notice() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let one = bench.attach(&[]);
    let other = bench.attach(&[]);
    bench.send(0, &standard(0x001, &[]));
    bench.run_for(10 * MICROSECOND);
    bench.offer(one, short_frame());
    bench.offer(other, short_frame());
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x001, 0x123]);
    assert_eq!(bench.node(one).outcomes(), [true]);
    assert_eq!(bench.node(one).heard().len(), 1, "the controller's");
    assert_eq!(bench.node(other).outcomes(), [true]);
}

#[test]
fn nodes_hear_each_other_while_the_controller_is_off() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    let one = bench.attach_at(Some(250_000), &[]);
    bench.attach_at(Some(250_000), &[short_frame()]);
    bench.run_for(300 * MICROSECOND);
    assert_eq!(bench.node(one).heard().len(), 1);
    assert_eq!(bench.fdcan().log()[0].sender, Sender::Node(1));
    assert_eq!(bench.fdcan().log()[0].end.0, 4 * 62 * MICROSECOND);
}
