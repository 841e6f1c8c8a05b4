//! Position commands of a device with an encoder, in literal bytes (Thruster manual §4).

use host_protocol::Protocol;

use super::super::Injection;
use super::super::test_motor::TestMotor;

const ID: u16 = 0x30B;
/// 90.0° at 60 rpm.
const LA_90: [u8; 8] = [0x4C, 0x41, 0, 60, 0, 0, 0x03, 0x84];
const LR_90: [u8; 8] = [0x4C, 0x52, 0, 60, 0, 0, 0x03, 0x84];
const LS: [u8; 8] = [0x4C, 0x53, 0, 0, 0, 0, 0, 0];
const TC_0: [u8; 8] = [0x54, 0x43, 0, 0, 0, 0, 0, 0];
const QA: [u8; 4] = [0x51, 0x41, 0, 0];
const QR: [u8; 4] = [0x51, 0x52, 0, 0];
const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

fn motor() -> TestMotor {
    let mut motor = TestMotor::new(Protocol::Thruster, 0x0B, false);
    motor.inject(Injection::Encoder(true));
    motor
}

#[track_caller]
fn assert_at(motor: &TestMotor, rad: f64) {
    let position = motor.motor.position_rad();
    assert!((position - rad).abs() < 0.01, "{position} rad instead of {rad}");
}

/// §4.1: LA goes there and stays, QA reads it, AZ makes it the zero.
#[test]
fn la_goes_to_an_absolute_position() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &LA_90), ["28B#4C41003C00000384"]);
    motor.run_ms(4_000);
    assert_at(&motor, QUARTER);
    assert_eq!(motor.ask(ID, &QA), ["28B#5141000000000384"]);
    motor.ask(ID, &LA_90);
    motor.run_ms(1_000);
    assert_at(&motor, QUARTER);
    assert_eq!(motor.ask(ID, &[0x41, 0x5A, 0, 0, 0, 0, 0, 0]), ["28B#415A000000000000"]);
    assert_eq!(motor.ask(ID, &QA), ["28B#5141000000000000"]);
    motor.ask(ID, &LA_90);
    motor.run_ms(4_000);
    assert_at(&motor, 2.0 * QUARTER);
}

/// §4.1: speed 0 does not start; what lies beyond the limits of SPLA is not executed.
#[test]
fn la_with_speed_0_or_beyond_the_limits_moves_nothing() {
    let mut motor = motor();
    motor.ask(ID, &[0x4C, 0x41, 0, 0, 0, 0, 0x03, 0x84]);
    // −45.0° to 45.0°
    let spla = [0x53, 0x50, 0x4C, 0x41, 0xFE, 0x3E, 0x01, 0xC2];
    assert_eq!(motor.ask(ID, &spla), ["28B#53504C41FE3E01C2"]);
    assert_eq!(motor.ask(ID, &[0x52, 0x50, 0x4C, 0x41]), ["28B#52504C41FE3E01C2"]);
    assert_eq!(motor.ask(ID, &LA_90), ["28B#4C41003C00000384"]);
    motor.run_ms(2_000);
    assert_at(&motor, 0.0);
    assert_eq!(motor.ask(ID, &QA), ["28B#5141000000000000"]);
    // The limits outlast the power.
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.ask(ID, &[0x52, 0x50, 0x4C, 0x41]), ["28B#52504C41FE3E01C2"]);
}

/// §4.2: each LR adds to the target, unless its speed is 0; RZ and RC make here the zero.
#[test]
fn each_lr_moves_on() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &LR_90), ["28B#4C52003C00000384"]);
    motor.ask(ID, &LR_90);
    motor.ask(ID, &[0x4C, 0x52, 0, 0, 0, 0, 0x03, 0x84]);
    motor.run_ms(6_000);
    assert_at(&motor, 2.0 * QUARTER);
    assert_eq!(motor.ask(ID, &QR), ["28B#5152000000000708"]);
    assert_eq!(motor.ask(ID, &[0x52, 0x5A, 0, 0, 0, 0, 0, 0]), ["28B#525A000000000000"]);
    assert_eq!(motor.ask(ID, &QR), ["28B#5152000000000000"]);
    motor.ask(ID, &LR_90);
    motor.run_ms(4_000);
    assert_at(&motor, 3.0 * QUARTER);
    assert_eq!(motor.ask(ID, &[0x52, 0x43, 0, 0, 0, 0, 0, 0]), ["28B#5243000000000000"]);
    assert_eq!(motor.ask(ID, &QR), ["28B#5152000000000000"]);
}

/// Whether TC 0 ends a move the manual leaves open: this device goes on until LS (§4.3).
#[test]
fn ls_ends_a_move_and_tc_0_does_not() {
    let mut motor = motor();
    motor.ask(ID, &LA_90);
    motor.run_ms(50);
    motor.ask(ID, &TC_0);
    motor.run_ms(50);
    assert!(motor.motor.speed_rad_s() > 1.0, "{}", motor.motor.speed_rad_s());
    assert_eq!(motor.ask(ID, &LS), ["28B#4C53000000000000"]);
    motor.run_ms(1_000);
    motor.assert_speed(0.0);
    assert!(motor.motor.position_rad() < QUARTER - 0.1);
}

/// §3, bit 7: without its encoder it takes no position command; its own timeout ends a move (§2.3).
#[test]
fn a_broken_encoder_and_the_timeout_end_a_move() {
    let mut motor = motor();
    motor.ask(ID, &LA_90);
    motor.run_ms(50);
    motor.inject(Injection::FaultBits(0x80));
    motor.run_ms(2_000);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &LA_90), ["28B#4C41003C0000EEEE"]);
    motor.inject(Injection::FaultBits(0));
    motor.ask(ID, &[0x43, 0x46, 0, 0]);
    // 100 ms
    motor.ask(ID, &[0x53, 0x54, 0, 0, 0, 0, 0, 100]);
    motor.ask(ID, &[0x4C, 0x41, 0, 1, 0, 0, 0x06, 0x40]);
    motor.run_ms(2_000);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &[0x45, 0x46, 0, 0]), ["28B#4546000000000800"]);
}

#[test]
fn without_an_encoder_every_position_command_is_refused() {
    let mut motor = TestMotor::new(Protocol::Thruster, 0x0B, false);
    assert_eq!(motor.ask(ID, &LA_90), ["28B#4C41003C0000EEEE"]);
    assert_eq!(motor.ask(ID, &[0x41, 0x5A, 0, 0, 0, 0, 0, 0]), ["28B#415A00000000EEEE"]);
}
