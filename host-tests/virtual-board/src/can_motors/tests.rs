use std::time::Duration;

use host_protocol::CanFrame;

use super::*;
use crate::nodes::test_bus::{Entry, Outcome, TestBus};
use crate::usual;

const MBIT: u32 = 1_000_000;
/// 0xA2, 100 degrees per second (RMD V3.6 §2.18.4): 1.7453 rad/s.
const SPEED_100: [u8; 8] = [0xA2, 0, 0, 0, 0x10, 0x27, 0x00, 0x00];
const STATUS_2: [u8; 8] = [0x9C, 0, 0, 0, 0, 0, 0, 0];
const STOP: [u8; 8] = [0x81, 0, 0, 0, 0, 0, 0, 0];
/// 0xB3, 1000 ms (RMD V3.6 §2.30.4).
const TIMEOUT_1000: [u8; 8] = [0xB3, 0, 0, 0, 0xE8, 0x03, 0x00, 0x00];

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn rmd() -> CanMotor {
    CanMotor::new(usual::rmd(0, 1, MBIT), 3).unwrap()
}

fn to_rmd(data: [u8; 8]) -> CanFrame {
    CanFrame::standard(0x141, &data).unwrap()
}

/// A bus with one RMD motor.
fn bus() -> TestBus {
    let mut bus = TestBus::new(u64::from(MBIT));
    bus.attach(rmd());
    bus
}

fn frames(bus: &TestBus) -> Vec<String> {
    bus.log().iter().map(|entry| entry.frame.to_string()).collect()
}

fn speed(bus: &mut TestBus) -> f64 {
    bus.peer::<CanMotor>(0).motor().speed_rad_s()
}

/// A request of 111 bits or so, 100 to 200 µs of thought, an answer.
#[test]
fn a_request_is_answered_in_the_motors_time() {
    let mut bus = bus();
    assert_eq!(bus.send(ms(1), &to_rmd(STATUS_2)), Outcome::Delivered);
    bus.run_until(ms(2));
    let [Entry { start, outcome, .. }] = bus.log() else { panic!("one answer: {:?}", bus.log()) };
    assert_eq!(frames(&bus), ["241#9C19000000000000"]);
    assert_eq!(*outcome, Outcome::Delivered);
    let asked =
        ms(1) + Duration::from_micros(u64::from(to_bus(&to_rmd(STATUS_2)).bits_until_valid()));
    let thought = *start - asked;
    assert!(
        (Duration::from_micros(100)..=Duration::from_micros(200)).contains(&thought),
        "{thought:?}"
    );
}

#[test]
fn a_commanded_shaft_turns_while_nobody_looks() {
    let mut bus = bus();
    bus.send(ms(1), &to_rmd(SPEED_100));
    bus.run_until(ms(1_000));
    assert!((speed(&mut bus) - 1.745).abs() < 0.01);
    bus.send(ms(1_001), &to_rmd(STOP));
    bus.run_until(ms(2_000));
    assert_eq!(speed(&mut bus), 0.0);
    let log: Vec<_> =
        bus.peer::<CanMotor>(0).motor().log().entries().map(|e| e.what.to_string()).collect();
    assert_eq!(log[0], "command 0xA2 velocity");
    assert!(log.last().unwrap().starts_with("stopped"));
}

#[test]
fn its_own_timeout_strikes_at_its_time_and_it_says_so() {
    let mut bus = bus();
    bus.send(ms(1), &to_rmd(TIMEOUT_1000));
    bus.run_until(ms(2_500));
    assert_eq!(frames(&bus), ["241#B3000000E8030000", "241#F1"]);
    let log = bus.peer::<CanMotor>(0).motor().log();
    let strike =
        log.entries().find(|entry| entry.what.to_string().starts_with("own timeout")).unwrap();
    assert!((1_001_000..1_001_200).contains(&strike.time_us), "{strike:?}");
}

#[test]
fn a_part_that_restarts_leaves_the_motor_running() {
    let mut bus = bus();
    bus.send(ms(1), &to_rmd(TIMEOUT_1000));
    bus.send(ms(2), &to_rmd(SPEED_100));
    bus.run_until(ms(500));
    bus.restart_part();
    bus.run_until(ms(900));
    assert!((speed(&mut bus) - 1.745).abs() < 0.01);
    // Its output is cut, and it runs out.
    bus.run_until(ms(8_000));
    assert_eq!(speed(&mut bus), 0.0, "its own timeout still strikes");
}

#[test]
fn injections_take_effect_between_frames() {
    let mut bus = bus();
    bus.drive(0, |motor: &mut CanMotor, timeline| motor.inject(Injection::Mute(true), timeline));
    bus.send(ms(1), &to_rmd(STATUS_2));
    bus.run_until(ms(10));
    assert!(bus.log().is_empty(), "mute");

    bus.drive(0, |motor: &mut CanMotor, timeline| {
        motor.inject(Injection::Mute(false), timeline);
        motor.inject(Injection::LateReply(ms(7)), timeline);
    });
    bus.send(ms(11), &to_rmd(STATUS_2));
    bus.run_until(ms(30));
    assert!(bus.log()[0].start > ms(18), "late");

    bus.drive(0, |motor: &mut CanMotor, timeline| {
        motor.inject(Injection::LateReply(Duration::ZERO), timeline);
        motor.inject(Injection::WrongChecksum(true), timeline);
    });
    bus.send(ms(31), &to_rmd(STATUS_2));
    bus.run_until(ms(40));
    assert_eq!(bus.log()[1].outcome, Outcome::Damaged(Fault::Crc));
    assert_eq!(bus.log().len(), 2, "not sent again");

    bus.drive(0, |motor: &mut CanMotor, timeline| {
        motor.inject(Injection::WrongChecksum(false), timeline);
        motor.inject(Injection::Unplugged(true), timeline);
    });
    bus.send(ms(41), &to_rmd(SPEED_100));
    bus.run_until(ms(60));
    assert_eq!((bus.log().len(), speed(&mut bus)), (2, 0.0));
}

/// 0x0004, under-voltage: the shaft runs out, which happens without any frame.
#[test]
fn a_fault_bit_acts_at_once_and_a_power_cycle_takes_what_was_to_be_sent() {
    let mut bus = bus();
    bus.send(ms(1), &to_rmd(SPEED_100));
    bus.run_until(ms(500));
    bus.drive(0, |motor: &mut CanMotor, timeline| {
        motor.inject(Injection::FaultBits(0x0004), timeline)
    });
    assert_eq!(bus.peer::<CanMotor>(0).motor().fault_word(), 0x0004);
    bus.run_until(ms(2_500));
    assert_eq!(speed(&mut bus), 0.0);

    let before = bus.log().len();
    bus.send(ms(2_501), &to_rmd(STATUS_2));
    bus.drive(0, |motor: &mut CanMotor, timeline| motor.power_cycle(timeline));
    bus.run_until(ms(2_600));
    assert_eq!(bus.log().len(), before);
}

/// On a bus where nobody listens to it, its controller keeps the last eight frames.
#[test]
fn a_dead_bus_costs_the_oldest_frames() {
    let mut bus = TestBus::new(u64::from(MBIT));
    let mut motor = rmd();
    for number in 0..12 {
        let frame = CanFrame::standard(0x241, &[number]).unwrap();
        enqueue(&mut motor.queue, Outgoing { at: ms(0), wire: Wire::Can(frame), corrupt: false });
    }
    bus.attach(motor);
    bus.run_until(ms(10));
    let numbers: Vec<_> = bus.log().iter().map(|entry| entry.frame.data()[0]).collect();
    assert_eq!(numbers, [4, 5, 6, 7, 8, 9, 10, 11]);
}

/// The same from a copy that was serialised in mid-motion with an answer under way.
#[test]
fn a_snapshot_keeps_the_whole_motor() {
    let run = |through_bytes: bool| {
        let mut bus = TestBus::new(u64::from(MBIT));
        bus.attach(rmd());
        bus.send(ms(1), &to_rmd(TIMEOUT_1000));
        bus.send(ms(2), &to_rmd(SPEED_100));
        bus.run_until(ms(200));
        bus.send(ms(201), &to_rmd(STATUS_2));
        if through_bytes {
            let bytes = postcard::to_extend(bus.peer::<CanMotor>(0), Vec::new()).unwrap();
            *bus.peer::<CanMotor>(0) = postcard::from_bytes(bytes.leak()).unwrap();
        }
        bus.run_until(ms(4_000));
        let log: Vec<_> = bus.peer::<CanMotor>(0).motor().log().entries().copied().collect();
        (bus.log().to_vec(), log, speed(&mut bus).to_bits())
    };
    assert_eq!(run(true), run(false));
}
