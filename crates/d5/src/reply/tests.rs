//! Literal bytes of replies.

use super::*;
use crate::{Register, TurnDegrees, Value};

fn both_ways(bytes: [u8; 5], reply: Reply) {
    assert_eq!(Reply::decode(&Payload(bytes)), Ok(reply));
    assert_eq!(reply.encode(), Ok(Payload(bytes)));
}

/// D5 manual, table rows 1 and 6.
#[test]
fn replies_with_fixed_bytes() {
    both_ways([0x05, 0x01, 0xCC, 0xCC, 0xCC], Reply::Id);
    both_ways([0x05, 0x00, 0xFF, 0xFF, 0xFF], Reply::ResetDone);
    let odd = Reply::decode(&Payload([0x05, 0x01, 0xCC, 0xCD, 0xCC]));
    assert_eq!(odd, Err(DecodeError::FixedByte { offset: 5, got: 0xCD, expected: 0xCC }));
}

/// D5 manual, table rows 7 to 13.
#[test]
fn replies_with_a_register() {
    let register = Register::ACCELERATION;
    both_ways([0x05, 0x02, 0x15, 0x48, 0x48], Reply::Read { register, value: Value::Word(0x4848) });
    both_ways([0x04, 0x02, 0x15, 0x48, 0x00], Reply::Read { register, value: Value::Byte(0x48) });
    let speed = Register::SPEED;
    both_ways(
        [0x05, 0x03, 0x20, 0x11, 0x11],
        Reply::Written { register: speed, value: Value::Word(0x1111) },
    );
    let waits = Reply::AsyncWritten { register: speed, value: Value::Word(0x040B) };
    both_ways([0x05, 0x04, 0x20, 0x0B, 0x04], waits);
    // Repeats the stored write, here the upper half of the speed, with command 05.
    let executed = Reply::Executed { register: Register(0x21), value: Value::Byte(0x84) };
    both_ways([0x04, 0x05, 0x21, 0x84, 0x00], executed);
}

/// D5 manual, table rows 3 to 5, with commands the codec names and others.
#[test]
fn errors_come_with_any_command() {
    for command in [0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0xCE, 0xCF, 0xD4, 0xFF] {
        both_ways(
            [0x05, command, 0x01, 0xEE, 0xEE],
            Reply::Error { error: MotorError::Id, command },
        );
        both_ways(
            [0x05, command, 0x03, 0xEE, 0xEE],
            Reply::Error { error: MotorError::Command, command },
        );
        both_ways(
            [0x05, command, 0x07, 0xEE, 0xEE],
            Reply::Error { error: MotorError::Checksum, command },
        );
    }
}

/// D5 manual, table rows 3 to 5: only these addresses, only two data bytes; elsewhere EE EE is a
/// value.
#[test]
fn ee_ee_elsewhere_is_a_value() {
    let speed = Reply::Read { register: Register::CURRENT_SPEED, value: Value::Word(0xEEEE) };
    both_ways([0x05, 0x02, 0x26, 0xEE, 0xEE], speed);
    both_ways(
        [0x04, 0x02, 0x03, 0xEE, 0x00],
        Reply::Read { register: Register::ID, value: Value::Byte(0xEE) },
    );
    let error = Reply::Read { register: Register::ID, value: Value::Word(0xEEEE) }.encode();
    assert!(matches!(error, Err(EncodeError::Forbidden { field: "command", value: 0x02, .. })));
}

/// D5 manual, table row 14: 353°, from address 57.
#[test]
fn magnetic_angle() {
    both_ways([0x05, 0xD4, 0x57, 0x61, 0x01], Reply::MagneticAngle { angle: TurnDegrees(353) });
    let odd = Reply::decode(&Payload([0x05, 0xD4, 0x56, 0x61, 0x01]));
    assert_eq!(odd, Err(DecodeError::FixedByte { offset: 4, got: 0x56, expected: 0x57 }));
}

/// D5 manual, table row 5: the command exists, its reply is not printed.
#[test]
fn the_reply_to_a_self_test_is_kept_whole() {
    for bytes in [[0x05, 0xCF, 0x12, 0x34, 0x56], [0x04, 0xCF, 0x00, 0x01, 0x00]] {
        both_ways(bytes, Reply::SelfTest { raw: Payload(bytes) });
    }
}

/// Commands that the manual does not have keep their bytes.
#[test]
fn other_commands_keep_their_bytes() {
    let bytes = [0x05, 0xAA, 0x57, 0x61, 0x01];
    both_ways(bytes, Reply::Unknown { raw: Payload(bytes) });
    let named = Reply::Unknown { raw: Payload([0x05, 0x02, 0x15, 0x48, 0x48]) }.encode();
    assert!(matches!(named, Err(EncodeError::Forbidden { field: "command", value: 0x02, .. })));
}
