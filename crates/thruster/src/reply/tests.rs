//! Literal bytes of replies.

use super::*;
use crate::{Deciamps, Decidegrees, Decivolts, Faults, LimitDecidegrees, Rpm, RpmLimit};

/// Thruster manual §1.3: the printed refusal of TC; any set command can be refused so.
#[test]
fn set_commands_can_be_refused() {
    let frames: [([u8; 8], u16, u16); 18] = [
        ([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5443, 0),
        ([0x56, 0x43, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5643, 0),
        ([0x43, 0x46, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4346, 0),
        ([0x4D, 0x51, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4D51, 0),
        ([0x4D, 0x4C, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4D4C, 0),
        ([0x4D, 0x4D, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4D4D, 0),
        ([0x43, 0x49, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4349, 0),
        ([0x43, 0x42, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4342, 0),
        ([0x53, 0x54, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5354, 0),
        ([0x56, 0x4D, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x564D, 0),
        ([0x53, 0x52, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5352, 0),
        ([0x53, 0x50, 0x4C, 0x41, 0x00, 0x00, 0xEE, 0xEE], 0x5350, 0x4C41),
        ([0x4C, 0x41, 0x01, 0x2C, 0x00, 0x00, 0xEE, 0xEE], 0x4C41, 300),
        ([0x41, 0x5A, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x415A, 0),
        ([0x4C, 0x52, 0x01, 0x2C, 0x00, 0x00, 0xEE, 0xEE], 0x4C52, 300),
        ([0x52, 0x5A, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x525A, 0),
        ([0x52, 0x43, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5243, 0),
        ([0x4C, 0x53, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4C53, 0),
    ];
    for (bytes, command, parameter) in frames {
        let reply = Reply::Refused { command, parameter };
        assert_eq!(Reply::decode(&bytes), Ok(reply));
        assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
    }
}

/// Thruster manual §1.3 prints refusals of set commands only: −4370 rpm is a measured speed like
/// any other.
#[test]
fn queries_are_never_refused() {
    let bytes = [0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE];
    let reply = Reply::MeasuredSpeed { speed: Rpm(-4370) };
    assert_eq!(Reply::decode(&bytes), Ok(reply));
    assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
    let refused = Reply::Refused { command: 0x5156, parameter: 0 }.encode();
    assert!(matches!(refused, Err(EncodeError::Forbidden { field: "command", value: 0x5156, .. })));
}

/// Thruster manual §1.3: all four bytes count; a sign-extended −4370 is an echo.
#[test]
fn a_refusal_has_a_zero_upper_half() {
    let bytes = [0x56, 0x43, 0x00, 0x00, 0xFF, 0xFF, 0xEE, 0xEE];
    assert_eq!(Reply::decode(&bytes), Ok(Reply::Speed { speed: Rpm(-4370) }));
    assert!(Reply::Speed { speed: Rpm(-4370) }.encode().is_err());
}

/// Thruster manual §2.6: bit 14 is reserved and kept.
#[test]
fn fault_record_keeps_reserved_bits() {
    let bytes = [0x46, 0x52, 0x00, 0x00, 0x00, 0x00, 0x40, 0x12];
    let reply = Reply::decode(&bytes).unwrap();
    let Reply::FaultRecord { faults } = reply else { panic!("{reply:?}") };
    assert!(faults.contains(Faults::EE_DATA | Faults::UNDER_VOLTAGE));
    assert_eq!(faults.bits(), 0x4012);
    assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
}

/// Thruster manual §2.1: dA and dV; the current is signed, the voltage is not.
#[test]
fn current_is_signed_and_voltage_is_not() {
    let current = [0x51, 0x43, 0x00, 0x00, 0x00, 0x00, 0xFF, 0x9C];
    assert_eq!(Reply::decode(&current), Ok(Reply::Current { current: Deciamps(-100) }));
    let voltage = [0x51, 0x50, 0x00, 0x00, 0x00, 0x00, 0xFF, 0x9C];
    assert_eq!(Reply::decode(&voltage), Ok(Reply::Voltage { voltage: Decivolts(65_436) }));
    let extended = [0x51, 0x50, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0x9C];
    assert_eq!(Reply::decode(&extended), Err(DecodeError::UpperHalf { got: 0xFFFF }));
}

/// Thruster manual §4.1: a 32-bit position, negative ones included.
#[test]
fn measured_position_has_32_bits() {
    let bytes = [0x51, 0x41, 0x00, 0x00, 0xFF, 0xFF, 0xFC, 0x7C];
    let reply = Reply::MeasuredPosition { position: Decidegrees(-900) };
    assert_eq!(Reply::decode(&bytes), Ok(reply));
    assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
}

/// The reply to CF and LS is not drawn: with and without data.
#[test]
fn bare_replies_come_short_or_full() {
    let full = [0x43, 0x46, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00];
    assert_eq!(Reply::decode(&full), Ok(Reply::FaultsCleared));
    assert_eq!(Reply::decode(&[0x43, 0x46, 0x00, 0x00]), Ok(Reply::FaultsCleared));
    assert_eq!(Reply::FaultsCleared.encode(), Ok(Payload::Full(full)));
    assert_eq!(Reply::decode(&[0x4C, 0x53, 0x00, 0x00]), Ok(Reply::EmergencyStop));
}

/// Thruster manual §1.3: the reply to a query carries data.
#[test]
fn a_query_reply_without_data_is_refused() {
    let short = Reply::decode(&[0x51, 0x56, 0x00, 0x00]);
    assert_eq!(short, Err(DecodeError::Length { got: 4, expected: 8 }));
}

/// Thruster manual §2.4, §2.5: reserved bits of an echo stay, they come from the device.
#[test]
fn echoes_keep_reserved_bits() {
    for bytes in [
        [0x56, 0x4D, 0x00, 0x00, 0x00, 0x00, 0x84, 0x09],
        [0x53, 0x52, 0x00, 0x00, 0x00, 0x81, 0x00, 0x64],
    ] {
        let reply = Reply::decode(&bytes).unwrap();
        assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
    }
}

/// Thruster manual §4.1, §4.2: positions and limits.
#[test]
fn limits_are_two_words_and_positions_one_long() {
    let limits =
        Reply::PositionLimits { reverse: LimitDecidegrees(-900), forward: LimitDecidegrees(455) };
    let bytes = [0x52, 0x50, 0x4C, 0x41, 0xFC, 0x7C, 0x01, 0xC7];
    assert_eq!(Reply::decode(&bytes), Ok(limits));
    assert_eq!(limits.encode(), Ok(Payload::Full(bytes)));
    let position = Reply::MeasuredRelativePosition { position: Decidegrees(86_400) };
    let bytes = [0x51, 0x52, 0x00, 0x00, 0x00, 0x01, 0x51, 0x80];
    assert_eq!(Reply::decode(&bytes), Ok(position));
    assert_eq!(position.encode(), Ok(Payload::Full(bytes)));
    let stray = Reply::decode(&[0x51, 0x52, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00]);
    assert_eq!(stray, Err(DecodeError::FixedByte { offset: 3, got: 1, expected: 0 }));
}

/// Thruster manual §1.3: an echo must not look like a refusal; the value of RP may.
#[test]
fn echoes_do_not_look_like_refusals() {
    let relative =
        Reply::RelativePosition { speed: RpmLimit(1), position: Decidegrees(61_166) }.encode();
    assert!(matches!(relative, Err(EncodeError::Forbidden { field: "position", .. })));
    let set = Reply::ParameterSet { parameter: 0x4D01, data: [0, 0, 0xEE, 0xEE] }.encode();
    assert!(matches!(set, Err(EncodeError::Forbidden { field: "data", .. })));
    let value = Reply::Parameter { parameter: 0x4D01, data: [0, 0, 0xEE, 0xEE] };
    let bytes = [0x52, 0x50, 0x4D, 0x01, 0x00, 0x00, 0xEE, 0xEE];
    assert_eq!(Reply::decode(&bytes), Ok(value));
    assert_eq!(value.encode(), Ok(Payload::Full(bytes)));
}

/// Thruster manual §2.7: what it does not name keeps its bytes.
#[test]
fn other_replies_keep_their_bytes() {
    let payload = Payload::Full([0x5A, 0x5A, 0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A]);
    assert_eq!(Reply::decode(payload.as_slice()), Ok(Reply::Unknown { payload }));
    assert_eq!(Reply::Unknown { payload }.encode(), Ok(payload));
    let named = Payload::Full([0x54, 0x01, 0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A]);
    let refused = Reply::Unknown { payload: named }.encode();
    assert!(matches!(refused, Err(EncodeError::Forbidden { field: "command", value: 0x5401, .. })));
}
