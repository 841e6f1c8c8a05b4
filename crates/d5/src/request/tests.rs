//! Literal bytes of requests.

use super::*;
use crate::{Register, Value, Width};

fn both_ways(bytes: [u8; 5], request: Request) {
    assert_eq!(Request::decode(&Payload(bytes)), Ok(request));
    assert_eq!(request.encode(), Ok(Payload(bytes)));
}

/// D5 manual, table rows 2, 6 and 13.
#[test]
fn commands_without_a_register() {
    both_ways([0x05, 0x01, 0x00, 0x00, 0x00], Request::QueryId);
    both_ways([0x05, 0x05, 0x00, 0x00, 0x00], Request::Execute);
    both_ways([0x05, 0x06, 0x00, 0x00, 0x00], Request::Reset);
}

/// D5 manual, table rows 7 and 8.
#[test]
fn reads_of_two_bytes_and_of_one() {
    let register = Register::ACCELERATION;
    both_ways([0x05, 0x02, 0x15, 0x00, 0x00], Request::Read { register, width: Width::Word });
    both_ways([0x04, 0x02, 0x15, 0x00, 0x00], Request::Read { register, width: Width::Byte });
}

/// D5 manual, table rows 9, 10 and 11.
#[test]
fn writes_of_two_bytes_and_of_one() {
    let speed = Request::Write { register: Register::SPEED, value: Value::Word(0x1111) };
    both_ways([0x05, 0x03, 0x20, 0x11, 0x11], speed);
    let delay = Request::Write { register: Register::REPLY_DELAY, value: Value::Byte(0x22) };
    both_ways([0x04, 0x03, 0x05, 0x22, 0x00], delay);
    let later = Request::AsyncWrite { register: Register::SPEED, value: Value::Word(0x040B) };
    both_ways([0x05, 0x04, 0x20, 0x0B, 0x04], later);
}

/// D5 manual, table row 12 writes half of the speed: understood, not sent.
#[test]
fn half_a_word_is_decoded_and_not_encoded() {
    let half = Request::AsyncWrite { register: Register(0x21), value: Value::Byte(0x84) };
    assert_eq!(Request::decode(&Payload([0x04, 0x04, 0x21, 0x84, 0x00])), Ok(half));
    assert!(matches!(
        half.encode(),
        Err(EncodeError::Forbidden { field: "register", value: 0x21, .. })
    ));
}

/// D5 manual, frame format: the length byte is 4 or 5, and with 4 the upper data byte is empty.
#[test]
fn odd_bytes_are_named() {
    for (bytes, error) in [
        ([0x03, 0x03, 0x10, 0x01, 0x00], DecodeError::Length { got: 3, expected: 5 }),
        ([0x06, 0xD4, 0x00, 0x00, 0x00], DecodeError::Length { got: 6, expected: 5 }),
        ([0x04, 0x03, 0x10, 0x01, 0x07], DecodeError::FixedByte { offset: 6, got: 7, expected: 0 }),
        ([0x05, 0x02, 0x20, 0x07, 0x00], DecodeError::FixedByte { offset: 5, got: 7, expected: 0 }),
        (
            [0x05, 0x05, 0x20, 0x00, 0x00],
            DecodeError::FixedByte { offset: 4, got: 0x20, expected: 0 },
        ),
        ([0x04, 0x06, 0x00, 0x00, 0x00], DecodeError::FixedByte { offset: 2, got: 4, expected: 5 }),
    ] {
        assert_eq!(Request::decode(&Payload(bytes)), Err(error));
    }
}

/// D5 manual, table row 14.
#[test]
fn magnetic_angle() {
    both_ways([0x05, 0xD4, 0x00, 0x00, 0x00], Request::ReadMagneticAngle);
    let odd = Request::decode(&Payload([0x05, 0xD4, 0x57, 0x00, 0x00]));
    assert_eq!(odd, Err(DecodeError::FixedByte { offset: 4, got: 0x57, expected: 0 }));
}

/// D5 manual, table rows 3 to 5: CF is the self test, CE the spoilt one.
#[test]
fn self_tests_have_fixed_bytes() {
    both_ways([0x05, 0xCF, 0x12, 0x34, 0x56], Request::SelfTest);
    both_ways([0x05, 0xCE, 0x12, 0x34, 0x56], Request::FaultySelfTest);
    let odd = Request::decode(&Payload([0x05, 0xCF, 0x12, 0x34, 0x57]));
    assert_eq!(odd, Err(DecodeError::FixedByte { offset: 6, got: 0x57, expected: 0x56 }));
}

/// Commands that the manual does not have keep their bytes.
#[test]
fn other_commands_keep_their_bytes() {
    for bytes in
        [[0x05, 0xAA, 0x00, 0x00, 0x00], [0x05, 0xCE, 0x12, 0x34, 0x57], [0x04, 0x07, 1, 2, 3]]
    {
        both_ways(bytes, Request::Unknown { raw: Payload(bytes) });
    }
}

/// D5 manual, register table: raw bytes do not write a read-only register either.
#[test]
fn raw_bytes_do_not_go_around_the_table() {
    for bytes in
        [[0x05, 0x03, 0x26, 0x00, 0x00], [0x05, 0x05, 0x01, 0x00, 0x00], [0x07, 0xD4, 0, 0, 0]]
    {
        let result = Request::Unknown { raw: Payload(bytes) }.encode();
        assert!(matches!(result, Err(EncodeError::Forbidden { field: "command", .. })));
    }
}
