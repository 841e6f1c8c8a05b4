use rigless::device::Device;
use rigless::soc::stm32h743::generated::usart1::{Register, cr1, icr, isr};
use rmd::{Milliseconds, Node, Request};

use super::*;
use crate::usual;
use virtual_stm32::serial_port::SerialPort;
use virtual_stm32::serial_port::bench::{BRR_115200, Bench};

/// A byte of the port: ten bits of 8.68 µs.
const BYTE_NS: u64 = 86_800;
const MS: u64 = 1_000_000;
/// A 0x9C request to motor 1, as known from a motor.
const STATUS_2: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];

fn line_with(bitrates: &[u32]) -> Rs485Line {
    let mut line = Rs485Line::new();
    for (bitrate, node) in bitrates.iter().zip(1..) {
        line.connect(usual::rmd(2, node, *bitrate), u64::from(node)).unwrap();
    }
    line
}

/// A port at 115207 baud on that line.
fn bench(line: Rs485Line) -> Bench {
    let mut port = SerialPort::new();
    port.attach(line);
    Bench::switched_on(port, BRR_115200, 0)
}

fn line(bench: &mut Bench) -> &mut Rs485Line {
    bench.part.model.peer_mut().unwrap()
}

fn request(request: Request) -> [u8; 13] {
    rmd::rs485::request(Node::new(1).unwrap(), &request).unwrap()
}

/// 100 degrees per second.
fn speed_100() -> [u8; 13] {
    request(Request::decode(&[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]))
}

fn timeout_1000() -> [u8; 13] {
    request(Request::SetCommunicationTimeout { timeout: Milliseconds(1_000) })
}

/// A word that arrived, and whether it had a framing error.
type Word = (u8, bool);

/// Sends bytes and lets time pass; what arrives at the port meanwhile.
fn send(bench: &mut Bench, bytes: &[u8], nanos: u64) -> Vec<Word> {
    for byte in bytes {
        bench.write(Register::Tdr, u64::from(*byte));
    }
    let end = bench.now + nanos;
    let mut words = Vec::new();
    while bench.now < end {
        bench.run((end - bench.now).min(BYTE_NS / 4));
        let damaged = isr::FE.is_set(bench.read(Register::Isr));
        words.extend(bench.take_words().iter().map(|word| (u8::try_from(*word).unwrap(), damaged)));
        bench.write(Register::Icr, icr::FECF.mask());
    }
    words
}

fn clean(words: &[Word]) -> Vec<u8> {
    assert!(words.iter().all(|(_, damaged)| !damaged), "{words:02X?}");
    words.iter().map(|(byte, _)| *byte).collect()
}

fn log(bench: &mut Bench, motor: usize) -> Vec<String> {
    line(bench).motor(motor).log().entries().map(|entry| entry.what.to_string()).collect()
}

#[test]
fn the_port_hears_itself_and_every_byte_has_its_times() {
    let mut bench = bench(Rs485Line::new());
    let start = bench.now;
    assert_eq!(clean(&send(&mut bench, &STATUS_2, 2 * MS)), STATUS_2);
    let sent = line(&mut bench).sent().to_vec();
    assert_eq!(sent.iter().map(|sent| sent.byte).collect::<Vec<_>>(), STATUS_2);
    for (nth, sent) in (0..).zip(&sent) {
        assert_eq!(sent.first_bit, Duration::from_nanos(start + nth * BYTE_NS));
        assert_eq!(sent.end, Duration::from_nanos(start + (nth + 1) * BYTE_NS));
        assert!(sent.driven);
    }
}

#[test]
fn a_motor_answers_after_100_to_200_us() {
    let mut bench = bench(line_with(&[115_200]));
    let start = bench.now;
    // The echo of the last byte comes a byte late.
    assert_eq!(clean(&send(&mut bench, &STATUS_2, 14 * BYTE_NS)), STATUS_2);
    let mut answer = Vec::new();
    let mut first = 0;
    while answer.len() < 13 {
        answer.extend(send(&mut bench, &[], 5_000));
        if answer.len() == 1 && first == 0 {
            first = bench.now;
        }
        assert!(bench.now < start + 10 * MS, "{answer:02X?}");
    }
    let answer = clean(&answer);
    assert_eq!(answer[..6], [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x00]);
    assert!(rmd::rs485::decode_reply(&answer.try_into().unwrap()).is_ok());
    let thought = first - BYTE_NS - (start + 13 * BYTE_NS);
    assert!((100_000..206_000).contains(&thought), "{thought} ns");
}

#[test]
fn a_motor_turns_while_nobody_looks_and_a_reset_of_the_port_leaves_it_alone() {
    let mut bench = bench(line_with(&[115_200]));
    send(&mut bench, &timeout_1000(), 5 * MS);
    send(&mut bench, &speed_100(), 500 * MS);
    assert!((line(&mut bench).motor(0).speed_rad_s() - 1.745).abs() < 0.01);
    bench.drive(|port, registers, context| {
        registers.reset();
        port.reset_line(registers, context);
    });
    bench.run(8_000 * MS);
    assert_eq!(line(&mut bench).motor(0).speed_rad_s(), 0.0);
    assert!(log(&mut bench, 0).contains(&"own timeout after 1000 ms without a command".to_owned()));
}

#[test]
fn a_motor_at_another_rate_hears_garbage_and_does_not_answer() {
    for rate in [500_000, 57_600] {
        let mut bench = bench(line_with(&[rate]));
        assert_eq!(clean(&send(&mut bench, &speed_100(), 20 * MS)), speed_100());
        assert_eq!(log(&mut bench, 0), [""; 0], "{rate}");
    }
}

/// What it says by itself, as a notice of its timeout, is garbage at the port.
#[test]
fn a_motor_at_another_rate_is_heard_as_garbage() {
    let mut bench = bench(line_with(&[115_200]));
    send(&mut bench, &timeout_1000(), 5 * MS);
    bench.write(Register::Cr1, 0);
    bench.write(Register::Brr, 200);
    bench.write(
        Register::Cr1,
        cr1::UE.mask() | cr1::TE.mask() | cr1::RE.mask() | cr1::FIFOEN.mask(),
    );
    let words = send(&mut bench, &[], 2_500 * MS);
    assert!(words.iter().any(|(_, damaged)| *damaged), "{words:02X?}");
    assert!(words.len() > 5 && words.iter().all(|(byte, _)| *byte != 0x3E), "{words:02X?}");
}

#[test]
fn without_driver_enable_nobody_hears_the_port() {
    let mut bench = bench(line_with(&[115_200]));
    bench.write(Register::Cr1, 0);
    bench.write(Register::Cr3, 0);
    bench.write(
        Register::Cr1,
        cr1::UE.mask() | cr1::TE.mask() | cr1::RE.mask() | cr1::FIFOEN.mask(),
    );
    bench.run(MS);
    assert_eq!(send(&mut bench, &speed_100(), 20 * MS), []);
    assert_eq!(log(&mut bench, 0), [""; 0]);
    assert!(line(&mut bench).sent().iter().all(|sent| !sent.driven));
    assert_eq!(line(&mut bench).settings().driver_enable, None);
}

#[test]
fn a_cut_line_leaves_the_echo_and_a_short_one_zeros() {
    let mut bench = bench(line_with(&[115_200]));
    line(&mut bench).set_fault(BusFault::Cut);
    assert_eq!(clean(&send(&mut bench, &STATUS_2, 10 * MS)), STATUS_2);
    line(&mut bench).set_fault(BusFault::Short);
    let words = send(&mut bench, &STATUS_2, 10 * MS);
    assert!(words.len() == 13 && words.iter().all(|(_, damaged)| *damaged), "{words:02X?}");
    assert_eq!(log(&mut bench, 0), [""; 0]);
    line(&mut bench).set_fault(BusFault::None);
    assert_eq!(send(&mut bench, &STATUS_2, 10 * MS).len(), 26);
}

#[test]
fn noise_arrives_with_and_without_stop_bits() {
    let mut bench = bench(Rs485Line::new());
    bench.drive(|port, registers, context| {
        let noise = |line: &mut Rs485Line, timeline: &mut Timeline<'_, '_>| {
            line.disturb(&[0x11, 0x22], false, timeline);
        };
        port.drive(registers, context, noise).unwrap();
    });
    assert_eq!(clean(&send(&mut bench, &[], MS)), [0x11, 0x22]);
    bench.drive(|port, registers, context| {
        let noise = |line: &mut Rs485Line, timeline: &mut Timeline<'_, '_>| {
            line.disturb(&[0x33], true, timeline)
        };
        port.drive(registers, context, noise).unwrap();
    });
    let words = send(&mut bench, &[], MS);
    assert!(matches!(words[..], [(_, true)]), "{words:02X?}");
}

#[test]
fn injections_reach_one_motor() {
    let mut bench = bench(line_with(&[115_200, 115_200]));
    let inject = |bench: &mut Bench, injection| {
        bench.drive(|port, registers, context| {
            port.drive(registers, context, |line: &mut Rs485Line, timeline| {
                line.inject(0, injection, timeline)
            })
        });
    };
    inject(&mut bench, Injection::WrongChecksum(true));
    let words = clean(&send(&mut bench, &STATUS_2, 10 * MS));
    assert!(rmd::rs485::decode_reply(&words[13..].try_into().unwrap()).is_err());
    inject(&mut bench, Injection::WrongChecksum(false));
    inject(&mut bench, Injection::Mute(true));
    assert_eq!(clean(&send(&mut bench, &STATUS_2, 10 * MS)), STATUS_2);
    inject(&mut bench, Injection::Mute(false));
    inject(&mut bench, Injection::Unplugged(true));
    assert_eq!(clean(&send(&mut bench, &speed_100(), 10 * MS)), speed_100());
    assert_eq!(log(&mut bench, 0), [""; 0]);
    inject(&mut bench, Injection::Unplugged(false));
    inject(&mut bench, Injection::LateReply(Duration::from_millis(7)));
    assert_eq!(send(&mut bench, &STATUS_2, 7 * MS).len(), 13);
    assert_eq!(send(&mut bench, &[], 4 * MS).len(), 13);
}

/// A stop spoken into the answer of a motor: both are lost, and the motor hears garbage.
#[test]
fn what_overlaps_is_garbled() {
    let mut bench = bench(line_with(&[115_200]));
    send(&mut bench, &speed_100(), 13 * BYTE_NS + 5 * BYTE_NS);
    let stop = request(Request::Stop);
    let words = send(&mut bench, &stop, 30 * BYTE_NS);
    assert!(words.iter().any(|(_, damaged)| *damaged), "{words:02X?}");
    assert!(!log(&mut bench, 0).contains(&"command 0x81 stop".to_owned()));
    send(&mut bench, &stop, 30 * BYTE_NS);
    assert!(log(&mut bench, 0).contains(&"command 0x81 stop".to_owned()), "repeated, it is heard");
}

/// The same from a copy that was serialised in the middle of a frame, in mid-motion.
#[test]
fn a_snapshot_keeps_the_whole_line() {
    let run = |through_bytes: bool| {
        let mut bench = bench(line_with(&[115_200, 500_000]));
        send(&mut bench, &timeout_1000(), 5 * MS);
        send(&mut bench, &speed_100(), 6 * BYTE_NS);
        if through_bytes {
            let bytes = postcard::to_extend(line(&mut bench), Vec::new()).unwrap();
            *line(&mut bench) = postcard::from_bytes(bytes.leak()).unwrap();
        }
        let words = send(&mut bench, &[], 3_000 * MS);
        let state = postcard::to_extend(line(&mut bench), Vec::new()).unwrap();
        (words, log(&mut bench, 0), state)
    };
    assert_eq!(run(true), run(false));
}

/// 0.7 % faster: each byte reaches into the stop bit of the one before, as the port sees it.
#[test]
fn a_motor_that_is_a_little_faster_than_the_port_is_read() {
    let mut bench = bench(line_with(&[116_000]));
    let words = send(&mut bench, &STATUS_2, 5 * MS);
    assert_eq!(words.len(), 2 * STATUS_2.len(), "the echo, the reply");
    assert!(words.iter().all(|(_, damaged)| !damaged), "{words:02X?}");
}
