use host_protocol::Protocol;

use super::super::Injection;
use super::super::MotorEvent;
use super::super::test_motor::TestMotor;

const ID: u16 = 0x0B;
/// 600 °/s counter-clockwise (D5 manual, common commands, row 2): 10.472 rad/s.
const SPEED_600: [u8; 8] = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D];
const RAD_S_600: f64 = 10.471_98;
const SPEED_0: [u8; 8] = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x00, 0x00, 0x33];
const READ_SPEED: [u8; 8] = [0xD5, 0x0B, 0x05, 0x02, 0x26, 0x00, 0x00, 0x38];
const EXECUTE: [u8; 8] = [0xD5, 0x0B, 0x05, 0x05, 0x00, 0x00, 0x00, 0x15];

fn motor() -> TestMotor {
    TestMotor::new(Protocol::D5, 0x0B, false)
}

/// A motor that has been running at 600 °/s for a second.
fn running() -> TestMotor {
    let mut motor = motor();
    motor.keep_asking(ID, &SPEED_600, 1_000);
    motor.assert_speed(RAD_S_600);
    motor
}

/// D5 manual, common commands, rows 2 and 3: the write is repeated with header 5D; the top bit
/// means clockwise.
#[test]
fn it_follows_a_speed_in_both_directions() {
    let mut motor = running();
    assert_eq!(motor.ask(ID, &SPEED_600), ["00B#5D0B05032058028D"]);
    assert_eq!(motor.ask(ID, &READ_SPEED), ["00B#5D0B050226580292"]);
    let clockwise = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x82, 0x0D];
    assert_eq!(motor.ask(ID, &clockwise), ["00B#5D0B05032058820D"]);
    motor.keep_asking(ID, &clockwise, 1_000);
    motor.assert_speed(-RAD_S_600);
    assert_eq!(motor.ask(ID, &READ_SPEED), ["00B#5D0B050226588212"]);
}

/// D5 manual, table rows 7 and 8: the acceleration registers read 48 48, or 48 alone.
#[test]
fn it_reads_one_register_or_two() {
    let mut motor = motor();
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x02, 0x15, 0, 0, 0x27]),
        ["00B#5D0B0502154848B7"]
    );
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x04, 0x02, 0x15, 0, 0, 0x26]),
        ["00B#5D0B04021548006E"]
    );
}

/// The travelled angle is two's complement, the magnetic angle 0 to 360, under command D4.
#[test]
fn it_counts_the_angle() {
    let mut motor = motor();
    let clockwise = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x1E, 0x80, 0xD1];
    motor.keep_asking(ID, &clockwise, 2_000);
    // −59°: 30 °/s for two seconds and a moment to get there.
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x02, 0x28, 0, 0, 0x3A]),
        ["00B#5D0B050228C5FFFE"]
    );
    // 301°
    assert_eq!(motor.ask(ID, &[0xD5, 0x0B, 0x05, 0xD4, 0, 0, 0, 0xE4]), ["00B#5D0B05D4572D0169"]);
}

/// 18 rad/s² of deceleration would take 0.6 s; 72 × 2π take a few hundredths, then the loop
/// settles.
#[test]
fn speed_0_stops_it() {
    let mut motor = running();
    motor.ask(ID, &SPEED_0);
    motor.run_ms(300);
    motor.assert_speed(0.0);
    assert!(matches!(motor.last_event(), Some(MotorEvent::Stopped { .. })));
}

#[test]
fn its_own_timeout_stops_it_unless_switched_off() {
    let mut motor = running();
    motor.run_ms(1_500);
    motor.assert_speed(0.0);
    assert!(motor.events().contains(&"own timeout after 1000 ms without a command".into()));

    let off = [0xD5, 0x0B, 0x04, 0x03, 0x11, 0x00, 0x00, 0x23];
    assert_eq!(motor.ask(ID, &off), ["00B#5D0B040311000023"]);
    motor.ask(ID, &SPEED_600);
    motor.run_ms(3_000);
    motor.assert_speed(RAD_S_600);
}

/// Level 1 answers reads only, level 0 nothing at all; both obey.
#[test]
fn the_ack_level_decides_what_is_answered() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &[0xD5, 0x0B, 0x04, 0x03, 0x10, 0x01, 0x00, 0x23]), [""; 0]);
    assert_eq!(motor.ask(ID, &SPEED_600), [""; 0]);
    motor.keep_asking(ID, &SPEED_600, 500);
    motor.assert_speed(RAD_S_600);
    assert_eq!(motor.ask(ID, &READ_SPEED).len(), 1);

    motor.ask(ID, &[0xD5, 0x0B, 0x04, 0x03, 0x10, 0x00, 0x00, 0x22]);
    assert_eq!(motor.ask(ID, &READ_SPEED), [""; 0]);
    assert_eq!(motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x01, 0, 0, 0, 0x11]), [""; 0]);
}

/// D5 manual, table rows 11 and 13: the write waits, shows in 0x2C, and is repeated with command
/// 05.
#[test]
fn an_asynchronous_write_waits_for_its_execute() {
    let mut motor = motor();
    let flag = [0xD5, 0x0B, 0x04, 0x02, 0x2C, 0, 0, 0x3D];
    let prepare = [0xD5, 0x0B, 0x05, 0x04, 0x20, 0x58, 0x02, 0x8E];
    assert_eq!(motor.ask(ID, &prepare), ["00B#5D0B05042058028E"]);
    assert_eq!(motor.ask(ID, &flag), ["00B#5D0B04022C01003E"]);
    motor.run_ms(100);
    motor.assert_speed(0.0);
    assert_eq!(motor.ask(ID, &EXECUTE), ["00B#5D0B05052058028F"]);
    motor.run_ms(400);
    motor.assert_speed(RAD_S_600);
    assert_eq!(motor.ask(ID, &flag), ["00B#5D0B04022C00003D"]);
}

/// One slot: speed 0 overwrites what waits, so that a later broadcast execute does nothing.
#[test]
fn a_second_asynchronous_write_replaces_the_first() {
    let mut motor = motor();
    motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x04, 0x20, 0x58, 0x02, 0x8E]);
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x04, 0x20, 0, 0, 0x34]),
        ["00B#5D0B050420000034"]
    );
    assert_eq!(motor.ask(0xFE, &[0xD5, 0xFE, 0x05, 0x05, 0, 0, 0, 0x08]), [""; 0], "broadcast");
    motor.run_ms(300);
    motor.assert_speed(0.0);
}

/// D5 manual, table rows 3 to 5.
#[test]
fn it_complains_about_checksum_command_and_id() {
    let mut motor = motor();
    motor.ask(ID, &READ_SPEED);
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7A]),
        ["00B#5D0B050207EEEEF5"],
        "with the command of the request before"
    );
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x05, 0xCE, 0x12, 0x34, 0x56, 0x7A]),
        ["00B#5D0B05CE03EEEEBD"]
    );
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0C, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7C]),
        ["00B#5D0B05CF01EEEEBC"]
    );
}

/// D5 manual, common commands, row 1, and table row 6. That the CAN id is that of the motor, before
/// and after, is an assumption.
#[test]
fn a_new_id_answers_at_once_and_a_reset_takes_it_back() {
    let mut motor = motor();
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x23]),
        ["00D#5D0D0503030D0025"]
    );
    assert_eq!(motor.ask(ID, &[0xD5, 0x0D, 0x05, 0x01, 0, 0, 0, 0x13]), [""; 0]);
    assert_eq!(motor.ask(0x0D, &[0xD5, 0x0D, 0x05, 0x06, 0, 0, 0, 0x18]), ["00B#5D0B0500FFFFFF0D"]);
    assert_eq!(motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x01, 0, 0, 0, 0x11]), ["00B#5D0B0501CCCCCC75"]);
}

#[test]
fn a_stall_stays_until_register_19_clears_it() {
    let mut motor = running();
    motor.inject(Injection::StuckRotor(true));
    motor.keep_asking(ID, &SPEED_600, 1_200);
    motor.inject(Injection::StuckRotor(false));
    let status = [0xD5, 0x0B, 0x04, 0x02, 0x12, 0, 0, 0x23];
    assert_eq!(motor.ask(ID, &status), ["00B#5D0B040212400063"]);
    motor.run_ms(100);
    motor.assert_speed(0.0);
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x04, 0x03, 0x19, 0x01, 0, 0x2C]),
        ["00B#5D0B04031901002C"]
    );
    assert_eq!(motor.ask(ID, &status), ["00B#5D0B040212000023"]);
}

#[test]
fn read_only_registers_are_not_written() {
    let mut motor = motor();
    assert_eq!(
        motor.ask(ID, &[0xD5, 0x0B, 0x05, 0x03, 0x26, 0x58, 0x02, 0x93]),
        ["00B#5D0B050303EEEEF2"]
    );
}

#[test]
fn a_wrong_checksum_can_be_injected() {
    let mut motor = motor();
    motor.inject(Injection::WrongChecksum(true));
    assert_eq!(motor.ask(ID, &READ_SPEED), ["00B#5D0B0502260000C7"]);
}

#[test]
fn it_may_answer_a_speed_and_not_follow() {
    let mut motor = motor();
    motor.inject(Injection::IgnoreMotion(true));
    motor.keep_asking(ID, &SPEED_600, 500);
    assert_eq!(motor.ask(ID, &SPEED_600), ["00B#5D0B05032058028D"]);
    motor.assert_speed(0.0);
}
