//! IE, ILS and ILE, and the levels of the two lines.

use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{Bench, MBIT, MICROSECOND, QUEUE_OF_3, short_frame, standard};

fn with_a_received_frame() -> Bench {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[short_frame()]);
    bench.run_for(100 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0001);
    bench
}

#[test]
fn a_line_needs_flag_enable_and_line_enable() {
    let mut bench = with_a_received_frame();
    assert_eq!(bench.lines, [false, false]);
    bench.write(Register::FdcanIe, 0x0000_0001);
    assert_eq!(bench.lines, [false, false]);
    bench.write(Register::FdcanIle, 0x0000_0001);
    assert_eq!(bench.lines, [true, false]);
    bench.write(Register::FdcanIr, 0x0000_0001);
    assert_eq!(bench.lines, [false, false]);
}

#[test]
fn ils_moves_a_source_to_the_second_line() {
    let mut bench = with_a_received_frame();
    bench.write(Register::FdcanIe, 0x0000_0001);
    bench.write(Register::FdcanIle, 0x0000_0003);
    assert_eq!(bench.lines, [true, false]);
    bench.write(Register::FdcanIls, 0x0000_0001);
    assert_eq!(bench.lines, [false, true]);
    bench.write(Register::FdcanIle, 0x0000_0001);
    assert_eq!(bench.lines, [false, false]);
}

#[test]
fn writing_ir_clears_only_what_is_written() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[standard(0x7FF, &[])]);
    bench.send(0, &short_frame());
    bench.run_for(200 * MICROSECOND);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_1201, "RF0N, TC, TEFN");
    bench.write(Register::FdcanIr, 0x0000_0200);
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_1001);
}

#[test]
fn a_line_falls_with_a_reset_of_the_controller() {
    let mut bench = with_a_received_frame();
    bench.write(Register::FdcanIe, 0x0000_0001);
    bench.write(Register::FdcanIle, 0x0000_0003);
    bench.reset_line();
    bench.run_for(MICROSECOND);
    assert_eq!(bench.lines, [false, false]);
}
