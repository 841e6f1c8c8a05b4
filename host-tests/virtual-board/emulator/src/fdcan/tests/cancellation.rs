//! TXBCR and TXBCF.

use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{
    Bench, FIFO_OF_3, MBIT, MICROSECOND, QUEUE_OF_3, TX_EVENTS, short_frame, standard,
};
use crate::fdcan::FrameEnd;

#[test]
fn a_waiting_request_is_taken_back_at_once() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.send(0, &standard(0x100, &[]));
    bench.send(1, &standard(0x200, &[]));
    bench.run_for(10 * MICROSECOND);
    bench.write(Register::FdcanTxbcr, 0x0000_0002);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbcf), 0x0000_0002);
    assert_eq!(bench.read(Register::FdcanTxbcr), 0);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0400, "TCF");
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x100]);
}

#[test]
fn one_on_the_line_that_arrives_is_both_sent_and_cancelled() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.send(0, &short_frame());
    bench.run_for(10 * MICROSECOND);
    bench.write(Register::FdcanTxbcr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbcr), 0x0000_0001, "not yet");
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbcf), 0);
    bench.run_for(60 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTxbcr), 0);
    assert_eq!(bench.read(Register::FdcanTxbto), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbcf), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_1600, "TC, TCF and TEFN");
    assert_eq!(
        bench.words(TX_EVENTS, 2)[1] & 0x00C0_0000,
        0x0080_0000,
        "sent in spite of cancellation"
    );
}

#[test]
fn one_on_the_line_that_fails_is_only_cancelled() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.send(0, &short_frame());
    bench.run_for(10 * MICROSECOND);
    bench.write(Register::FdcanTxbcr, 0x0000_0001);
    bench.run_for(500 * MICROSECOND);
    assert_eq!(bench.log(), [(0x123, FrameEnd::Unacknowledged)], "no second attempt");
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    assert_eq!(bench.read(Register::FdcanTxbto), 0);
    assert_eq!(bench.read(Register::FdcanTxbcf), 0x0000_0001);
}

#[test]
fn cancelling_nothing_is_finished_at_once() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanTxbcr, 0xFFFF_FFFF);
    assert_eq!(
        bench.read(Register::FdcanTxbcf),
        0x0000_0007,
        "of the three buffers that there are"
    );
    bench.send(1, &short_frame());
    assert_eq!(bench.read(Register::FdcanTxbcf), 0x0000_0005, "a new request clears its bit");
}

#[test]
fn the_interrupt_can_be_chosen_by_buffer() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanTxbcie, 0x0000_0002);
    bench.write(Register::FdcanTxbcr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanIr), 0);
    bench.write(Register::FdcanTxbcr, 0x0000_0002);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0400);
}

#[test]
fn a_request_is_taken_back_while_init_is_set() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanCccr, 0x0000_0001);
    bench.send(0, &short_frame());
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001);
    bench.write(Register::FdcanTxbcr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    assert_eq!(bench.read(Register::FdcanTxbcf), 0x0000_0001);
}

#[test]
fn a_fifo_steps_over_a_cancelled_frame() {
    let mut bench = Bench::on_bus(MBIT, FIFO_OF_3);
    bench.attach(&[]);
    for (buffer, id) in [0x100, 0x200, 0x300].into_iter().enumerate() {
        bench.send(buffer, &standard(id, &[]));
    }
    bench.run_for(10 * MICROSECOND);
    bench.write(Register::FdcanTxbcr, 0x0000_0002);
    bench.run_for(300 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x100, 0x300]);
    assert_eq!(bench.read(Register::FdcanTxfqs), 0x0000_0003);
}
