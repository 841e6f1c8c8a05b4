use host_protocol::Protocol;

use super::super::Injection;
use super::super::MotorEvent;
use super::super::test_motor::TestMotor;

const ID: u16 = 0x30B;
const TC_0: [u8; 8] = [0x54, 0x43, 0, 0, 0, 0, 0x00, 0x00];
const TC_10: [u8; 8] = [0x54, 0x43, 0, 0, 0, 0, 0x00, 0x0A];
const EF: [u8; 4] = [0x45, 0x46, 0, 0];
const FR: [u8; 4] = [0x46, 0x52, 0, 0];
const QV: [u8; 4] = [0x51, 0x56, 0, 0];
/// 5 s (Thruster manual §2.3).
const ST_5000: [u8; 8] = [0x53, 0x54, 0, 0, 0, 0, 0x13, 0x88];
/// 10 % of 3000 rpm.
const RAD_S_10: f64 = 31.415_93;

fn motor() -> TestMotor {
    TestMotor::new(Protocol::Thruster, 0x0B, false)
}

/// A thruster that has been running at 10 % for a second.
fn running() -> TestMotor {
    let mut motor = motor();
    motor.ask(ID, &TC_0);
    motor.ask(ID, &TC_10);
    motor.run_ms(1_000);
    motor.assert_speed(RAD_S_10);
    motor
}

/// Thruster manual §1.3: the command is repeated; −5 % are −150 rpm.
#[test]
fn it_repeats_what_it_takes() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &TC_0), ["28B#5443000000000000"]);
    assert_eq!(motor.ask(ID, &[0x54, 0x43, 0, 0, 0, 0, 0xFF, 0xFB]), ["28B#544300000000FFFB"]);
    motor.run_ms(1_000);
    assert_eq!(motor.ask(ID, &QV), ["28B#515600000000FF6A"]);
    assert_eq!(motor.ask(0x30C, &QV), [""; 0]);
}

#[test]
fn it_answers_every_query() {
    let mut motor = running();
    assert_eq!(motor.ask(ID, &QV), ["28B#515600000000012C"]);
    // 1.6 A, 23.9 V, 18 °C twice.
    assert_eq!(motor.ask(ID, &[0x51, 0x43, 0, 0]), ["28B#5143000000000010"]);
    assert_eq!(motor.ask(ID, &[0x51, 0x50, 0, 0]), ["28B#51500000000000EF"]);
    assert_eq!(motor.ask(ID, &[0x51, 0x54, 0, 0]), ["28B#5154000000000012"]);
    assert_eq!(motor.ask(ID, &[0x45, 0x51, 0, 0]), ["28B#4551000000000012"]);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000000"]);
    assert_eq!(motor.ask(ID, &FR), ["28B#4652000000000000"]);
}

/// Bit 10, zero protection: shown until the signal has been zero.
#[test]
fn it_does_not_start_before_the_signal_has_been_zero() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &TC_10), ["28B#544300000000EEEE"]);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000400"]);
    motor.run_ms(500);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &TC_0), ["28B#5443000000000000"]);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000000"]);
    assert_eq!(motor.ask(ID, &TC_10), ["28B#544300000000000A"]);
    motor.run_ms(1_000);
    motor.assert_speed(RAD_S_10);
}

/// Bit 11: EF shows it once, the record keeps it.
#[test]
fn its_own_timeout_stops_it_and_shows_once() {
    let mut motor = running();
    assert_eq!(motor.ask(ID, &ST_5000), ["28B#5354000000001388"]);
    motor.run_ms(4_900);
    motor.assert_speed(RAD_S_10);
    motor.run_ms(1_500);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000800"]);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000000"]);
    assert_eq!(motor.ask(ID, &FR), ["28B#4652000000000800"]);
    assert_eq!(
        motor.events().iter().filter(|line| line.starts_with("own timeout after 5000 ms")).count(),
        1
    );
    // Zero has to come first again.
    assert_eq!(motor.ask(ID, &TC_10), ["28B#544300000000EEEE"]);
}

#[test]
fn any_other_query_hides_the_timeout() {
    let mut motor = running();
    motor.ask(ID, &ST_5000);
    motor.run_ms(6_000);
    motor.ask(ID, &QV);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000000"]);
    assert_eq!(motor.ask(ID, &FR), ["28B#4652000000000800"]);
}

#[test]
fn it_may_run_on_at_the_first_poll_after_its_timeout() {
    let mut motor = running();
    motor.inject(Injection::ResumeAfterTimeout(true));
    motor.ask(ID, &ST_5000);
    motor.run_ms(6_000);
    motor.assert_speed(0.0);
    motor.ask(ID, &QV);
    motor.run_ms(1_000);
    motor.assert_speed(RAD_S_10);
}

/// Bit 6, stall, until CF.
#[test]
fn a_stall_refuses_every_signal_until_it_is_cleared() {
    let mut motor = running();
    motor.inject(Injection::StuckRotor(true));
    motor.run_ms(1_100);
    motor.inject(Injection::StuckRotor(false));
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000040"]);
    assert_eq!(motor.ask(ID, &TC_0), ["28B#544300000000EEEE"]);
    assert_eq!(motor.ask(ID, &[0x43, 0x46, 0, 0]), ["28B#4346000000000000"]);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000000"]);
    assert_eq!(motor.ask(ID, &TC_0), ["28B#5443000000000000"]);
}

/// Bits 3 and 4 are only reported, bit 8 limits the output.
#[test]
fn some_faults_only_report_or_limit() {
    let mut motor = running();
    motor.inject(Injection::FaultBits(0x0018));
    motor.run_ms(500);
    motor.assert_speed(RAD_S_10);
    motor.inject(Injection::FaultBits(0x0100));
    motor.run_ms(1_000);
    motor.assert_speed(RAD_S_10 / 2.0);
    motor.inject(Injection::FaultBits(0));
    assert_eq!(motor.ask(ID, &FR), ["28B#4652000000000118"]);
}

#[test]
fn what_the_manual_does_not_allow_is_refused() {
    let mut motor = running();
    assert_eq!(motor.ask(ID, &[0x54, 0x43, 0, 0, 0, 0, 0, 101]), ["28B#544300000000EEEE"]);
    assert_eq!(motor.ask(ID, &[0x56, 0x43, 0, 0, 0, 0, 0, 29]), ["28B#564300000000EEEE"]);
    assert_eq!(motor.ask(ID, &[0x53, 0x54, 0, 0, 0, 0, 0, 99]), ["28B#535400000000EEEE"]);
    assert_eq!(motor.ask(ID, &[0x4C, 0x41, 0, 0x1E, 0, 0, 0, 0]), ["28B#4C41001E0000EEEE"]);
    motor.run_ms(100);
    motor.assert_speed(RAD_S_10);
}

#[test]
fn the_emergency_stop_stops() {
    let mut motor = running();
    assert_eq!(motor.ask(ID, &[0x4C, 0x53, 0, 0, 0, 0, 0, 0]), ["28B#4C53000000000000"]);
    motor.run_ms(1_000);
    motor.assert_speed(0.0);
    assert!(matches!(motor.last_event(), Some(MotorEvent::Stopped { .. })));
}

#[test]
fn it_may_refuse_without_a_fault_or_take_a_signal_and_not_follow() {
    let mut motor = running();
    motor.inject(Injection::Refuse(true));
    assert_eq!(motor.ask(ID, &TC_0), ["28B#544300000000EEEE"]);
    assert_eq!(motor.ask(ID, &EF), ["28B#4546000000000000"]);
    motor.run_ms(500);
    motor.assert_speed(RAD_S_10);
    motor.inject(Injection::Refuse(false));
    motor.inject(Injection::IgnoreMotion(true));
    motor.ask(ID, &TC_0);
    assert_eq!(motor.ask(ID, &TC_10), ["28B#544300000000000A"]);
    motor.run_ms(1_000);
    motor.assert_speed(0.0);
}
