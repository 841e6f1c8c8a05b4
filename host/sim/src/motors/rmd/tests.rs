use host_protocol::Protocol;

use super::super::Injection;
use super::super::test_motor::TestMotor;
use super::*;

const ID: u16 = 0x141;
const STOP: [u8; 8] = [0x81, 0, 0, 0, 0, 0, 0, 0];
const SHUTDOWN: [u8; 8] = [0x80, 0, 0, 0, 0, 0, 0, 0];
const STATUS_1: [u8; 8] = [0x9A, 0, 0, 0, 0, 0, 0, 0];
const STATUS_2: [u8; 8] = [0x9C, 0, 0, 0, 0, 0, 0, 0];
const RELEASE_BRAKE: [u8; 8] = [0x77, 0, 0, 0, 0, 0, 0, 0];
/// 0xA2, 100 degrees per second (RMD V3.6 §2.18.4): 1.7453 rad/s.
const SPEED_100: [u8; 8] = [0xA2, 0, 0, 0, 0x10, 0x27, 0x00, 0x00];
const RAD_S_100: f64 = 1.745_329;
/// 0xB3, 1000 ms (RMD V3.6 §2.30.4).
const TIMEOUT_1000: [u8; 8] = [0xB3, 0, 0, 0, 0xE8, 0x03, 0x00, 0x00];

fn motor() -> TestMotor {
    TestMotor::new(Protocol::Rmd, 1, false)
}

/// A motor with a holding brake, open.
fn with_brake() -> TestMotor {
    let mut motor = motor();
    motor.inject(Injection::Brake(true));
    motor.ask(ID, &RELEASE_BRAKE);
    assert_eq!(motor.run_ms(160), ["241#7700000000000000"]);
    motor
}

/// A motor that has been running at 100 degrees per second for a second.
fn running() -> TestMotor {
    let mut motor = motor();
    motor.ask(ID, &SPEED_100);
    motor.run_ms(1_000);
    motor.assert_speed(RAD_S_100);
    motor
}

#[test]
fn at_rest_it_reports_25_degrees_48_volts_brake_open() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &STATUS_1), ["241#9A190001E0010000"]);
    assert_eq!(motor.ask(ID, &STATUS_2), ["241#9C19000000000000"]);
    assert_eq!(motor.ask(ID, &[0x92, 0, 0, 0, 0, 0, 0, 0]), ["241#9200000000000000"]);
}

#[test]
fn others_are_not_its_business() {
    let mut motor = motor();
    for id in [0x142, 0x241, 0x301, 0x0B] {
        assert_eq!(motor.ask(id, &STATUS_2), [""; 0]);
    }
    assert_eq!(motor.ask(ID, &STATUS_2[..7]), [""; 0]);
    assert_eq!(motor.ask(0x280, &SHUTDOWN), ["241#8000000000000000"], "broadcast");
}

/// 0.35 A and 100 dps sustained, about 100° travelled.
#[test]
fn it_follows_a_velocity_and_says_so() {
    let mut motor = running();
    assert_eq!(motor.ask(ID, &STATUS_2), ["241#9C19230064006200"]);
    assert_eq!(motor.events()[0], "command 0xA2 velocity");
    assert!(motor.events()[1].starts_with("moving"));
}

/// 0xA4, 360° at 500 degrees per second (RMD V3.6 §2.20.4).
#[test]
fn it_goes_to_a_position() {
    let mut motor = motor();
    motor.ask(ID, &[0xA4, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00]);
    motor.run_ms(3_000);
    assert_eq!(motor.ask(ID, &[0x92, 0, 0, 0, 0, 0, 0, 0]), ["241#92000000A08C0000"]);
    assert!(matches!(motor.last_event(), Some(MotorEvent::Stopped { .. })));
}

/// 0xA8, 180° at 500 degrees per second (RMD V3.6 §2.22), twice: each one moves it anew.
#[test]
fn it_goes_by_a_distance() {
    let mut motor = motor();
    for _ in 0..2 {
        assert!(
            motor.ask(ID, &[0xA8, 0x00, 0xF4, 0x01, 0x50, 0x46, 0x00, 0x00])[0]
                .starts_with("241#A819")
        );
        motor.run_ms(3_000);
    }
    assert_eq!(motor.ask(ID, &[0x92, 0, 0, 0, 0, 0, 0, 0]), ["241#92000000A08C0000"]);
}

/// 1 A (RMD V3.6 §2.17.4) sustains 5 rad/s.
#[test]
fn it_follows_a_current() {
    let mut motor = motor();
    motor.ask(ID, &[0xA1, 0, 0, 0, 0x64, 0x00, 0, 0]);
    motor.run_ms(3_000);
    motor.assert_speed(5.0);
}

const MOTION_ID: u16 = 0x401;
/// 1 rad at 50 N·m/rad and 5 N·m·s/rad: words 0x8A3D, 0x800, 0x19A, 0xFFF, 0x800 (RMD V3.6 §5.4).
const SPRING: [u8; 8] = [0x8A, 0x3D, 0x80, 0x01, 0x9A, 0xFF, 0xF8, 0x00];

/// The middle of each word is 0, so the first reply shows it: 0x8000, 0x800, 0x800 rounded up from
/// 2047.5.
#[test]
fn motion_mode_is_a_spring_and_a_damper() {
    let mut motor = motor();
    assert_eq!(motor.ask(MOTION_ID, &SPRING), ["501#0180008008000000"]);
    motor.run_ms(5_000);
    let position = motor.motor.position_rad();
    assert!((position - 1.0).abs() < 0.01, "{position} rad");
    assert!(motor.motor.speed_rad_s().abs() < 0.001);
    // The same spring, pushed by 10 N·m: 0.2 rad further.
    motor.ask(MOTION_ID, &[0x8A, 0x3D, 0x80, 0x01, 0x9A, 0xFF, 0xFB, 0x55]);
    motor.run_ms(5_000);
    let position = motor.motor.position_rad();
    assert!((position - 1.2).abs() < 0.02, "{position} rad");
    assert_eq!(motor.ask(0x402, &SPRING), [""; 0], "to another motor");
}

/// A stop, its own timeout and a fault end it as any other motion.
#[test]
fn motion_mode_ends_as_other_commands_do() {
    /// No gains, 5 N·m: word 0x9AB. It sustains 20 rad/s.
    const PUSH: [u8; 8] = [0x80, 0x00, 0x80, 0x00, 0x00, 0x00, 0x09, 0xAB];
    let mut motor = motor();
    motor.ask(ID, &TIMEOUT_1000);
    motor.keep_asking(MOTION_ID, &PUSH, 900);
    assert!(motor.motor.speed_rad_s() > 15.0);
    motor.ask(ID, &STOP);
    motor.run_ms(900);
    motor.assert_speed(0.0);

    motor.keep_asking(MOTION_ID, &PUSH, 900);
    motor.run_ms(4_000);
    motor.assert_speed(0.0);
    // The first command after the timeout is ignored; the reply shows the state, at rest.
    let replies = motor.ask(MOTION_ID, &PUSH);
    assert!(replies[0].starts_with("501#01") && replies[0].ends_with("8008000000"), "{replies:?}");
    motor.assert_speed(0.0);
    motor.keep_asking(MOTION_ID, &PUSH, 900);
    assert!(motor.motor.speed_rad_s() > 15.0);

    motor.inject(Injection::FaultBits(0x0004));
    motor.keep_asking(MOTION_ID, &PUSH, 2_000);
    motor.assert_speed(0.0);
}

#[test]
fn stop_is_faster_than_shutdown() {
    let stopped_after = |command: &[u8]| {
        let mut motor = running();
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
fn its_own_timeout_cuts_the_output_and_locks_the_brake() {
    let mut motor = with_brake();
    assert_eq!(motor.ask(ID, &TIMEOUT_1000), ["241#B3000000E8030000"]);
    assert_eq!(motor.motor.own_timeout(), Some(Duration::from_secs(1)));
    motor.keep_asking(ID, &SPEED_100, 2_000);
    motor.assert_speed(RAD_S_100);
    motor.run_ms(1_100);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &STATUS_1), ["241#9A190000E0010000"]);
    let events = motor.events();
    assert_eq!(events[5..7], ["own timeout after 1000 ms without a command", "brake locked"]);
}

/// Polls feed the timeout, too.
#[test]
fn polls_feed_the_timeout() {
    let mut motor = motor();
    motor.ask(ID, &TIMEOUT_1000);
    motor.ask(ID, &SPEED_100);
    motor.keep_asking(ID, &STATUS_2, 3_000);
    motor.assert_speed(RAD_S_100);
}

#[test]
fn after_its_timeout_it_sends_a_notice_every_second_until_a_command_comes() {
    let mut motor = motor();
    motor.ask(ID, &TIMEOUT_1000);
    assert_eq!(motor.run_ms(3_500), ["241#F1", "241#F1"]);
    motor.ask(ID, &STATUS_2);
    assert_eq!(motor.run_ms(900), [""; 0]);
}

/// A motion command echoed with its own bytes has not been executed; the second one is.
#[test]
fn after_its_timeout_the_first_command_is_echoed_and_ignored() {
    let mut motor = motor();
    motor.ask(ID, &TIMEOUT_1000);
    motor.run_ms(1_500);
    motor.ask(ID, &STATUS_2);
    assert_eq!(motor.ask(ID, &SPEED_100), ["241#A200000010270000"]);
    motor.run_ms(100);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &SPEED_100), ["241#A219000000000000"]);
    motor.run_ms(500);
    motor.assert_speed(RAD_S_100);
}

#[test]
fn a_stop_after_the_timeout_may_be_the_ignored_one() {
    let mut motor = motor();
    motor.ask(ID, &TIMEOUT_1000);
    motor.run_ms(1_500);
    assert_eq!(motor.ask(ID, &STOP), ["241#8100000000000000"]);
    assert_eq!(
        motor.events().last().unwrap(),
        "command 0x81 stop ignored: first after the timeout"
    );
}

/// 0x0004, under-voltage, is level 2: the motor resumes by itself. Read as RMD V3.6 §2.12.4 prints
/// it.
#[test]
fn it_resumes_by_itself_when_a_level_2_fault_has_gone() {
    let mut motor = running();
    motor.inject(Injection::FaultBits(0x0004));
    motor.run_ms(2_000);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &STATUS_1), ["241#9A190001E0010400"]);
    assert_eq!(motor.ask(ID, &SPEED_100), ["241#A200000010270000"], "echoed");
    motor.inject(Injection::FaultBits(0));
    motor.run_ms(1_000);
    motor.assert_speed(RAD_S_100);
}

#[test]
fn a_stop_during_the_fault_prevents_that() {
    let mut motor = running();
    motor.inject(Injection::FaultBits(0x0004));
    motor.ask(ID, &STOP);
    motor.inject(Injection::FaultBits(0));
    motor.run_ms(1_000);
    motor.assert_speed(0.0);
}

#[test]
fn a_level_1_fault_stays_until_a_restart() {
    let mut motor = running();
    motor.inject(Injection::StuckRotor(true));
    motor.run_ms(1_100);
    assert_eq!(motor.motor.fault_word(), 0x0002);
    motor.inject(Injection::StuckRotor(false));
    motor.run_ms(1_000);
    assert_eq!(motor.motor.fault_word(), 0x0002);
    motor.assert_speed(0.0);
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.motor.fault_word(), 0);
}

#[test]
fn the_brake_holds_and_takes_its_time_to_open() {
    let mut motor = with_brake();
    motor.ask(ID, &SPEED_100);
    motor.run_ms(1_000);
    motor.assert_speed(RAD_S_100);
    assert_eq!(motor.ask(ID, &[0x78, 0, 0, 0, 0, 0, 0, 0]), ["241#7800000000000000"]);
    motor.run_ms(100);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &RELEASE_BRAKE), [""; 0]);
    assert_eq!(motor.run_ms(45), [""; 0]);
    assert_eq!(motor.run_ms(110), ["241#7700000000000000"]);
}

/// RMD V3.6 §2.27: the brake is locked without power. §2.12: byte 3 is 1 once 0x77 has been carried
/// out.
#[test]
fn switched_on_its_brake_is_locked() {
    let mut motor = with_brake();
    assert_eq!(motor.ask(ID, &STATUS_1), ["241#9A190001E0010000"]);
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.ask(ID, &STATUS_1), ["241#9A190000E0010000"]);
    motor.ask(ID, &SPEED_100);
    motor.run_ms(500);
    motor.assert_speed(0.0);
    motor.inject(Injection::StuckBrake(true));
    motor.ask(ID, &RELEASE_BRAKE);
    assert_eq!(motor.run_ms(160), ["241#7700000000000000"]);
    assert_eq!(motor.ask(ID, &STATUS_1), ["241#9A190000E0010000"]);
}

#[test]
fn injections_spoil_the_answers() {
    let mut motor = running();
    motor.inject(Injection::IgnoreStop(true));
    assert_eq!(motor.ask(ID, &STOP), ["241#8100000000000000"]);
    motor.run_ms(500);
    motor.assert_speed(RAD_S_100);

    motor.inject(Injection::Mute(true));
    assert_eq!(motor.ask(ID, &STATUS_1), [""; 0]);
    motor.inject(Injection::Mute(false));
    motor.inject(Injection::LateReply(Duration::from_millis(7)));
    assert_eq!(motor.ask(ID, &SHUTDOWN), [""; 0]);
    assert_eq!(motor.run_ms(7), ["241#8000000000000000"]);
    motor.inject(Injection::LateReply(Duration::ZERO));
    motor.inject(Injection::Garbage(true));
    let garbage = motor.ask(ID, &SHUTDOWN);
    assert!(
        garbage[0].starts_with("241#")
            && garbage[0].len() == 20
            && garbage[0] != "241#8000000000000000"
    );
}

/// The frame known from a motor, and a reply whose checksum was computed apart: 25 °C at rest.
#[test]
fn on_rs485_it_speaks_in_frames_of_13_bytes() {
    let mut motor = TestMotor::new(Protocol::Rmd, 1, true);
    let request = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    let replies = motor.ask_serial(&request);
    assert_eq!(replies.len(), 1);
    assert!(replies[0].starts_with("3E01089C19000000000000"), "{replies:?}");

    motor.inject(Injection::WrongChecksum(true));
    let wrong = motor.ask_serial(&request);
    assert!(wrong[0][..24] == replies[0][..24] && wrong[0][24..] != replies[0][24..]);
}

#[test]
fn on_rs485_a_pause_ends_a_frame_begun() {
    let mut motor = TestMotor::new(Protocol::Rmd, 1, true);
    assert_eq!(motor.ask_serial(&[0x3E, 0x01, 0x08]), [""; 0]);
    let request = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    assert_eq!(motor.ask_serial(&request).len(), 1);
    // To another motor.
    assert_eq!(
        motor.ask_serial(&[0x3E, 0x02, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xB6, 0x30]),
        [""; 0]
    );
}

#[test]
fn it_may_echo_motion_and_still_stop() {
    let mut motor = running();
    motor.inject(Injection::IgnoreMotion(true));
    let other = [0xA2, 0, 0, 0, 0x20, 0x4E, 0x00, 0x00];
    assert_eq!(motor.ask(ID, &other), ["241#A2000000204E0000"]);
    motor.run_ms(500);
    motor.assert_speed(RAD_S_100);
    assert_eq!(motor.ask(ID, &STOP), ["241#8100000000000000"]);
    motor.run_ms(500);
    motor.assert_speed(0.0);
}

/// Bit 0x0004, low voltage, goes by itself (RMD V3.6 §8.1).
#[test]
fn it_may_resume_what_it_did_before_a_fault_although_it_was_stopped() {
    for resumes in [false, true] {
        let mut motor = running();
        motor.inject(Injection::ResumeAfterFault(resumes));
        motor.inject(Injection::FaultBits(0x0004));
        assert_eq!(motor.ask(ID, &STOP), ["241#8100000000000000"]);
        motor.run_ms(1_000);
        motor.assert_speed(0.0);
        motor.inject(Injection::FaultBits(0));
        motor.run_ms(1_000);
        motor.assert_speed(if resumes { RAD_S_100 } else { 0.0 });
        motor.ask(ID, &STOP);
        motor.run_ms(1_000);
        motor.assert_speed(0.0);
    }
}

#[test]
fn answers_get_lost_and_wander() {
    let mut motor = motor();
    motor.inject(Injection::LoseReplies(2));
    assert_eq!(motor.ask(ID, &STATUS_2), [""; 0]);
    assert_eq!(motor.ask(ID, &STATUS_2), [""; 0]);
    assert_eq!(motor.ask(ID, &STATUS_2).len(), 1);
    motor.inject(Injection::ReplyJitter(Duration::from_millis(20)));
    let late = (0..20).filter(|_| {
        let at_once = motor.ask(ID, &STATUS_2).len();
        assert_eq!(at_once + motor.run_ms(20).len(), 1);
        at_once == 0
    });
    assert!((1..20).contains(&late.count()), "some within 1 ms, some later");
}
