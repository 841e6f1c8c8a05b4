//! Each command with the bytes of its section, and what it does to the motor.

use host_protocol::Protocol;

use super::super::Injection;
use super::super::test_motor::TestMotor;

const ID: u16 = 0x141;
/// 0xA2, 100 degrees per second (RMD V3.6 §2.18.4).
const SPEED_100: [u8; 8] = [0xA2, 0, 0, 0, 0x10, 0x27, 0x00, 0x00];
const RESTART: [u8; 8] = [0x76, 0, 0, 0, 0, 0, 0, 0];

fn motor() -> TestMotor {
    TestMotor::new(Protocol::Rmd, 1, false)
}

fn bare(command: u8) -> [u8; 8] {
    [command, 0, 0, 0, 0, 0, 0, 0]
}

fn read(motor: &mut TestMotor, command: u8) -> String {
    motor.ask(ID, &bare(command)).join(" ")
}

fn restart(motor: &mut TestMotor) {
    assert_eq!(motor.ask(ID, &RESTART), [""; 0]);
    motor.run_ms(1_600);
}

/// RMD V3.6 §2.1 to §2.3: 0x31 is lost with a restart, 0x32 is not.
#[test]
fn gains_are_written_to_ram_and_to_rom() {
    let mut motor = motor();
    assert_eq!(read(&mut motor, 0x30), "241#3000551955195519");
    assert_eq!(motor.ask(ID, &[0x31, 0, 1, 2, 3, 4, 5, 6]), ["241#3100010203040506"]);
    assert_eq!(read(&mut motor, 0x30), "241#3000010203040506");
    restart(&mut motor);
    assert_eq!(read(&mut motor, 0x30), "241#3000551955195519");
    assert_eq!(motor.ask(ID, &[0x32, 0, 6, 5, 4, 3, 2, 1]), ["241#3200060504030201"]);
    motor.motor.power_cycle(motor.now);
    assert_eq!(read(&mut motor, 0x30), "241#3000060504030201");
}

/// RMD V3.6 §2.4, §2.5: 10000 dps/s; index 2 is the acceleration of speeds.
#[test]
fn accelerations_are_stored_and_act() {
    let mut motor = motor();
    assert_eq!(motor.ask(ID, &[0x43, 0, 0, 0, 0x10, 0x27, 0, 0]), ["241#4300000010270000"]);
    assert_eq!(read(&mut motor, 0x42), "241#4200000010270000");
    // 100 dps/s: half a second to 50 dps.
    motor.ask(ID, &[0x43, 2, 0, 0, 0x64, 0, 0, 0]);
    motor.ask(ID, &SPEED_100);
    motor.run_ms(500);
    let speed = motor.motor.speed_rad_s().to_degrees();
    assert!((speed - 50.0).abs() < 2.0, "{speed} dps");
    motor.motor.power_cycle(motor.now);
    assert_eq!(read(&mut motor, 0x42), "241#4200000010270000");
}

/// RMD V3.6 §2.6 to §2.10: 0x60 = 0x61 − 0x62. A turn is 65536 pulses here; 90° are 16384 = 0x4000.
#[test]
fn a_zero_point_acts_after_a_restart() {
    let mut motor = motor();
    motor.ask(ID, &[0xA4, 0, 0xF4, 0x01, 0x28, 0x23, 0, 0]); // 90°
    motor.run_ms(3_000);
    let encoder = |motor: &mut TestMotor| [0x60, 0x61, 0x62].map(|command| read(motor, command));
    let before = ["241#6000000000400000", "241#6100000000400000", "241#6200000000000000"];
    assert_eq!(encoder(&mut motor), before);
    assert_eq!(read(&mut motor, 0x64), "241#6400000000400000");
    assert_eq!(encoder(&mut motor), before);
    restart(&mut motor);
    assert_eq!(encoder(&mut motor), ["241#6000000000000000", before[1], "241#6200000000400000"]);
    assert_eq!(read(&mut motor, 0x92), "241#9200000000000000");
    // A target counts from the new zero: the shaft goes on to 180°.
    motor.ask(ID, &[0xA4, 0, 0xF4, 0x01, 0x28, 0x23, 0, 0]);
    motor.run_ms(3_000);
    assert_eq!(read(&mut motor, 0x92), "241#9200000028230000");
    assert!((motor.motor.position_rad() - std::f64::consts::PI).abs() < 1e-3);
    // §2.9.4: 10000 pulses.
    assert_eq!(motor.ask(ID, &[0x63, 0, 0, 0, 0x10, 0x27, 0, 0]), ["241#6300000010270000"]);
    assert_eq!(read(&mut motor, 0x62), "241#6200000000400000");
    restart(&mut motor);
    assert_eq!(read(&mut motor, 0x62), "241#6200000010270000");
}

/// RMD V3.6 §2.33.4, indexes 1 and 4.
#[test]
fn turns_are_lost_with_the_power_unless_they_are_saved() {
    for saves in [false, true] {
        let mut motor = motor();
        if saves {
            assert_eq!(motor.ask(ID, &[0x20, 4, 0, 0, 1, 0, 0, 0]), ["241#2004000001000000"]);
        }
        motor.ask(ID, &[0xA4, 0, 0xF4, 0x01, 0xC8, 0xAF, 0, 0]); // 450°
        motor.run_ms(3_000);
        assert_eq!(read(&mut motor, 0x92), "241#92000000C8AF0000");
        motor.motor.power_cycle(motor.now);
        let known = if saves { "241#92000000C8AF0000" } else { "241#9200000028230000" }; // 90°
        assert_eq!(read(&mut motor, 0x92), known);
    }
    let mut motor = motor();
    motor.ask(ID, &[0xA4, 0, 0xF4, 0x01, 0xC8, 0xAF, 0, 0]);
    motor.run_ms(3_000);
    assert_eq!(motor.ask(ID, &[0x20, 1, 0, 0, 0, 0, 0, 0]), ["241#2001000000000000"]);
    assert_eq!(read(&mut motor, 0x92), "241#92000000C8AF0000");
    restart(&mut motor);
    assert_eq!(read(&mut motor, 0x92), "241#9200000000000000");
}

/// RMD V3.6 §2.14, §2.23, §2.24: 1 A; 47.9 V × 1 A.
#[test]
fn it_tells_its_phases_its_mode_and_its_power() {
    let mut motor = motor();
    assert_eq!(read(&mut motor, 0x70), "241#7000000000000000");
    motor.ask(ID, &[0xA1, 0, 0, 0, 0x64, 0, 0, 0]);
    motor.run_ms(1_000);
    assert_eq!(read(&mut motor, 0x9D), "241#9D196400CEFFCEFF");
    assert_eq!(read(&mut motor, 0x70), "241#7000000000000001");
    assert_eq!(read(&mut motor, 0x71), "241#710000000000DF01");
    for (data, mode) in [(SPEED_100, 2), ([0xA4, 0, 0xF4, 1, 0, 0, 0, 0], 3)] {
        motor.ask(ID, &data);
        assert_eq!(read(&mut motor, 0x70), format!("241#70000000000000{mode:02X}"));
    }
}

/// RMD V3.6 §2.19.4 and §2.21: 360°, as fast as the motor can, and at 500 dps.
#[test]
fn it_follows_an_angle() {
    for (data, at_100_ms) in [
        ([0xA3, 0, 0, 0, 0xA0, 0x8C, 0, 0], 100.0..400.0),
        ([0xA5, 0, 0x50, 0xC3, 0xA0, 0x8C, 0, 0], 20.0..51.0),
    ] {
        let mut motor = motor();
        let replies = motor.ask(ID, &data);
        assert_eq!(replies, [format!("241#{:02X}19000000000000", data[0])]);
        motor.run_ms(100);
        let degrees = motor.motor.position_rad().to_degrees();
        assert!(at_100_ms.contains(&degrees), "{degrees}° after 100 ms");
        motor.run_ms(3_000);
        assert_eq!(read(&mut motor, 0x92), "241#92000000A08C0000");
    }
}

/// RMD V3.6 §2.25, §2.28: no reply, silence, and a run time that begins again.
#[test]
fn a_restart_takes_a_while_and_is_seen_by_the_run_time() {
    let mut motor = motor();
    motor.inject(Injection::FaultBits(0x0002));
    motor.inject(Injection::FaultBits(0));
    motor.run_ms(9_000 - 1);
    // 9000 ms = 0x2328.
    assert_eq!(read(&mut motor, 0xB1), "241#B100000027230000");
    assert_eq!(motor.motor.fault_word(), 0x0002);
    motor.ask(ID, &RESTART);
    assert_eq!(motor.events().last().unwrap(), "no fault any more");
    assert_eq!(motor.run_ms(700), [""; 0]);
    assert_eq!(read(&mut motor, 0x9A), "");
    motor.run_ms(900);
    let time = read(&mut motor, 0xB1);
    let low = u32::from_str_radix(&time[12..14], 16).unwrap()
        + 256 * u32::from_str_radix(&time[14..16], 16).unwrap();
    assert!(low < 900, "{time}");
}

/// RMD V3.6 §2.29.4, §2.32.4.
#[test]
fn it_tells_its_version_and_its_model() {
    let mut motor = motor();
    assert_eq!(read(&mut motor, 0xB2), "241#B20000002E893401");
    assert_eq!(read(&mut motor, 0xB5), "241#B558385332563130");
}

/// RMD V3.6 §2.31: code 0 is 500 kbit/s on CAN, when it is switched on again.
#[test]
fn another_rate_acts_when_it_is_switched_on_again() {
    let mut motor = motor();
    let before = motor.motor.bitrate();
    assert!(motor.ask(ID, &[0xB4, 0, 0, 0, 0, 0, 0, 0])[0].starts_with("241#B4"));
    assert_eq!(motor.motor.bitrate(), before);
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.motor.bitrate(), 500_000);
}

/// RMD V3.6 §2.33.4, indexes 2 and 3.
#[test]
fn it_filters_what_goes_to_all_and_reports_errors() {
    let mut motor = motor();
    assert_eq!(motor.ask(0x280, &bare(0x9A)), ["241#9A190001E0010000"]);
    motor.ask(ID, &[0x20, 2, 0, 0, 1, 0, 0, 0]);
    assert_eq!(motor.ask(0x280, &bare(0x9A)), [""; 0]);
    motor.ask(ID, &[0x20, 3, 0, 0, 1, 0, 0, 0]);
    motor.inject(Injection::FaultBits(0x0004));
    let reports = motor.run_ms(250);
    assert_eq!(reports, ["241#9A190001E0010400"; 3]);
    motor.inject(Injection::FaultBits(0));
    assert_eq!(motor.run_ms(250), [""; 0]);
}

/// RMD V3.6 §4.4: 0x300; every motor there takes the id.
#[test]
fn it_takes_another_can_id() {
    let mut motor = motor();
    assert_eq!(motor.ask(0x300, &[0x79, 0, 1, 0, 0, 0, 0, 0]), ["300#7900010000004102"]);
    assert_eq!(motor.ask(0x300, &[0x79, 0, 0, 0, 0, 0, 0, 2]), ["300#7900000000000002"]);
    assert_eq!(motor.ask(ID, &bare(0x9A)), [""; 0]);
    assert_eq!(motor.ask(0x142, &bare(0x9A)), ["242#9A190001E0010000"]);
    motor.motor.power_cycle(motor.now);
    assert_eq!(motor.ask(0x142, &bare(0x9A)), ["242#9A190001E0010000"]);
}

/// RMD V3.6 §7.4: under id 0xCD.
#[test]
fn it_takes_another_rs485_id() {
    let mut motor = TestMotor::new(Protocol::Rmd, 1, true);
    let read_id = [0x3E, 0xCD, 0x08, 0x79, 0, 1, 0, 0, 0, 0, 0, 0xF8, 0x95];
    let set_2 = [0x3E, 0xCD, 0x08, 0x79, 0, 0, 0, 0, 0, 0, 2, 0x78, 0x85];
    assert!(motor.ask_serial(&read_id)[0].starts_with("3ECD08790001000000"));
    assert_eq!(motor.ask_serial(&set_2), ["3ECD0879000000000000027885"]);
    let to_2 = [0x3E, 0x02, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0x02, 0x3F];
    assert!(motor.ask_serial(&to_2)[0].starts_with("3E02089C19"));
}

/// RMD V3.6 §8.2: a motion against the locked brake ends in a stall, which lasts until a restart.
#[test]
fn against_its_brake_it_stalls() {
    let mut motor = motor();
    motor.inject(Injection::Brake(true));
    motor.ask(ID, &SPEED_100);
    motor.run_ms(1_200);
    assert_eq!(motor.motor.fault_word(), 0x0002);
    assert!(motor.motor.position_rad().abs() < 1e-6);
    motor.ask(ID, &bare(0x80));
    motor.run_ms(5_000);
    assert_eq!(motor.motor.fault_word(), 0x0002);
    restart(&mut motor);
    assert_eq!(motor.motor.fault_word(), 0);
}
