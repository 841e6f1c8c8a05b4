use super::*;
use crate::{
    BaudCode, Centiamps, Centidegrees, CentidegreesPerSecond, DegreesPerSecondSquared,
    EncoderPulses, FineSpeedLimit, Milliseconds, PidGains, Ramp, SpeedLimit,
};

/// The 33 single-motor commands of RMD V3.6 §2.
const COMMANDS: [u8; 33] = [
    0x20, 0x30, 0x31, 0x32, 0x42, 0x43, 0x60, 0x61, 0x62, 0x63, 0x64, 0x70, 0x71, 0x76, 0x77, 0x78,
    0x80, 0x81, 0x92, 0x9A, 0x9C, 0x9D, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA8, 0xB1, 0xB2, 0xB3, 0xB4,
    0xB5,
];

#[track_caller]
fn both_ways(request: Request, data: [u8; 8]) {
    assert_eq!(request.encode(), Ok(data));
    assert_eq!(Request::decode(&data), request);
}

/// RMD V3.6 §2.11.4, §2.12.4, §2.13.4.
#[test]
fn reads() {
    both_ways(Request::ReadMultiTurnAngle, [0x92, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadStatus1, [0x9A, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadStatus2, [0x9C, 0, 0, 0, 0, 0, 0, 0]);
}

/// RMD V3.6 §2.15.2, §2.16.2, §2.26.2, §2.27.2.
#[test]
fn stops_and_brake() {
    both_ways(Request::Shutdown, [0x80, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::Stop, [0x81, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReleaseBrake, [0x77, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::LockBrake, [0x78, 0, 0, 0, 0, 0, 0, 0]);
}

/// RMD V3.6 §2.17.4: 1 A and −1 A; then the ends of the word.
#[test]
fn torque_current() {
    both_ways(
        Request::TorqueCurrent { current: Centiamps(100) },
        [0xA1, 0, 0, 0, 0x64, 0x00, 0, 0],
    );
    both_ways(
        Request::TorqueCurrent { current: Centiamps(-100) },
        [0xA1, 0, 0, 0, 0x9C, 0xFF, 0, 0],
    );
    both_ways(
        Request::TorqueCurrent { current: Centiamps(i16::MAX) },
        [0xA1, 0, 0, 0, 0xFF, 0x7F, 0, 0],
    );
    both_ways(
        Request::TorqueCurrent { current: Centiamps(i16::MIN) },
        [0xA1, 0, 0, 0, 0x00, 0x80, 0, 0],
    );
}

/// RMD V3.6 §2.18.4: 100 and −100 degrees per second; then the ends of the word.
#[test]
fn velocity() {
    let velocity = |raw| Request::Velocity { speed: CentidegreesPerSecond(raw) };
    both_ways(velocity(10_000), [0xA2, 0, 0, 0, 0x10, 0x27, 0x00, 0x00]);
    both_ways(velocity(-10_000), [0xA2, 0, 0, 0, 0xF0, 0xD8, 0xFF, 0xFF]);
    both_ways(velocity(i32::MAX), [0xA2, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0x7F]);
    both_ways(velocity(i32::MIN), [0xA2, 0, 0, 0, 0x00, 0x00, 0x00, 0x80]);
}

/// RMD V3.6 §2.20.4: 360° and −360° at 500 degrees per second; a limit above i16 and a limit of 0.
#[test]
fn absolute_position() {
    let position = |max_speed, angle| Request::AbsolutePosition {
        max_speed: SpeedLimit(max_speed),
        angle: Centidegrees(angle),
    };
    both_ways(position(500, 36_000), [0xA4, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00]);
    both_ways(position(500, -36_000), [0xA4, 0x00, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF]);
    both_ways(position(0xFFFE, i32::MIN), [0xA4, 0x00, 0xFE, 0xFF, 0x00, 0x00, 0x00, 0x80]);
    both_ways(position(0, 1), [0xA4, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00]);
}

/// RMD V3.6 §2.30.4: off and 1000 ms; then the end of the word.
#[test]
fn communication_timeout() {
    let timeout = |raw| Request::SetCommunicationTimeout { timeout: Milliseconds(raw) };
    both_ways(timeout(0), [0xB3, 0, 0, 0, 0x00, 0x00, 0x00, 0x00]);
    both_ways(timeout(1000), [0xB3, 0, 0, 0, 0xE8, 0x03, 0x00, 0x00]);
    both_ways(timeout(u32::MAX), [0xB3, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
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
    both_ways(Request::ReadPid, [0x30, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::WritePidRam { gains }, [0x31, 0, 0x55, 0x19, 0x56, 0x1A, 0x57, 0xFF]);
    both_ways(Request::WritePidRom { gains }, [0x32, 0, 0x55, 0x19, 0x56, 0x1A, 0x57, 0xFF]);
}

/// RMD V3.6 §2.4.4 and §2.5.5; then the ends of the range and what lies beyond.
#[test]
fn acceleration() {
    let write = |index, raw| Request::WriteAcceleration {
        ramp: Ramp(index),
        acceleration: DegreesPerSecondSquared(raw),
    };
    both_ways(Request::ReadAcceleration, [0x42, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(write(0, 10_000), [0x43, 0x00, 0, 0, 0x10, 0x27, 0x00, 0x00]);
    both_ways(write(1, 10_000), [0x43, 0x01, 0, 0, 0x10, 0x27, 0x00, 0x00]);
    both_ways(write(2, 100), [0x43, 0x02, 0, 0, 0x64, 0x00, 0x00, 0x00]);
    both_ways(write(3, 60_000), [0x43, 0x03, 0, 0, 0x60, 0xEA, 0x00, 0x00]);

    let out_of_range =
        |field, value, min, max| Err(EncodeError::OutOfRange { field, value, min, max });
    assert_eq!(write(4, 100).encode(), out_of_range("index", 4, 0, 3));
    assert_eq!(write(0, 99).encode(), out_of_range("acceleration", 99, 100, 60_000));
    assert_eq!(write(0, 60_001).encode(), out_of_range("acceleration", 60_001, 100, 60_000));
    assert_eq!(Request::decode(&[0x43, 0x07, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]), write(7, u32::MAX));
}

/// RMD V3.6 §2.6.4 to §2.10.4. The table of §2.9.2 shifts the last two bytes by 8; they are the
/// upper half of the word.
#[test]
fn encoder() {
    both_ways(Request::ReadEncoderPosition, [0x60, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadEncoderRawPosition, [0x61, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadEncoderOffset, [0x62, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::WritePositionAsZero, [0x64, 0, 0, 0, 0, 0, 0, 0]);
    let write = |raw| Request::WriteEncoderOffset { offset: EncoderPulses(raw) };
    both_ways(write(10_000), [0x63, 0, 0, 0, 0x10, 0x27, 0x00, 0x00]);
    both_ways(write(0x1234_5678), [0x63, 0, 0, 0, 0x78, 0x56, 0x34, 0x12]);
    both_ways(write(-2), [0x63, 0, 0, 0, 0xFE, 0xFF, 0xFF, 0xFF]);
}

/// RMD V3.6 §2.14.4, §2.23.4, §2.24.4, §2.25.4, §2.28.4, §2.29.4, §2.32.4.
#[test]
fn more_reads_and_reset() {
    both_ways(Request::ReadStatus3, [0x9D, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadRunMode, [0x70, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadPower, [0x71, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::Reset, [0x76, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadRunTime, [0xB1, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadVersionDate, [0xB2, 0, 0, 0, 0, 0, 0, 0]);
    both_ways(Request::ReadModel, [0xB5, 0, 0, 0, 0, 0, 0, 0]);
}

/// RMD V3.6 §2.19.4: 1°; §2.21.4: 1° at 50 degrees per second, 0.01 each; §2.22.4: ±360° at 500, 1
/// each.
#[test]
fn tracking_and_incremental_position() {
    let angle = Centidegrees(100);
    both_ways(Request::PositionTracking { angle }, [0xA3, 0, 0, 0, 0x64, 0x00, 0x00, 0x00]);
    both_ways(
        Request::LimitedPositionTracking { max_speed: FineSpeedLimit(5000), angle },
        [0xA5, 0, 0x88, 0x13, 0x64, 0x00, 0x00, 0x00],
    );
    let increment = |angle| Request::IncrementalPosition {
        max_speed: SpeedLimit(500),
        angle: Centidegrees(angle),
    };
    both_ways(increment(36_000), [0xA8, 0, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00]);
    both_ways(increment(-36_000), [0xA8, 0, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF]);
}

/// RMD V3.6 §2.31.4; 4 is the last code of §2.31.1.
#[test]
fn baud_rate() {
    let set = |code| Request::SetBaudRate { code: BaudCode(code) };
    both_ways(set(0), [0xB4, 0, 0, 0, 0, 0, 0, 0x00]);
    both_ways(set(1), [0xB4, 0, 0, 0, 0, 0, 0, 0x01]);
    both_ways(set(4), [0xB4, 0, 0, 0, 0, 0, 0, 0x04]);
    assert_eq!(
        set(5).encode(),
        Err(EncodeError::OutOfRange { field: "baud_code", value: 5, min: 0, max: 4 })
    );
}

/// RMD V3.6 §2.33.5 and the table of §2.33.4.
#[test]
fn functions() {
    let send = |function| Request::Function { function };
    both_ways(send(Function::ClearMultiTurn), [0x20, 0x01, 0, 0, 0, 0, 0, 0]);
    both_ways(send(Function::CanIdFilter { enabled: true }), [0x20, 0x02, 0, 0, 1, 0, 0, 0]);
    both_ways(send(Function::CanIdFilter { enabled: false }), [0x20, 0x02, 0, 0, 0, 0, 0, 0]);
    both_ways(send(Function::ErrorReporting { enabled: true }), [0x20, 0x03, 0, 0, 1, 0, 0, 0]);
    both_ways(send(Function::MultiTurnSaving { enabled: true }), [0x20, 0x04, 0, 0, 1, 0, 0, 0]);
    let other = Request::decode(&[0x20, 0x03, 0, 0, 2, 0, 0, 0]);
    assert_eq!(other, send(Function::Other { index: 3, value: 2 }));
    assert_eq!(
        other.encode(),
        Err(EncodeError::OutOfRange { field: "value", value: 2, min: 0, max: 1 })
    );
}

/// RMD V3.6 §4.2, §7.2: ids 1 to 32.
#[test]
fn ids_beyond_the_range_are_refused() {
    for id in [0, 33] {
        let refused =
            Err(EncodeError::OutOfRange { field: "id", value: i64::from(id), min: 1, max: 32 });
        assert_eq!(Request::SetCanId { id }.encode(), refused);
        assert_eq!(Request::SetRs485Id { id }.encode(), refused);
    }
}

/// A command without a variant keeps every byte. 0x79 to a single motor is one: only under its own
/// ids has it a meaning (RMD V3.6 §4.1, §7.1).
#[test]
fn other_commands_keep_their_bytes() {
    for command in [0x00, 0x21, 0x79, 0x90, 0xA6, 0xF1] {
        let data = [command, 1, 2, 3, 4, 5, 6, 7];
        both_ways(Request::Unknown { data }, data);
        assert_eq!(Request::decode(&data).command(), command);
    }
}

/// NULL bytes of RMD V3.6 §2.17.2 and §2.15.2 carry nothing.
#[test]
fn reserved_bytes_are_passed_over() {
    assert_eq!(
        Request::decode(&[0xA1, 0x11, 0x22, 0x33, 0x64, 0x00, 0x66, 0x77]),
        Request::TorqueCurrent { current: Centiamps(100) }
    );
    assert_eq!(Request::decode(&[0x80, 1, 2, 3, 4, 5, 6, 7]), Request::Shutdown);
}

#[test]
fn unknown_cannot_carry_a_known_command() {
    for command in COMMANDS {
        let request = Request::Unknown { data: [command, 0, 0, 0, 0, 0, 0, 0] };
        assert_eq!(
            request.encode(),
            Err(EncodeError::Forbidden {
                field: "command",
                value: i64::from(command),
                reason: "this command has a request of its own"
            })
        );
    }
}

/// RMD V3.6 §2.13, §2.16, §2.25, §2.33; and a command that the manual does not list.
#[test]
fn reading_is_told_from_the_rest_by_the_first_byte() {
    let only_reads = |first: u8| Request::decode(&[first, 0, 0, 0, 0, 0, 0, 0]).only_reads();
    for first in
        [0x30, 0x42, 0x60, 0x61, 0x62, 0x70, 0x71, 0x90, 0x92, 0x9A, 0x9C, 0x9D, 0xB1, 0xB2, 0xB5]
    {
        assert_eq!(only_reads(first), first != 0x90, "{first:#04X}");
    }
    for first in
        [0x20, 0x31, 0x43, 0x63, 0x64, 0x76, 0x77, 0x78, 0x80, 0x81, 0xA1, 0xA8, 0xB3, 0xB4, 0xF1]
    {
        assert!(!only_reads(first), "{first:#04X}");
    }
}
