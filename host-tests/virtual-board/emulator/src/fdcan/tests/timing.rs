//! Bit times, joining the bus, timestamps.

use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::time::VirtualNanos;

use super::bench::{
    Bench, HALF_MBIT, MBIT, MICROSECOND, QUEUE_OF_3, RX_FIFO_0, TX_EVENTS, short_frame, standard,
};

#[test]
fn it_joins_after_eleven_recessive_bits() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.send(0, &short_frame());
    bench.run_for(11 * MICROSECOND - 1);
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_0707, "synchronising");
    bench.run_for(1);
    bench.run_for(MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr), 0x0000_071F, "sending");
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.fdcan().log()[0].start, VirtualNanos(11 * MICROSECOND));
}

#[test]
fn a_frame_on_the_line_puts_joining_off_until_it_has_ended() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.attach_at(Some(1_000_000), &[]);
    bench.attach_at(Some(1_000_000), &[short_frame()]);
    bench.run_for(10 * MICROSECOND);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.run_for(54 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x18, 0x00, "its last 11 bits are not over");
    bench.run_for(MICROSECOND);
    assert_eq!(bench.read(Register::FdcanPsr) & 0x18, 0x08, "62 bits and 3 of intermission are");
    assert_eq!(bench.read(Register::FdcanRxf0s), 0, "it is not the controller's");
}

#[test]
fn frames_take_as_long_as_nbtp_and_the_kernel_clock_say() {
    // 1 Mbit/s, 500 kbit/s, 210526 bit/s (prescaler 19), and 1 Mbit/s from the reset value's 17
    // quanta.
    for (nbtp, hz, heard, sent) in [
        (MBIT, 80_000_000, 61_000, 62_000),
        (HALF_MBIT, 80_000_000, 122_000, 124_000),
        (0x0412_0F02, 80_000_000, 289_750, 294_500),
        (0x0600_0A03, 16_000_000, 61_000, 62_000),
        (MBIT, 40_000_000, 122_000, 124_000),
    ] {
        let mut bench = Bench::configured(nbtp, QUEUE_OF_3);
        bench.set_kernel_clock(hz);
        let node = bench.attach(&[]);
        bench.write(Register::FdcanCccr, 0x0000_0000);
        bench.run_for(100 * MICROSECOND);
        let start = bench.now;
        bench.send(0, &short_frame());
        bench.run_for(sent - 1);
        assert_eq!(bench.node(node).heard(), [(VirtualNanos(start + heard), short_frame())]);
        assert_eq!(bench.read(Register::FdcanTxbto), 0);
        bench.run_for(1);
        assert_eq!(bench.read(Register::FdcanTxbto), 1);
    }
}

#[test]
fn nothing_happens_while_the_kernel_clock_stands() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.set_kernel_clock(0);
    bench.attach(&[]);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    bench.send(0, &short_frame());
    bench.run_for(1_000 * MICROSECOND);
    assert_eq!(bench.log(), []);
    bench.set_kernel_clock(80_000_000);
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.delivered(), [0x123]);
}

#[test]
fn frames_follow_each_other_after_three_bits() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.send(0, &short_frame());
    bench.send(1, &short_frame());
    bench.run_for(200 * MICROSECOND);
    let starts: Vec<u64> = bench.fdcan().log().iter().map(|record| record.start.0).collect();
    assert_eq!(starts[1] - starts[0], 65 * MICROSECOND);
}

#[test]
fn the_transmit_pause_leaves_two_bits_more() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanCccr, 0x0000_4003);
    bench.write(Register::FdcanCccr, 0x0000_4000);
    bench.run_for(20 * MICROSECOND);
    bench.attach(&[]);
    bench.send(0, &short_frame());
    bench.send(1, &short_frame());
    bench.run_for(200 * MICROSECOND);
    let starts: Vec<u64> = bench.fdcan().log().iter().map(|record| record.start.0).collect();
    assert_eq!(starts[1] - starts[0], 67 * MICROSECOND);
}

#[test]
fn timestamps_are_bit_times_at_the_start_of_frame() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[]);
    bench.write(Register::FdcanTscv, 0);
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTscv), 100);
    bench.send(0, &short_frame());
    bench.run_for(100 * MICROSECOND);
    bench.offer(node, standard(0x77, &[]));
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.words(TX_EVENTS, 2), [0x048C_0000, 0x0042_0064], "sent at 100");
    assert_eq!(bench.words(RX_FIFO_0, 2), [0x01DC_0000, 0x8000_00C8], "received at 200");
    assert_eq!(bench.read(Register::FdcanTscv), 300);
}

#[test]
fn the_timestamp_counter_says_when_it_starts_over() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanTscv, 0);
    bench.run_for(65_535 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTscv), 0xFFFF);
    assert_eq!(bench.read(Register::FdcanIr), 0);
    bench.run_for(MICROSECOND);
    assert_eq!(bench.read(Register::FdcanTscv), 0);
    assert_eq!(bench.read(Register::FdcanIr), 0x0001_0000);
}
