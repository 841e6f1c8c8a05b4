//! Literal bytes of requests.

use super::*;
use crate::{
    Decidegrees, Kilobits, LimitDecidegrees, Milliseconds, Percent, ReturnFlags, ReturnFrames, Rpm,
    RpmLimit,
};

fn encoded(request: Request) -> Payload {
    request.encode().unwrap()
}

/// Thruster manual §1.3: the printed TC frames of +5 % and −5 %.
#[test]
fn signal_has_a_zero_upper_half_even_when_negative() {
    let plus = Payload::Full([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0x00, 0x05]);
    let minus = Payload::Full([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFB]);
    assert_eq!(encoded(Request::Signal { signal: Percent(5) }), plus);
    assert_eq!(encoded(Request::Signal { signal: Percent(-5) }), minus);
    assert_eq!(Request::decode(minus.as_slice()), Ok(Request::Signal { signal: Percent(-5) }));
}

/// Thruster manual §1.3 leaves the upper half open: a sign extension is accepted, anything else is
/// named.
#[test]
fn upper_half_is_zero_or_a_sign_extension() {
    let extended = [0x54, 0x43, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFB];
    assert_eq!(Request::decode(&extended), Ok(Request::Signal { signal: Percent(-5) }));
    let odd = [0x56, 0x43, 0x00, 0x00, 0x00, 0x01, 0x00, 0x64];
    assert_eq!(Request::decode(&odd), Err(DecodeError::UpperHalf { got: 1 }));
}

/// Thruster manual §2.3: 60000 needs all 16 bits, so the word is never sign-extended.
#[test]
fn timeout_is_unsigned() {
    let longest = Payload::Full([0x53, 0x54, 0x00, 0x00, 0x00, 0x00, 0xEA, 0x60]);
    let request = Request::SetTimeout { timeout: Milliseconds(60_000) };
    assert_eq!(encoded(request), longest);
    assert_eq!(Request::decode(longest.as_slice()), Ok(request));
    let extended = [0x53, 0x54, 0x00, 0x00, 0xFF, 0xFF, 0xEA, 0x60];
    assert_eq!(Request::decode(&extended), Err(DecodeError::UpperHalf { got: 0xFFFF }));
}

/// Thruster manual §2.3.
#[test]
fn timeout_is_off_or_within_its_range() {
    let off = Payload::Full([0x53, 0x54, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]);
    assert_eq!(encoded(Request::SetTimeout { timeout: Milliseconds(0) }), off);
    assert!(Request::SetTimeout { timeout: Milliseconds(100) }.encode().is_ok());
    for ms in [1, 99, 60_001, 0xEEEE, u16::MAX] {
        let refused = EncodeError::OutOfRange {
            field: "timeout",
            value: i64::from(ms),
            min: 100,
            max: 60_000,
        };
        assert_eq!(Request::SetTimeout { timeout: Milliseconds(ms) }.encode(), Err(refused));
    }
}

/// Thruster manual §2.1.
#[test]
fn signal_beyond_full_is_refused() {
    for signal in [100, -100] {
        assert!(Request::Signal { signal: Percent(signal) }.encode().is_ok());
    }
    for signal in [101, -101, i16::MAX, i16::MIN] {
        let refused = EncodeError::OutOfRange {
            field: "signal",
            value: i64::from(signal),
            min: -100,
            max: 100,
        };
        assert_eq!(Request::Signal { signal: Percent(signal) }.encode(), Err(refused));
    }
}

/// Thruster manual §2.1; VC −4370 would be the bytes of a refusal.
#[test]
fn speed_below_30_rpm_and_the_refusal_pattern_are_refused() {
    for speed in [0, 30, -30, i16::MAX, i16::MIN] {
        assert!(Request::Speed { speed: Rpm(speed) }.encode().is_ok());
    }
    for speed in [1, -1, 29, -29, -4370] {
        let result = Request::Speed { speed: Rpm(speed) }.encode();
        assert!(
            matches!(result, Err(EncodeError::Forbidden { field: "speed", value, .. }) if value == i64::from(speed))
        );
    }
}

/// Thruster manual §4.1.
#[test]
fn absolute_position_has_speed_then_a_32_bit_position() {
    let request = Request::AbsolutePosition { speed: RpmLimit(300), position: Decidegrees(-1799) };
    let bytes = [0x4C, 0x41, 0x01, 0x2C, 0xFF, 0xFF, 0xF8, 0xF9];
    assert_eq!(encoded(request), Payload::Full(bytes));
    assert_eq!(Request::decode(&bytes), Ok(request));
    for position in [1800, -1800] {
        let request =
            Request::AbsolutePosition { speed: RpmLimit(1), position: Decidegrees(position) };
        let refused = EncodeError::OutOfRange {
            field: "position",
            value: i64::from(position),
            min: -1799,
            max: 1799,
        };
        assert_eq!(request.encode(), Err(refused));
    }
}

/// Thruster manual §1.2: four bytes are sent, eight zero-padded ones accepted.
#[test]
fn queries_come_short_or_zero_padded() {
    assert_eq!(encoded(Request::ReadSpeed), Payload::Short([0x51, 0x56, 0x00, 0x00]));
    let padded = [0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00];
    assert_eq!(Request::decode(&padded), Ok(Request::ReadSpeed));
    let stray = [0x51, 0x56, 0x00, 0x00, 0x00, 0x07, 0x00, 0x00];
    let error = DecodeError::FixedByte { offset: 5, got: 7, expected: 0 };
    assert_eq!(Request::decode(&stray), Err(error));
}

/// Thruster manual §4.3: eight bytes are sent, four accepted.
#[test]
fn emergency_stop_is_drawn_with_eight_bytes() {
    let full = Payload::Full([0x4C, 0x53, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]);
    assert_eq!(encoded(Request::EmergencyStop), full);
    assert_eq!(Request::decode(full.as_slice()), Ok(Request::EmergencyStop));
    assert_eq!(Request::decode(&[0x4C, 0x53, 0x00, 0x00]), Ok(Request::EmergencyStop));
}

/// Thruster manual §1.2; the nine-byte rows are misprints.
#[test]
fn other_lengths_are_refused() {
    for len in [0, 1, 3, 5, 7] {
        let bytes = [0x54, 0x43, 0, 0, 0, 0, 0, 5];
        let result = Request::decode(bytes.get(..len).unwrap());
        assert_eq!(result, Err(DecodeError::Length { got: len, expected: 8 }));
    }
    let nine = [0x43, 0x49, 0, 0, 0, 0, 0, 0, 0x7F];
    assert_eq!(Request::decode(&nine), Err(DecodeError::Length { got: 9, expected: 8 }));
    let short_signal = [0x54, 0x43, 0x00, 0x00];
    assert_eq!(Request::decode(&short_signal), Err(DecodeError::Length { got: 4, expected: 8 }));
}

/// Thruster manual §1.3: bytes 2–3 are zero where a command has no sub-command.
#[test]
fn a_stray_sub_command_is_named() {
    let stray = [0x54, 0x43, 0x00, 0x02, 0x00, 0x00, 0x00, 0x05];
    let error = DecodeError::FixedByte { offset: 3, got: 2, expected: 0 };
    assert_eq!(Request::decode(&stray), Err(error));
}

/// Thruster manual §2.1: MQ, ML and MM carry no data.
#[test]
fn modes_carry_no_data() {
    for (bytes, request) in [
        ([0x4D, 0x51, 0x00, 0x00], Request::RequestMode),
        ([0x4D, 0x4C, 0x00, 0x00], Request::LowSpeedMode),
        ([0x4D, 0x4D, 0x00, 0x00], Request::MediumSpeedMode),
    ] {
        assert_eq!(encoded(request), Payload::Short(bytes));
        assert_eq!(Request::decode(&bytes), Ok(request));
        let [c0, c1, p0, p1] = bytes;
        assert_eq!(Request::decode(&[c0, c1, p0, p1, 0, 0, 0, 0]), Ok(request));
    }
}

/// Thruster manual §2.2: the printed rows, without the `00` too many.
#[test]
fn id_and_bitrate() {
    let id = Payload::Full([0x43, 0x49, 0x00, 0x00, 0x00, 0x00, 0x00, 0x7F]);
    assert_eq!(encoded(Request::SetId { id: 127 }), id);
    assert_eq!(Request::decode(id.as_slice()), Ok(Request::SetId { id: 127 }));
    for id in [0, 128, 0x37F, 0xEEEE] {
        let refused =
            EncodeError::OutOfRange { field: "id", value: i64::from(id), min: 1, max: 127 };
        assert_eq!(Request::SetId { id }.encode(), Err(refused));
    }
    let bitrate = Payload::Full([0x43, 0x42, 0x00, 0x00, 0x00, 0x00, 0x03, 0xE8]);
    let request = Request::SetBitrate { bitrate: Kilobits(1000) };
    assert_eq!(encoded(request), bitrate);
    assert_eq!(Request::decode(bitrate.as_slice()), Ok(request));
    let refused = Request::SetBitrate { bitrate: Kilobits(1001) }.encode();
    assert!(matches!(refused, Err(EncodeError::Forbidden { field: "bitrate", value: 1001, .. })));
}

/// Thruster manual §2.4: the bit table of bytes 6 and 7, not the sentence above it.
#[test]
fn return_format_follows_the_bit_table() {
    let bytes = [0x56, 0x4D, 0x00, 0x00, 0x00, 0x00, 0x02, 0x05];
    let (flags, frames) = (ReturnFlags::NO_HEADER, ReturnFrames::MOTION | ReturnFrames::POSITION);
    let request = Request::ConfigureReturn { flags, frames };
    assert_eq!(encoded(request), Payload::Full(bytes));
    assert_eq!(Request::decode(&bytes), Ok(request));
    let reserved = Request::decode(&[0x56, 0x4D, 0x00, 0x00, 0x00, 0x00, 0x84, 0x01]).unwrap();
    let Request::ConfigureReturn { flags, .. } = reserved else { panic!("{reserved:?}") };
    assert_eq!(flags.bits(), 0x84);
    assert!(matches!(
        reserved.encode(),
        Err(EncodeError::Forbidden { field: "flags", value: 0x84, .. })
    ));
}

/// Thruster manual §2.5: frames in byte 5, the interval in bytes 6–7. No frame and 61166 ms look
/// like a refusal.
#[test]
fn stream_has_frames_and_an_interval() {
    let bytes = [0x53, 0x52, 0x00, 0x00, 0x00, 0x03, 0x13, 0x88];
    let frames = ReturnFrames::MOTION | ReturnFrames::CONDITION;
    let request = Request::ConfigureStream { frames, interval: Milliseconds(5000) };
    assert_eq!(encoded(request), Payload::Full(bytes));
    assert_eq!(Request::decode(&bytes), Ok(request));
    let stray = Request::decode(&[0x53, 0x52, 0x00, 0x00, 0x01, 0x03, 0x13, 0x88]);
    assert_eq!(stray, Err(DecodeError::FixedByte { offset: 4, got: 1, expected: 0 }));
    let off =
        Request::ConfigureStream { frames: ReturnFrames::empty(), interval: Milliseconds(61_166) };
    assert!(matches!(
        off.encode(),
        Err(EncodeError::Forbidden { field: "interval", value: 61_166, .. })
    ));
    let on =
        Request::ConfigureStream { frames: ReturnFrames::MOTION, interval: Milliseconds(61_166) };
    assert_eq!(encoded(on), Payload::Full([0x53, 0x52, 0x00, 0x00, 0x00, 0x01, 0xEE, 0xEE]));
}

/// Thruster manual §2.7, §4.1: SP and RP are raw, but for the limits of the absolute position.
#[test]
fn parameters_are_raw_but_for_the_limits() {
    let set = Request::SetParameter { parameter: 0x4D01, data: [1, 2, 3, 4] };
    let bytes = [0x53, 0x50, 0x4D, 0x01, 0x01, 0x02, 0x03, 0x04];
    assert_eq!(encoded(set), Payload::Full(bytes));
    assert_eq!(Request::decode(&bytes), Ok(set));
    let read = Request::ReadParameter { parameter: 0x4D01 };
    assert_eq!(encoded(read), Payload::Short([0x52, 0x50, 0x4D, 0x01]));
    assert_eq!(Request::decode(&[0x52, 0x50, 0x4D, 0x01, 0, 0, 0, 0]), Ok(read));
    let refusal = Request::SetParameter { parameter: 0x4D01, data: [0, 0, 0xEE, 0xEE] }.encode();
    assert!(matches!(refusal, Err(EncodeError::Forbidden { field: "data", value: 61_166, .. })));
    let around = Request::SetParameter { parameter: 0x4C41, data: [0x7F, 0xFF, 0, 0] }.encode();
    assert!(matches!(
        around,
        Err(EncodeError::Forbidden { field: "parameter", value: 0x4C41, .. })
    ));

    let limits = Request::SetPositionLimits {
        reverse: LimitDecidegrees(-900),
        forward: LimitDecidegrees(455),
    };
    let bytes = [0x53, 0x50, 0x4C, 0x41, 0xFC, 0x7C, 0x01, 0xC7];
    assert_eq!(encoded(limits), Payload::Full(bytes));
    assert_eq!(Request::decode(&bytes), Ok(limits));
    assert_eq!(encoded(Request::ReadPositionLimits), Payload::Short([0x52, 0x50, 0x4C, 0x41]));
    assert_eq!(Request::decode(&[0x52, 0x50, 0x4C, 0x41]), Ok(Request::ReadPositionLimits));
    let swapped =
        Request::SetPositionLimits { reverse: LimitDecidegrees(1), forward: LimitDecidegrees(0) };
    let refused = EncodeError::OutOfRange { field: "reverse", value: 1, min: -32_768, max: 0 };
    assert_eq!(swapped.encode(), Err(refused));
    let swapped =
        Request::SetPositionLimits { reverse: LimitDecidegrees(0), forward: LimitDecidegrees(-1) };
    let refused = EncodeError::OutOfRange { field: "forward", value: -1, min: 0, max: 32_767 };
    assert_eq!(swapped.encode(), Err(refused));
}

/// Thruster manual §4.2; 61166 would be the bytes of a refusal, −4370 is not.
#[test]
fn relative_position_has_no_range_but_the_refusal() {
    let request =
        Request::RelativePosition { speed: RpmLimit(300), position: Decidegrees(-36_000) };
    let bytes = [0x4C, 0x52, 0x01, 0x2C, 0xFF, 0xFF, 0x73, 0x60];
    assert_eq!(encoded(request), Payload::Full(bytes));
    assert_eq!(Request::decode(&bytes), Ok(request));
    let refusal =
        Request::RelativePosition { speed: RpmLimit(300), position: Decidegrees(61_166) }.encode();
    assert!(matches!(
        refusal,
        Err(EncodeError::Forbidden { field: "position", value: 61_166, .. })
    ));
    let negative = Request::RelativePosition { speed: RpmLimit(0), position: Decidegrees(-4370) };
    assert_eq!(encoded(negative), Payload::Full([0x4C, 0x52, 0x00, 0x00, 0xFF, 0xFF, 0xEE, 0xEE]));
}

/// Thruster manual §4.1, §4.2: AZ, RZ and RC are drawn with eight bytes, QA and QR with four.
#[test]
fn zeros_are_drawn_with_eight_bytes() {
    for (bytes, request) in [
        ([0x41, 0x5A, 0, 0, 0, 0, 0, 0], Request::SetAbsoluteZero),
        ([0x52, 0x5A, 0, 0, 0, 0, 0, 0], Request::SetRelativeZero),
        ([0x52, 0x43, 0, 0, 0, 0, 0, 0], Request::ClearRelativePosition),
    ] {
        assert_eq!(encoded(request), Payload::Full(bytes));
        assert_eq!(Request::decode(&bytes), Ok(request));
        assert_eq!(Request::decode(bytes.get(..4).unwrap()), Ok(request));
    }
    assert_eq!(encoded(Request::ReadRelativePosition), Payload::Short([0x51, 0x52, 0x00, 0x00]));
}

/// Thruster manual §2.7: what it does not name keeps its bytes.
#[test]
fn other_commands_keep_their_bytes() {
    let payload = Payload::Short([0x5A, 0x5A, 0x12, 0x34]);
    assert_eq!(Request::decode(payload.as_slice()), Ok(Request::Unknown { payload }));
    assert_eq!(encoded(Request::Unknown { payload }), payload);
}

/// Thruster manual §1.3: raw bytes neither go around the range checks nor look like a refusal.
#[test]
fn raw_bytes_do_not_go_around_the_checks() {
    let signal_200 = Payload::Full([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0x00, 0xC8]);
    let refusal = Payload::Full([0x5A, 0x5A, 0x00, 0x01, 0x00, 0x00, 0xEE, 0xEE]);
    let bad_read = Payload::Full([0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0x00, 0x01]);
    for (payload, command) in [(signal_200, 0x5443), (refusal, 0x5A5A), (bad_read, 0x5156)] {
        let result = Request::Unknown { payload }.encode();
        assert!(
            matches!(result, Err(EncodeError::Forbidden { field: "command", value, .. }) if value == command)
        );
    }
}

/// Thruster manual §2.1 to §2.6, §4; and a command that the manual does not list.
#[test]
fn reading_is_told_from_the_rest_by_its_letters() {
    let only_reads = |data: &[u8]| Request::decode(data).unwrap().only_reads();
    for data in [
        b"QV\0\0", b"QC\0\0", b"QP\0\0", b"QT\0\0", b"EQ\0\0", b"EF\0\0", b"FR\0\0", b"QA\0\0",
        b"QR\0\0",
    ] {
        assert!(only_reads(data), "{data:02X?}");
    }
    for data in [
        b"TC\0\0\0\0\0\0",
        b"VC\0\0\0\0\0\0",
        b"CI\0\0\0\0\0\x0B",
        b"ST\0\0\0\0\0\0",
        b"XX\0\0\0\0\0\0",
    ] {
        assert!(!only_reads(data), "{data:02X?}");
    }
    for data in [b"CF\0\0", b"MQ\0\0", b"ML\0\0", b"AZ\0\0", b"LS\0\0"] {
        assert!(!only_reads(data), "{data:02X?}");
    }
}
