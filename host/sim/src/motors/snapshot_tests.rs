//! A motor that was serialised and read back goes on as the original does, byte for byte.

use std::time::Duration;

use host_protocol::{CanFrame, Protocol};

use super::{Injection, Motor};
use crate::wiring::MotorWiring;

const MS: Duration = Duration::from_millis(1);

fn motor(protocol: Protocol, node: u8, serial: bool) -> Motor {
    let wiring = MotorWiring { bus: 0, protocol, node, bitrate: 115_200, can_id: None };
    Motor::new(wiring, serial, 7).unwrap()
}

fn bytes(motor: &Motor) -> Vec<u8> {
    postcard::to_extend(motor, Vec::new()).unwrap()
}

/// The log's names point into what they were read from, which therefore lives as long as the
/// process.
fn restored(motor: &Motor) -> Motor {
    postcard::from_bytes(bytes(motor).leak()).unwrap()
}

/// Lets time pass up to `until`; when it sent what.
fn run(motor: &mut Motor, until: Duration) -> Vec<(Duration, String)> {
    let mut sent = Vec::new();
    while let Some(at) = motor.next_event().filter(|at| *at <= until) {
        motor.advance(at);
        while let Some(out) = motor.take_ready(at) {
            sent.push((at, format!("{} {}", out.wire, out.corrupt)));
        }
    }
    motor.advance(until);
    sent
}

/// Restores the motor at many phases of `script`, in which `hear` tells it something every
/// `period`, and compares the rest of both lives.
fn lives_are_the_same(
    make: impl Fn() -> Motor,
    period: Duration,
    hear: impl Fn(&mut Motor, Duration, u32),
) {
    const STEPS: u32 = 60;
    for phase in (0..STEPS).step_by(7) {
        let mut original = make();
        let mut copy: Option<Motor> = None;
        for step in 0..STEPS {
            let at = period * step;
            run(&mut original, at);
            if step == phase {
                // In mid-reply too: it has just heard something.
                hear(&mut original, at, step);
                let read_back = restored(&original);
                assert_eq!(bytes(&read_back), bytes(&original));
                copy = Some(read_back);
                continue;
            }
            hear(&mut original, at, step);
            if let Some(copy) = &mut copy {
                run(copy, at);
                hear(copy, at, step);
            }
        }
        let mut copy = copy.unwrap();
        let end = period * STEPS + Duration::from_secs(4);
        assert_eq!(run(&mut copy, end), run(&mut original, end), "phase {phase}");
        assert_eq!(bytes(&copy), bytes(&original), "phase {phase}");
        assert!(original.log().entries().count() > 1, "something happened");
    }
}

#[test]
fn rmd_on_can() {
    let frames: [[u8; 8]; 4] = [
        [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0],
        [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0],
        [0x9A, 0, 0, 0, 0, 0, 0, 0],
        [0x77, 0, 0, 0, 0, 0, 0, 0],
    ];
    let hear = |motor: &mut Motor, at: Duration, step: u32| {
        let data = frames[step as usize % frames.len()];
        motor.hear_frame(at, &CanFrame::standard(0x141, &data).unwrap());
    };
    lives_are_the_same(|| motor(Protocol::Rmd, 1, false), 13 * MS, hear);
}

/// A byte each time, so that snapshots fall into frames.
#[test]
fn rmd_on_rs485() {
    let speed = rmd_speed();
    let hear = |motor: &mut Motor, at: Duration, step: u32| {
        motor.hear_byte(at, speed[step as usize % speed.len()]);
        if step == 30 {
            motor.inject(at, Injection::Garbage(true));
        }
    };
    lives_are_the_same(|| motor(Protocol::Rmd, 1, true), Duration::from_micros(87), hear);
}

/// 0xA2, 100 degrees per second, to motor 1.
fn rmd_speed() -> [u8; 13] {
    let request = ::rmd::Request::decode(&[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]);
    ::rmd::rs485::request(::rmd::Node::new(1).unwrap(), &request).unwrap()
}

#[test]
fn thruster() {
    let node = ::thruster::Node::new(0x0B).unwrap();
    let requests = [
        ::thruster::Request::Signal { signal: ::thruster::Percent(0) },
        ::thruster::Request::Signal { signal: ::thruster::Percent(30) },
        ::thruster::Request::ReadFaults,
    ];
    let hear = |motor: &mut Motor, at: Duration, step: u32| {
        let request = requests[step as usize % requests.len()];
        motor.hear_frame(at, &::thruster::can::request(node, &request).unwrap());
        motor.inject(at, Injection::StuckRotor(step > 40));
    };
    lives_are_the_same(|| motor(Protocol::Thruster, 0x0B, false), 11 * MS, hear);
}

#[test]
fn d5() {
    let node = ::d5::Node::new(0x0B).unwrap();
    let speed = ::d5::Value::Word(::d5::encode_speed(::d5::DegreesPerSecond(200)).unwrap());
    let requests = [
        ::d5::Request::Write { register: ::d5::Register::SPEED, value: speed },
        ::d5::Request::AsyncWrite { register: ::d5::Register::SPEED, value: ::d5::Value::Word(0) },
        ::d5::Request::Read { register: ::d5::Register::CURRENT_SPEED, width: ::d5::Width::Word },
    ];
    let hear = |motor: &mut Motor, at: Duration, step: u32| {
        let request = requests[step as usize % requests.len()];
        let id = ::d5::can::default_request_id(node);
        let frame = ::d5::can::request(id, ::d5::Address::Node(node), &request).unwrap();
        motor.hear_frame(at, &frame);
    };
    lives_are_the_same(|| motor(Protocol::D5, 0x0B, false), 9 * MS, hear);
}

/// A byte each time, so that snapshots fall into frames.
#[test]
fn d5_on_a_serial_line() {
    let speed = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D];
    let hear = |motor: &mut Motor, at: Duration, step: u32| {
        motor.hear_byte(at, speed[step as usize % speed.len()]);
    };
    lives_are_the_same(|| motor(Protocol::D5, 0x0B, true), Duration::from_micros(87), hear);
}
