//! Queue, FIFO, dedicated buffers, arbitration, the event FIFO.

use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{
    Bench, FIFO_OF_3, MBIT, MICROSECOND, QUEUE_OF_3, TX_EVENTS, short_frame, standard,
};
use crate::fdcan::FrameEnd;

#[test]
fn a_frame_goes_from_request_to_event() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.fill_with(0, &short_frame(), 0xA580_0000);
    bench.write(Register::FdcanTxbar, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbar), 0, "the request is taken at once");
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001);
    bench.run_for(30 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_071F, "sending");
    bench.run_for(40 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    assert_eq!(bench.read(Register::FdcanTxbto), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_1200, "TC and TEFN");
    assert_eq!(bench.read(Register::FdcanTxefs), 0x0001_0001, "one entry, put index 1");
    assert_eq!(bench.words(TX_EVENTS, 2)[0], 0x048C_0000);
    assert_eq!(bench.words(TX_EVENTS, 2)[1] & 0xFFFF_0000, 0xA542_0000, "marker, sent, two bytes");
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_0708, "idle, no error");
    assert_eq!(bench.node(node).heard().len(), 1);
}

#[test]
fn a_frame_without_event_leaves_the_event_fifo_alone() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.fill_with(0, &short_frame(), 0xA500_0000);
    bench.write(Register::FdcanTxbar, 0x0000_0001);
    bench.run_for(70 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxefs), 0);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0200, "TC");
}

#[test]
fn a_request_clears_what_the_last_one_left() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.send(0, &short_frame());
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxbto), 0x0000_0001);
    bench.send(0, &short_frame());
    assert_eq!(bench.read(Register::FdcanTxbto), 0);
}

#[test]
fn a_queue_sends_the_most_urgent_first() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.join();
    for (buffer, id) in [0x300, 0x100, 0x200].into_iter().enumerate() {
        bench.fill(buffer, &standard(id, &[]));
    }
    bench.write(Register::FdcanTxbar, 0x0000_0007);
    bench.run_for(300 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x100, 0x200, 0x300]);
}

#[test]
fn of_equals_the_lowest_buffer_comes_first() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.fill(2, &standard(0x100, &[2]));
    bench.fill(1, &standard(0x100, &[1]));
    bench.write(Register::FdcanTxbar, 0x0000_0006);
    bench.run_for(200 * MICROSECOND);
    let first: Vec<u8> = bench.node(node).heard().iter().map(|(_, frame)| frame.data[0]).collect();
    assert_eq!(first, [1, 2]);
}

#[test]
fn a_queue_names_its_lowest_free_buffer() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0000_0000, "TFFL and TFGI read 0 for a queue");
    bench.send(0, &standard(0x300, &[]));
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0001_0000);
    bench.send(2, &standard(0x301, &[]));
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0001_0000);
    bench.send(1, &standard(0x302, &[]));
    assert_eq!(bench.read(Register::FdcanTxfqs) & 0x0020_0000, 0x0020_0000, "full");
}

#[test]
fn a_fifo_sends_in_order_and_says_when_it_is_empty() {
    let mut bench = Bench::on_bus(MBIT, FIFO_OF_3);
    bench.attach(&[]);
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0000_0003, "three free");
    for (buffer, id) in [0x300, 0x100, 0x200].into_iter().enumerate() {
        bench.fill(buffer, &standard(id, &[]));
    }
    bench.write(Register::FdcanTxbar, 0x0000_0007);
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0020_0000, "full, put and get index 0");
    bench.run_for(60 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0000_0101, "one free, get index 1, put index 0");
    assert_eq!(bench.read(Register::FdcanIr) & 0x0000_0800, 0);
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x300, 0x100, 0x200]);
    assert_eq!(bench.read(Register::FdcanIr) & 0x0000_0800, 0x0000_0800, "TFE");
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0000_0003);
    assert_eq!(bench.told(), []);
}

#[test]
fn a_request_away_from_the_put_index_of_a_fifo_is_told() {
    let mut bench = Bench::on_bus(MBIT, FIFO_OF_3);
    bench.send(1, &short_frame());
    assert_eq!(bench.told(), [("TXBAR", "a request for the FIFO away from its put index")]);
}

#[test]
fn dedicated_buffers_compete_with_the_head_of_the_fifo() {
    // Two dedicated buffers, then a FIFO of two.
    let mut bench = Bench::on_bus(MBIT, 0x0202_1000);
    bench.attach(&[]);
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0002_0202, "the FIFO begins at buffer 2");
    for (buffer, id) in [0x150, 0x400, 0x200, 0x100].into_iter().enumerate() {
        bench.fill(buffer, &standard(id, &[]));
    }
    bench.write(Register::FdcanTxbar, 0x0000_000F);
    bench.run_for(300 * MICROSECOND);
    // 0x100 waits behind 0x200 in the FIFO.
    assert_eq!(bench.delivered(), [0x150, 0x200, 0x100, 0x400]);
}

#[test]
fn requests_for_buffers_that_are_not_there_are_ignored() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanTxbar, 0xFFFF_FFF8);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
}

#[test]
fn the_lower_id_wins_the_bus_and_the_loser_comes_next() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.send(0, &standard(0x200, &[]));
    bench.offer(node, standard(0x1FF, &[]));
    bench.run_for(200 * MICROSECOND);
    let expected = [(0x1FF, FrameEnd::Acknowledged), (0x200, FrameEnd::Acknowledged)];
    assert_eq!(bench.log(), expected);
    assert_eq!(bench.read(Register::FdcanEcr), 0, "losing is no error");
    assert_eq!(bench.read(Register::FdcanRxf0s) & 0x7F, 1);
}

#[test]
fn a_later_frame_does_not_break_into_the_one_on_the_line() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.send(0, &standard(0x200, &[]));
    bench.run_for(2 * MICROSECOND);
    bench.offer(node, standard(0x001, &[]));
    bench.send(1, &standard(0x000, &[]));
    bench.run_for(300 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x200, 0x000, 0x001]);
}

#[test]
fn the_event_fifo_fills_and_loses_and_is_acknowledged() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    let mut flags = Vec::new();
    for _ in 0..4 {
        bench.send(1, &short_frame());
        bench.run_for(70 * MICROSECOND);
        flags.push(bench.read(Register::FdcanIr) & 0x0000_F000);
        bench.write(Register::FdcanIr, 0x0000_7200);
    }
    // TEFN; TEFN and TEFW at the watermark of two; TEFN and TEFF; TEFL.
    assert_eq!(flags, [0x0000_1000, 0x0000_3000, 0x0000_5000, 0x0000_8000]);
    assert_eq!(bench.read(Register::FdcanTxefs), 0x0300_0003, "lost one, full, three entries");
    bench.write(Register::FdcanIr, 0x0000_8000);
    assert_eq!(bench.read(Register::FdcanTxefs), 0x0100_0003, "TEFL goes with its flag");
    bench.write(Register::FdcanTxefa, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxefs), 0x0000_0201, "two read: one left, get index 2");
    bench.write(Register::FdcanTxefa, 0x0000_0002);
    assert_eq!(bench.read(Register::FdcanTxefs), 0x0000_0000);
}

#[test]
fn without_automatic_retransmission_a_frame_is_tried_once() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanCccr, 0x0000_0043);
    bench.write(Register::FdcanCccr, 0x0000_0040);
    bench.run_for(20 * MICROSECOND);
    bench.send(0, &short_frame());
    bench.run_for(300 * MICROSECOND);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Unacknowledged)]);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    assert_eq!(bench.read(Register::FdcanTxbto), 0);
    assert_eq!(bench.read(Register::FdcanTxbcf), 0x0000_0001);

    bench.attach(&[]);
    bench.send(1, &short_frame());
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxbto), 0x0000_0002);
    assert_eq!(bench.words(TX_EVENTS, 2)[1] & 0x00C0_0000, 0x0080_0000, "event type 10");
}

#[test]
fn a_monitoring_controller_has_the_frames_of_an_error_passive_sender_that_is_alone() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanCccr, 0x0000_0023);
    bench.write(Register::FdcanCccr, 0x0000_0020);
    bench.run_for(20 * MICROSECOND);
    bench.attach_at(Some(1_000_000), &[short_frame()]);
    // Each of the first 16 attempts ends in an error flag.
    bench.run_for(1_000 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanRxf0s) & 0x7F, 0);
    bench.run_for(2_000 * MICROSECOND);
    assert_ne!(bench.read(Register::FdcanRxf0s) & 0x7F, 0);
    assert!(bench.log().iter().all(|(_, end)| *end == FrameEnd::Unacknowledged));
}

#[test]
fn a_monitoring_controller_neither_sends_nor_acknowledges() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanCccr, 0x0000_0023);
    bench.write(Register::FdcanCccr, 0x0000_0020);
    bench.run_for(20 * MICROSECOND);
    bench.send(0, &standard(0x001, &[]));
    let node = bench.attach_at(Some(1_000_000), &[short_frame()]);
    bench.run_for(70 * MICROSECOND);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Unacknowledged)]);
    bench.attach_at(Some(1_000_000), &[]);
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.node(node).outcomes(), [false, true]);
    assert_eq!(bench.read(Register::FdcanRxf0s) & 0x7F, 1, "it still listens");
}

#[test]
fn in_restricted_operation_it_receives_and_acknowledges_and_sends_nothing_until_asm_is_cleared() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.fdcan().fail_message_ram();
    assert_eq!(bench.read(Register::FdcanCccr) & 4, 4, "ASM");
    assert_eq!(bench.read(Register::FdcanIr) & 0x0002_0000, 0x0002_0000, "MRAF");
    bench.send(0, &standard(0x001, &[]));
    let node = bench.attach(&[short_frame()]);
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.node(node).outcomes(), [true]);
    assert_eq!(bench.read(Register::FdcanRxf0s) & 0x7F, 1);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Acknowledged)]);
    // INIT and CCE do not clear it.
    for value in [5, 7, 4] {
        bench.write(Register::FdcanCccr, value);
    }
    bench.send(0, &standard(0x001, &[]));
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Acknowledged)]);
    bench.write(Register::FdcanCccr, 0);
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Acknowledged), (0x001, FrameEnd::Acknowledged)]);
}
