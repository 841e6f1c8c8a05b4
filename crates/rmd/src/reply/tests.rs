use super::*;
use crate::{
    Celsius, Centiamps, Centidegrees, Decivolts, Deciwatts, Degrees, DegreesPerSecond,
    DegreesPerSecondSquared, EncoderPulses, Faults, Function, Milliseconds, Model, Motion,
    PidGains, Ramp, RunMode, VersionDate,
};

/// The single-motor commands of RMD V3.6 §2 that are answered, and the timeout notice.
const COMMANDS: [u8; 33] = [
    0x20, 0x30, 0x31, 0x32, 0x42, 0x43, 0x60, 0x61, 0x62, 0x63, 0x64, 0x70, 0x71, 0x77, 0x78, 0x80,
    0x81, 0x92, 0x9A, 0x9C, 0x9D, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA8, 0xB1, 0xB2, 0xB3, 0xB4, 0xB5,
    0xF1,
];

#[track_caller]
fn both_ways(reply: Reply, data: [u8; 8]) {
    assert_eq!(reply.encode(), Ok(data));
    assert_eq!(Reply::decode(&data), Ok(reply));
}

const FORWARD: Motion = Motion {
    temperature: Celsius(50),
    current: Centiamps(100),
    speed: DegreesPerSecond(500),
    angle: Degrees(45),
};
const BACKWARD: Motion = Motion {
    temperature: Celsius(50),
    current: Centiamps(-100),
    speed: DegreesPerSecond(-500),
    angle: Degrees(-45),
};

/// RMD V3.6 §2.11.4: 360°; then a negative angle.
#[test]
fn multi_turn_angle() {
    both_ways(
        Reply::MultiTurnAngle { angle: Centidegrees(36_000) },
        [0x92, 0, 0, 0, 0xA0, 0x8C, 0x00, 0x00],
    );
    both_ways(
        Reply::MultiTurnAngle { angle: Centidegrees(-1) },
        [0x92, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF],
    );
}

/// RMD V3.6 §2.12.4: 50 °C, released, 48.5 V, low voltage.
#[test]
fn status_1() {
    both_ways(
        Reply::Status1 {
            temperature: Celsius(50),
            brake_released: true,
            voltage: Decivolts(485),
            faults: Faults::UNDER_VOLTAGE,
        },
        [0x9A, 0x32, 0x00, 0x01, 0xE5, 0x01, 0x04, 0x00],
    );
}

/// Bits of the error word that RMD V3.6 §2.12.3 does not list survive, beside several that it does.
#[test]
fn unlisted_fault_bits_are_kept() {
    both_ways(
        Reply::Status1 {
            temperature: Celsius(-5),
            brake_released: false,
            voltage: Decivolts(0xFFFF),
            faults: Faults::from_bits_retain(0xFFFF),
        },
        [0x9A, 0xFB, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF],
    );
}

/// RMD V3.6 §2.12.3 lists 0 and 1; anything but 0 must not pass for a locked brake. Byte 2 is NULL
/// there and a temperature in newer manuals.
#[test]
fn only_zero_is_a_locked_brake() {
    let reply = Reply::decode(&[0x9A, 0x32, 0x28, 0x02, 0xE5, 0x01, 0x00, 0x00]);
    assert!(matches!(reply, Ok(Reply::Status1 { brake_released: true, .. })));
}

/// RMD V3.6 §2.13.4, §2.17.4, §2.18.4, §2.20.4.
#[test]
fn motion_replies() {
    both_ways(Reply::Status2 { motion: FORWARD }, [0x9C, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00]);
    both_ways(
        Reply::TorqueCurrent { motion: FORWARD },
        [0xA1, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00],
    );
    both_ways(
        Reply::TorqueCurrent { motion: BACKWARD },
        [0xA1, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF],
    );
    both_ways(
        Reply::Velocity { motion: FORWARD },
        [0xA2, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00],
    );
    both_ways(
        Reply::Velocity { motion: BACKWARD },
        [0xA2, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF],
    );
    both_ways(
        Reply::AbsolutePosition { motion: FORWARD },
        [0xA4, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00],
    );
    both_ways(
        Reply::AbsolutePosition { motion: BACKWARD },
        [0xA4, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF],
    );
}

/// RMD V3.6 §2.13.3: the angle ends at ±32767. Received, −32768 is reported as it is.
#[test]
fn the_angle_is_symmetric() {
    let data = [0x9C, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x00, 0x80];
    let reply = Reply::Status2 { motion: Motion { angle: Degrees(i16::MIN), ..FORWARD } };
    assert_eq!(Reply::decode(&data), Ok(reply));
    assert_eq!(
        reply.encode(),
        Err(EncodeError::OutOfRange { field: "angle", value: -32768, min: -32767, max: 32767 })
    );
    both_ways(
        Reply::Status2 { motion: Motion { angle: Degrees(-32767), ..FORWARD } },
        [0x9C, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x01, 0x80],
    );
}

/// RMD V3.6 §3.2 (0x80), §2.16.3, §2.26.3, §2.27.3.
#[test]
fn echoes() {
    both_ways(Reply::Shutdown, [0x80, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Reply::Stop, [0x81, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Reply::BrakeReleased, [0x77, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Reply::BrakeLocked, [0x78, 0, 0, 0, 0, 0, 0, 0]);
}

/// RMD V3.6 §2.30.3 (echo) and §2.30.4 example 2 (all zero).
#[test]
fn communication_timeout_echoed_or_zero() {
    both_ways(
        Reply::CommunicationTimeout { timeout: Milliseconds(1000) },
        [0xB3, 0, 0, 0, 0xE8, 0x03, 0x00, 0x00],
    );
    both_ways(
        Reply::CommunicationTimeout { timeout: Milliseconds(0) },
        [0xB3, 0, 0, 0, 0, 0, 0, 0],
    );
}

/// Observed on motors: the notice comes without data. No other reply may be short.
#[test]
fn only_the_timeout_notice_may_be_short() {
    let bare = Reply::TimeoutNotice { raw: RawNotice::default() };
    assert_eq!(Reply::decode(&[0xF1]), Ok(bare));
    assert_eq!(bare.encode(), Ok([0xF1, 0, 0, 0, 0, 0, 0, 0]));

    let full = [0xF1, 1, 2, 3, 4, 5, 6, 7];
    let reply =
        Reply::TimeoutNotice { raw: RawNotice::new(&[1, 2, 3, 4, 5, 6, 7]).expect("seven bytes") };
    both_ways(reply, full);

    assert_eq!(Reply::decode(&[]), Err(DecodeError::Length { got: 0, expected: 8 }));
    assert_eq!(Reply::decode(&[0x80]), Err(DecodeError::Length { got: 1, expected: 8 }));
    assert_eq!(Reply::decode(&[0xF1; 9]), Err(DecodeError::Length { got: 9, expected: 8 }));
    assert_eq!(
        RawNotice::new(&[0; 8]),
        Err(EncodeError::OutOfRange { field: "notice length", value: 8, min: 0, max: 7 })
    );
}

/// RMD V3.6 §2.1.4, §2.2.4, §2.3.4.
#[test]
fn gains() {
    let gains = PidGains {
        current_kp: 0x55,
        current_ki: 0x19,
        speed_kp: 0x56,
        speed_ki: 0x1A,
        position_kp: 0x57,
        position_ki: 0xFF,
    };
    both_ways(Reply::Pid { gains }, [0x30, 0, 0x55, 0x19, 0x56, 0x1A, 0x57, 0xFF]);
    both_ways(Reply::PidRamWritten { gains }, [0x31, 0, 0x55, 0x19, 0x56, 0x1A, 0x57, 0xFF]);
    both_ways(Reply::PidRomWritten { gains }, [0x32, 0, 0x55, 0x19, 0x56, 0x1A, 0x57, 0xFF]);
}

/// RMD V3.6 §2.4.4, §2.5.5.
#[test]
fn acceleration() {
    let read = |raw| Reply::Acceleration { acceleration: DegreesPerSecondSquared(raw) };
    both_ways(read(10_000), [0x42, 0, 0, 0, 0x10, 0x27, 0x00, 0x00]);
    let written = Reply::AccelerationWritten {
        ramp: Ramp::VELOCITY_DECELERATION,
        acceleration: DegreesPerSecondSquared(10_000),
    };
    both_ways(written, [0x43, 0x03, 0, 0, 0x10, 0x27, 0x00, 0x00]);
    assert_eq!(Reply::decode(&[0x42, 0, 0, 0, 0, 0, 0, 0x80]), Ok(read(0x8000_0000)));
    assert!(matches!(
        read(99).encode(),
        Err(EncodeError::OutOfRange { field: "acceleration", .. })
    ));
}

/// RMD V3.6 §2.6.4 to §2.10.4, with all four bytes of the word.
#[test]
fn encoder() {
    let pulses = EncoderPulses(0x1234_5678);
    both_ways(Reply::EncoderPosition { position: pulses }, [0x60, 0, 0, 0, 0x78, 0x56, 0x34, 0x12]);
    both_ways(
        Reply::EncoderRawPosition { position: pulses },
        [0x61, 0, 0, 0, 0x78, 0x56, 0x34, 0x12],
    );
    both_ways(Reply::EncoderOffset { offset: pulses }, [0x62, 0, 0, 0, 0x78, 0x56, 0x34, 0x12]);
    both_ways(
        Reply::EncoderOffsetWritten { offset: pulses },
        [0x63, 0, 0, 0, 0x78, 0x56, 0x34, 0x12],
    );
    let pulses = EncoderPulses(-10_000);
    both_ways(
        Reply::PositionWrittenAsZero { offset: pulses },
        [0x64, 0, 0, 0, 0xF0, 0xD8, 0xFF, 0xFF],
    );
}

/// RMD V3.6 §2.14.4: 50 °C, 30.1 A, −15.2 A, −16 A.
#[test]
fn status_3() {
    both_ways(
        Reply::Status3 {
            temperature: Celsius(50),
            phase_a: Centiamps(3010),
            phase_b: Centiamps(-1520),
            phase_c: Centiamps(-1600),
        },
        [0x9D, 0x32, 0xC2, 0x0B, 0x10, 0xFA, 0xC0, 0xF9],
    );
}

/// RMD V3.6 §2.19.4, §2.21.4, §2.22.4.
#[test]
fn more_motion_replies() {
    both_ways(
        Reply::PositionTracking { motion: FORWARD },
        [0xA3, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00],
    );
    both_ways(
        Reply::LimitedPositionTracking { motion: FORWARD },
        [0xA5, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00],
    );
    both_ways(
        Reply::IncrementalPosition { motion: BACKWARD },
        [0xA8, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF],
    );
}

/// RMD V3.6 §2.23.4 (position loop), §2.24.4 (200 W); the manual speaks of a fourth mode and lists
/// three.
#[test]
fn run_mode_and_power() {
    both_ways(Reply::RunMode { mode: RunMode::Position }, [0x70, 0, 0, 0, 0, 0, 0, 0x03]);
    both_ways(Reply::RunMode { mode: RunMode::Unknown(4) }, [0x70, 0, 0, 0, 0, 0, 0, 0x04]);
    both_ways(Reply::Power { power: Deciwatts(2000) }, [0x71, 0, 0, 0, 0, 0, 0xD0, 0x07]);
}

/// RMD V3.6 §2.28.4, §2.29.4, §2.32.4; ten digits of a date were observed on motors.
#[test]
fn run_time_date_and_model() {
    both_ways(
        Reply::RunTime { time: Milliseconds(0x1000_0000) },
        [0xB1, 0, 0, 0, 0x00, 0x00, 0x00, 0x10],
    );
    both_ways(
        Reply::VersionDate { date: VersionDate(20_220_206) },
        [0xB2, 0, 0, 0, 0x2E, 0x89, 0x34, 0x01],
    );
    both_ways(
        Reply::VersionDate { date: VersionDate(2_025_070_202) },
        [0xB2, 0, 0, 0, 0x7A, 0x1E, 0xB4, 0x78],
    );
    both_ways(
        Reply::Model { model: Model(*b"X8S2V10") },
        [0xB5, 0x58, 0x38, 0x53, 0x32, 0x56, 0x31, 0x30],
    );
}

/// RMD V3.6 §2.31.3: whatever comes back is kept.
#[test]
fn random_bytes_after_a_change_of_rate() {
    both_ways(Reply::BaudRateSet { raw: [1, 2, 3, 4, 5, 6, 7] }, [0xB4, 1, 2, 3, 4, 5, 6, 7]);
}

/// RMD V3.6 §2.33.5.
#[test]
fn functions() {
    let echo = |function| Reply::Function { function };
    both_ways(echo(Function::ClearMultiTurn), [0x20, 0x01, 0, 0, 0, 0, 0, 0]);
    both_ways(echo(Function::CanIdFilter { enabled: true }), [0x20, 0x02, 0, 0, 1, 0, 0, 0]);
}

/// A reply without a variant keeps every byte; 0x76 has none (RMD V3.6 §2.25.3).
#[test]
fn other_replies_keep_their_bytes() {
    for command in [0x00, 0x21, 0x76, 0x79, 0x90, 0xA6] {
        let data = [command, 1, 2, 3, 4, 5, 6, 7];
        both_ways(Reply::Unknown { data }, data);
    }
}

#[test]
fn unknown_cannot_carry_a_known_command() {
    for command in COMMANDS {
        let reply = Reply::Unknown { data: [command, 0, 0, 0, 0, 0, 0, 0] };
        assert_eq!(
            reply.encode(),
            Err(EncodeError::Forbidden {
                field: "command",
                value: i64::from(command),
                reason: "this command has a reply of its own"
            })
        );
    }
}
