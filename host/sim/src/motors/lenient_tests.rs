//! Literal bytes that a strict motor ignores and a lenient one obeys.

use host_protocol::Protocol;

use super::super::Injection;
use super::super::test_motor::TestMotor;

fn commands(protocol: Protocol, id: u16, data: &[u8], lenient: bool) -> Vec<String> {
    let mut motor = TestMotor::new(protocol, 0x0B, false);
    motor.inject(Injection::Lenient(lenient));
    motor.ask(id, data);
    motor.events()
}

#[test]
fn frames_of_can_that_only_a_lenient_motor_obeys() {
    for (protocol, id, data, command) in [
        // A velocity without its last byte, and the shutdown without all that is unused.
        (Protocol::Rmd, 0x14B, &[0xA2, 0, 0, 0, 0x10, 0x27, 0][..], "command 0xA2 velocity"),
        (Protocol::Rmd, 0x280, &[0x80], "command 0x80 shutdown"),
        (Protocol::Rmd, 0x40B, &[0x80, 0x00, 0x80, 0x00, 0, 0, 9], "command motion mode"),
        // A parameter, an upper half and bytes of a bare command that the manual does not use; a
        // value cut off.
        (Protocol::Thruster, 0x30B, b"TC\x07\x07\0\0\0\0", "command TC 0"),
        (Protocol::Thruster, 0x30B, b"VC\0\0\x01\0\0\0", "command VC 0"),
        (Protocol::Thruster, 0x30B, b"TC", "command TC 0"),
        (Protocol::Thruster, 0x30B, b"LS\x01\x02\x03", "command LS emergency stop"),
        // Speed: a wrong checksum, another length. Execute with an address.
        (Protocol::D5, 0x00B, &[0xD5, 0x0B, 5, 3, 0x20, 0x58, 0x02, 0xFF], "command 03 speed"),
        (Protocol::D5, 0x00B, &[0xD5, 0x0B, 9, 3, 0x20, 0x58, 0x02], "command 03 speed"),
        (Protocol::D5, 0x00B, &[0xD5, 0x0B, 4, 5, 0x20, 1, 2, 0x37], "command 05 execute"),
    ] {
        assert_eq!(commands(protocol, id, data, false), [""; 0], "{data:02X?}");
        assert_eq!(commands(protocol, id, data, true)[0], command, "{data:02X?}");
    }
}

#[test]
fn what_is_for_another_motor_or_no_command_at_all_stays_so() {
    for (protocol, id, data) in [
        (Protocol::Rmd, 0x142, &[0xA2, 0, 0, 0, 0x10, 0x27][..]),
        (Protocol::Thruster, 0x30C, b"TC"),
        (Protocol::Thruster, 0x30B, b"T"),
        (Protocol::D5, 0x00B, &[0xD5, 0x0C, 5, 3, 0x20, 0x58, 0x02, 0xFF]),
        (Protocol::D5, 0x00B, &[0x5D, 0x0B, 5, 3, 0x20, 0x58, 0x02, 0x8D]),
    ] {
        assert!(
            commands(protocol, id, data, true).iter().all(|event| event == "command other"),
            "{data:02X?}"
        );
    }
}

/// What a strict motor obeys a lenient one obeys no differently.
#[test]
fn frames_of_the_manuals_mean_the_same() {
    for (protocol, id, data) in [
        (Protocol::Rmd, 0x14B, &[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0][..]),
        (Protocol::Thruster, 0x30B, b"ST\0\0\0\0\x03\xE8"),
        (Protocol::Thruster, 0x30B, b"QV\0\0"),
        (Protocol::Thruster, 0x30B, b"TC\0\0\xFF\xFF\xFF\xF6"),
        (Protocol::D5, 0x00B, &[0xD5, 0x0B, 5, 3, 0x20, 0x58, 0x02, 0x8D]),
        (Protocol::D5, 0x00B, &[0xD5, 0x0B, 4, 3, 0x11, 1, 0, 0x24]),
        (Protocol::D5, 0x00B, &[0xD5, 0x0B, 5, 2, 0x26, 0, 0, 0x38]),
    ] {
        let replies = |lenient| {
            let mut motor = TestMotor::new(protocol, 0x0B, false);
            motor.inject(Injection::Lenient(lenient));
            (motor.ask(id, data), motor.events())
        };
        assert_eq!(replies(true), replies(false), "{data:02X?}");
        assert!(!replies(true).0.is_empty());
    }
}

/// A velocity of 100 degrees per second to RMD 1 (RMD V3.6 §2.18.4), with a pause of 1 ms before
/// its last four bytes.
#[test]
fn a_pause_in_a_frame_on_rs485_is_none_to_a_lenient_motor() {
    let begun = [0x3E, 0x01, 0x08, 0xA2, 0x00, 0x00, 0x00, 0x10, 0x27];
    let rest = [0x00, 0x00, 0xC4, 0x63];
    for (lenient, replies) in [(false, 0), (true, 1)] {
        let mut motor = TestMotor::new(Protocol::Rmd, 1, true);
        motor.inject(Injection::Lenient(lenient));
        motor.ask_serial(&begun);
        assert_eq!(motor.ask_serial(&rest).len(), replies);
    }
}
