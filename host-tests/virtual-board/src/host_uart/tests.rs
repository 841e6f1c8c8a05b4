use rigless::soc::stm32h743::generated::usart1::{Register, icr, isr};

use super::*;
use virtual_stm32::serial_port::SerialPort;
use virtual_stm32::serial_port::bench::Bench;

/// 100 MHz / 109 = 917431 baud: 10.9 µs a byte.
const BRR_921600: u64 = 109;
const BYTE_NS: u64 = 10_900;

fn bench() -> Bench {
    let mut port = SerialPort::new();
    port.attach(HostUart::new());
    Bench::switched_on(port, BRR_921600, 0)
}

fn host(bench: &mut Bench) -> &mut HostUart {
    bench.part.model.peer_mut().unwrap()
}

#[test]
fn bytes_arrive_at_the_pace_of_the_port() {
    let mut bench = bench();
    assert_eq!(host(&mut bench).settings().bits_per_second(), 917_431);
    host(&mut bench).send(&[1, 2, 3]);
    let mut arrived = Vec::new();
    for _ in 0..4 {
        bench.run(BYTE_NS);
        arrived.push(bench.take_words());
    }
    assert_eq!(arrived, [vec![1], vec![2], vec![3], vec![]]);
    assert_eq!(host(&mut bench).unsent(), 0);
}

#[test]
fn what_the_board_sends_is_kept_with_its_times() {
    let mut bench = bench();
    let start = bench.now;
    bench.write(Register::Tdr, 0xA5);
    bench.write(Register::Tdr, 0x5A);
    bench.run(3 * BYTE_NS);
    let at = |bytes| Duration::from_nanos(start + bytes * BYTE_NS);
    let expected = [Received { at: at(1), byte: 0xA5 }, Received { at: at(2), byte: 0x5A }];
    assert!(host(&mut bench).has_received());
    assert_eq!(host(&mut bench).take_timed(), expected);
    assert_eq!(host(&mut bench).take(), [0u8; 0]);
}

#[test]
fn a_damaged_byte_is_told_by_a_framing_error() {
    let mut bench = bench();
    host(&mut bench).send(&[1]);
    host(&mut bench).send_damaged(&[2]);
    bench.run(BYTE_NS);
    assert!(!isr::FE.is_set(bench.read(Register::Isr)));
    assert_eq!(bench.take_words(), [1]);
    bench.run(BYTE_NS);
    assert!(isr::FE.is_set(bench.read(Register::Isr)));
    bench.write(Register::Icr, icr::FECF.mask());
    assert_ne!(bench.take_words(), [2]);
}

#[test]
fn a_cut_line_loses_both_directions() {
    let mut bench = bench();
    bench.part.model.silence(true);
    host(&mut bench).send(&[1, 2]);
    bench.write(Register::Tdr, 0xA5);
    bench.run(5 * BYTE_NS);
    assert_eq!(
        (bench.take_words(), host(&mut bench).unsent(), host(&mut bench).take()),
        (vec![], 0, vec![])
    );
    bench.part.model.silence(false);
    host(&mut bench).send(&[3]);
    bench.run(BYTE_NS);
    assert_eq!(bench.take_words(), [3]);
}

/// At another rate nothing is understood, either way, until the rates are one again.
#[test]
fn another_rate_is_noise_at_both_ends() {
    let mut bench = bench();
    // The port's own is 0.5 % off, which is none.
    host(&mut bench).set_baud(2_000_000);
    host(&mut bench).send(&[2]);
    bench.write(Register::Tdr, 0xA5);
    bench.run(BYTE_NS);
    assert!(isr::FE.is_set(bench.read(Register::Isr)));
    bench.write(Register::Icr, icr::FECF.mask());
    assert_ne!(bench.take_words(), [2]);
    assert_ne!(host(&mut bench).take(), [0xA5]);
    host(&mut bench).set_baud(DEFAULT_BAUD);
    host(&mut bench).send(&[3]);
    bench.write(Register::Tdr, 0xA5);
    bench.run(BYTE_NS);
    assert!(!isr::FE.is_set(bench.read(Register::Isr)));
    assert_eq!((bench.take_words(), host(&mut bench).take()), (vec![3], vec![0xA5]));
}
