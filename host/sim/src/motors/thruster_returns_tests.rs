//! VM, SR, ML and MM in literal bytes (Thruster manual §2.1, §2.4, §2.5).

use host_protocol::Protocol;

use super::super::Injection;
use super::super::test_motor::TestMotor;

const ID: u16 = 0x30B;
const TC_0: [u8; 8] = [0x54, 0x43, 0, 0, 0, 0, 0x00, 0x00];
const TC_10: [u8; 8] = [0x54, 0x43, 0, 0, 0, 0, 0x00, 0x0A];
/// 300 rpm.
const VC_300: [u8; 8] = [0x56, 0x43, 0, 0, 0, 0, 0x01, 0x2C];
const QV: [u8; 4] = [0x51, 0x56, 0, 0];
const MQ: [u8; 4] = [0x4D, 0x51, 0, 0];
const MM: [u8; 4] = [0x4D, 0x4D, 0, 0];
const ML: [u8; 4] = [0x4D, 0x4C, 0, 0];

fn motor() -> TestMotor {
    TestMotor::new(Protocol::Thruster, 0x0B, false)
}

/// VM with its bytes 6 and 7, which it echoes.
fn set_to(flags: u8, frames: u8) -> TestMotor {
    let mut motor = motor();
    let vm = [0x56, 0x4D, 0, 0, 0, 0, flags, frames];
    assert_eq!(motor.ask(ID, &vm), [format!("28B#564D00000000{flags:02X}{frames:02X}")]);
    motor
}

/// 240: 24.0 V; 18 °C of motor and driver are 0x12.
#[test]
fn vm_returns_frames_with_a_header_instead_of_the_echo() {
    let mut motor = set_to(0, 1);
    assert_eq!(motor.ask(ID, &TC_0), ["28B#5401000000F00000"]);
    motor.ask(ID, &TC_10);
    motor.run_ms(1_000);
    // 300 rpm, 23.9 V, 1.6 A.
    assert_eq!(motor.ask(ID, &TC_10), ["28B#5401012C00EF0010"]);
    assert_eq!(motor.ask(ID, &VC_300), ["28B#5601012C00EF0010"]);
    assert_eq!(motor.ask(ID, &QV), ["28B#515600000000012C"]);
    let mut motor = set_to(0, 7);
    assert_eq!(
        motor.ask(ID, &TC_0),
        ["28B#5401000000F00000", "28B#5402000000120012", "28B#5403000000000000"]
    );
    // Bit 8, the driver is hot, in the status word.
    motor.inject(Injection::FaultBits(0x0100));
    assert_eq!(motor.ask(ID, &TC_0)[1], "28B#5402010000120012");
}

#[test]
fn vm_without_header_returns_one_frame_and_with_the_lowest_bit_none() {
    let mut motor = set_to(2, 7);
    assert_eq!(motor.ask(ID, &TC_0), ["28B#000000F000000000"]);
    let mut motor = set_to(1, 7);
    assert_eq!(motor.ask(ID, &TC_0), [""; 0]);
    assert_eq!(motor.ask(ID, &QV), ["28B#5156000000000000"]);
    // And back.
    motor.ask(ID, &[0x56, 0x4D, 0, 0, 0, 0, 0, 0]);
    assert_eq!(motor.ask(ID, &TC_0), ["28B#5443000000000000"]);
}

#[test]
fn a_refusal_has_its_header_in_every_mode() {
    for flags in [0, 2] {
        let mut motor = set_to(flags, 1);
        motor.inject(Injection::Refuse(true));
        assert_eq!(motor.ask(ID, &TC_0), ["28B#544300000000EEEE"]);
    }
}

/// SR: frames 1 and 2 every 250 ms, at once and after the next power-on; mask 0 ends it.
#[test]
fn sr_streams_at_once_and_after_a_power_cycle() {
    let mut motor = motor();
    let sr = [0x53, 0x52, 0, 0, 0, 3, 0, 250];
    assert_eq!(motor.ask(ID, &sr), ["28B#53520000000300FA"]);
    let once = ["28B#4101000000F00000", "28B#4102000000120012"];
    assert_eq!(motor.run_ms(998), [once, once, once].concat());
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.run_ms(1_000).len(), 8);
    motor.ask(ID, &[0x53, 0x52, 0, 0, 0, 0, 0, 250]);
    assert_eq!(motor.run_ms(1_000), [""; 0]);
}

/// ML every second, MM every 100 ms: current and speed, until MQ or the power ends it.
#[test]
fn ml_and_mm_send_current_and_speed_until_mq() {
    let mut motor = motor();
    let pair = ["28B#5143000000000000", "28B#5156000000000000"];
    assert_eq!(motor.ask(ID, &MM), ["28B#4D4D000000000000"]);
    assert_eq!(motor.run_ms(298), [pair, pair].concat());
    assert_eq!(motor.ask(ID, &ML), ["28B#4D4C000000000000"]);
    assert_eq!(motor.run_ms(2_100), [pair, pair].concat());
    assert_eq!(motor.ask(ID, &MQ), ["28B#4D51000000000000"]);
    assert_eq!(motor.run_ms(2_000), [""; 0]);
    motor.ask(ID, &MM);
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.run_ms(1_000), [""; 0]);
}

/// CI and CB act at the next power-on (Thruster manual §2.2).
#[test]
fn id_and_bitrate_change_with_the_next_power_on() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &[0x43, 0x49, 0, 0, 0, 0, 0, 0x7F]), ["28B#434900000000007F"]);
    assert_eq!(motor.ask(ID, &[0x43, 0x42, 0, 0, 0, 0, 0x03, 0xE8]), ["28B#43420000000003E8"]);
    let before = motor.motor.bitrate();
    assert_eq!(motor.ask(ID, &QV), ["28B#5156000000000000"]);
    motor.motor.power_cycle(motor.now);
    assert_eq!((before, motor.motor.bitrate()), (115_200, 1_000_000));
    assert_eq!(motor.ask(ID, &QV), [""; 0]);
    assert_eq!(motor.ask(0x37F, &QV), ["2FF#5156000000000000"]);
    // 128 is no id, 84 no rate.
    assert_eq!(motor.ask(0x37F, &[0x43, 0x49, 0, 0, 0, 0, 0, 0x80]), ["2FF#434900000000EEEE"]);
    assert_eq!(motor.ask(0x37F, &[0x43, 0x42, 0, 0, 0, 0, 0, 84]), ["2FF#434200000000EEEE"]);
}

/// SP and RP (Thruster manual §2.7): what is written is read.
#[test]
fn a_system_parameter_is_kept() {
    let mut motor = motor();
    let sp = [0x53, 0x50, 0x4D, 0x01, 0, 0, 0x12, 0x34];
    assert_eq!(motor.ask(ID, &sp), ["28B#53504D0100001234"]);
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.ask(ID, &[0x52, 0x50, 0x4D, 0x01]), ["28B#52504D0100001234"]);
}
