//! What the scripts of the folder above cannot say.

use std::time::Duration;

use host_protocol::Protocol;

use super::super::test_motor::TestMotor;
use super::super::{Injection, MotorEvent};

const ID: u16 = 0x141;
const STOP: [u8; 8] = [0x81, 0, 0, 0, 0, 0, 0, 0];
const SHUTDOWN: [u8; 8] = [0x80, 0, 0, 0, 0, 0, 0, 0];
const STATUS_2: [u8; 8] = [0x9C, 0, 0, 0, 0, 0, 0, 0];
/// 0xA2, 100 degrees per second (RMD V3.6 §2.18.4).
const SPEED_100: [u8; 8] = [0xA2, 0, 0, 0, 0x10, 0x27, 0x00, 0x00];

fn motor() -> TestMotor {
    TestMotor::new(Protocol::Rmd, 1, false)
}

#[test]
fn stop_is_faster_than_shutdown() {
    let stopped_after = |command: &[u8]| {
        let mut motor = motor();
        motor.ask(ID, &SPEED_100);
        motor.run_ms(1_000);
        motor.ask(ID, command);
        let from = motor.now;
        motor.run_ms(3_000);
        let entry = *motor.motor.log().entries().next_back().unwrap();
        assert!(matches!(entry.what, MotorEvent::Stopped { .. }));
        entry.time_us - u64::try_from(from.as_micros()).unwrap()
    };
    assert!(stopped_after(&STOP) < 150_000);
    assert!(stopped_after(&SHUTDOWN) > 500_000);
}

#[test]
fn answers_wander() {
    let mut motor = motor();
    motor.inject(Injection::ReplyJitter(Duration::from_millis(20)));
    let late = (0..100).filter(|_| {
        let at_once = motor.ask(ID, &STATUS_2).len();
        assert_eq!(at_once + motor.run_ms(20).len(), 1);
        at_once == 0
    });
    assert!((1..100).contains(&late.count()), "some within 1 ms, some later");
}

/// A pause of 35 bits ends a frame: at 500000 baud each of a sender at 115200 does.
#[test]
fn what_ends_a_frame_follows_the_rate() {
    let frame = |data| {
        let node = rmd::Node::new(1).unwrap();
        rmd::rs485::request(node, &rmd::Request::decode(data)).unwrap()
    };
    let status_2 = frame(&STATUS_2);
    let mut motor = TestMotor::new(Protocol::Rmd, 1, true);
    // 0xB4, 500000 baud (RMD V3.6 §2.31): it acts once it is switched on again.
    motor.ask_serial(&frame(&[0xB4, 0, 0, 0, 0, 0, 0, 1]));
    assert_eq!(motor.ask_serial(&status_2).len(), 1);
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.motor.bitrate(), 500_000);
    assert!(motor.ask_serial(&status_2).is_empty());
}
