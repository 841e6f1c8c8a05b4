//! Every encodable value, for property tests.

use proptest::prelude::*;
use rmd::{
    BaudCode, Celsius, Centiamps, Centidegrees, CentidegreesPerSecond, Decivolts, Deciwatts,
    Degrees, DegreesPerSecond, DegreesPerSecondSquared, EncoderPulses, Faults, FineSpeedLimit,
    Function, Milliseconds, Model, Motion, MotionCommand, MotionFeedback, Node, PidGains, Ramp,
    RawNotice, Reply, Request, RunMode, SpeedLimit, VersionDate,
};

pub fn node() -> impl Strategy<Value = Node> {
    (Node::MIN..=Node::MAX).prop_map(|node| Node::new(node).expect("1..=32"))
}

/// Eight bytes whose command has no variant.
fn unknown() -> impl Strategy<Value = [u8; 8]> {
    let commands = prop::sample::select(vec![0x00, 0x21, 0x33, 0x79, 0x90, 0xA6, 0xA7, 0xB6, 0xFF]);
    (commands, any::<[u8; 7]>())
        .prop_map(|(command, [b1, b2, b3, b4, b5, b6, b7])| [command, b1, b2, b3, b4, b5, b6, b7])
}

fn gains() -> impl Strategy<Value = PidGains> {
    any::<[u8; 6]>().prop_map(
        |[current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki]| PidGains {
            current_kp,
            current_ki,
            speed_kp,
            speed_ki,
            position_kp,
            position_ki,
        },
    )
}

fn ramp() -> impl Strategy<Value = Ramp> {
    (0..=3_u8).prop_map(Ramp)
}

fn acceleration() -> impl Strategy<Value = DegreesPerSecondSquared> {
    (100..=60_000_u32).prop_map(DegreesPerSecondSquared)
}

fn function() -> impl Strategy<Value = Function> {
    prop_oneof![
        Just(Function::ClearMultiTurn),
        any::<bool>().prop_map(|enabled| Function::CanIdFilter { enabled }),
        any::<bool>().prop_map(|enabled| Function::ErrorReporting { enabled }),
        any::<bool>().prop_map(|enabled| Function::MultiTurnSaving { enabled }),
    ]
}

fn pulses() -> impl Strategy<Value = EncoderPulses> {
    any::<i32>().prop_map(EncoderPulses)
}

fn angle() -> impl Strategy<Value = Centidegrees> {
    any::<i32>().prop_map(Centidegrees)
}

/// Requests under the id of a single motor, on either bus.
pub fn request() -> impl Strategy<Value = Request> {
    let reads = prop::sample::select(vec![
        Request::ReadPid,
        Request::ReadAcceleration,
        Request::ReadEncoderPosition,
        Request::ReadEncoderRawPosition,
        Request::ReadEncoderOffset,
        Request::WritePositionAsZero,
        Request::ReadMultiTurnAngle,
        Request::ReadStatus1,
        Request::ReadStatus2,
        Request::ReadStatus3,
        Request::Shutdown,
        Request::Stop,
        Request::ReadRunMode,
        Request::ReadPower,
        Request::Reset,
        Request::ReleaseBrake,
        Request::LockBrake,
        Request::ReadRunTime,
        Request::ReadVersionDate,
        Request::ReadModel,
    ]);
    let writes = prop_oneof![
        gains().prop_map(|gains| Request::WritePidRam { gains }),
        gains().prop_map(|gains| Request::WritePidRom { gains }),
        (ramp(), acceleration())
            .prop_map(|(ramp, acceleration)| Request::WriteAcceleration { ramp, acceleration }),
        pulses().prop_map(|offset| Request::WriteEncoderOffset { offset }),
        any::<u32>()
            .prop_map(|raw| Request::SetCommunicationTimeout { timeout: Milliseconds(raw) }),
        (0..=1_u8).prop_map(|code| Request::SetBaudRate { code: BaudCode(code) }),
        function().prop_map(|function| Request::Function { function }),
    ];
    let motion = prop_oneof![
        any::<i16>().prop_map(|raw| Request::TorqueCurrent { current: Centiamps(raw) }),
        any::<i32>().prop_map(|raw| Request::Velocity { speed: CentidegreesPerSecond(raw) }),
        angle().prop_map(|angle| Request::PositionTracking { angle }),
        (any::<u16>(), angle()).prop_map(|(max_speed, angle)| Request::AbsolutePosition {
            max_speed: SpeedLimit(max_speed),
            angle,
        }),
        (any::<u16>(), angle()).prop_map(|(max_speed, angle)| Request::LimitedPositionTracking {
            max_speed: FineSpeedLimit(max_speed),
            angle,
        }),
        (any::<u16>(), angle()).prop_map(|(max_speed, angle)| Request::IncrementalPosition {
            max_speed: SpeedLimit(max_speed),
            angle,
        }),
    ];
    prop_oneof![3 => reads, 2 => writes, 2 => motion, 1 => unknown().prop_map(|data| Request::Unknown { data })]
}

/// The requests under ids of their own.
pub fn special_request() -> impl Strategy<Value = Request> {
    let word = || 0..=0xFFF_u16;
    prop_oneof![
        Just(Request::ReadCanId),
        (1..=32_u8).prop_map(|id| Request::SetCanId { id }),
        Just(Request::ReadRs485Id),
        (1..=32_u8).prop_map(|id| Request::SetRs485Id { id }),
        (any::<u16>(), word(), word(), word(), word()).prop_map(
            |(position, velocity, kp, kd, torque)| {
                Request::MotionMode {
                    command: MotionCommand { position, velocity, kp, kd, torque },
                }
            }
        ),
    ]
}

fn state() -> impl Strategy<Value = Motion> {
    (any::<i8>(), any::<i16>(), any::<i16>(), -32767..=32767_i16).prop_map(
        |(temperature, current, speed, angle)| Motion {
            temperature: Celsius(temperature),
            current: Centiamps(current),
            speed: DegreesPerSecond(speed),
            angle: Degrees(angle),
        },
    )
}

/// Replies under the id of a single motor, on either bus.
pub fn reply() -> impl Strategy<Value = Reply> {
    let echoes = prop_oneof![
        prop::sample::select(vec![
            Reply::Shutdown,
            Reply::Stop,
            Reply::BrakeReleased,
            Reply::BrakeLocked
        ]),
        gains().prop_map(|gains| Reply::PidRamWritten { gains }),
        gains().prop_map(|gains| Reply::PidRomWritten { gains }),
        (ramp(), acceleration())
            .prop_map(|(ramp, acceleration)| Reply::AccelerationWritten { ramp, acceleration }),
        pulses().prop_map(|offset| Reply::EncoderOffsetWritten { offset }),
        any::<u32>().prop_map(|raw| Reply::CommunicationTimeout { timeout: Milliseconds(raw) }),
        any::<[u8; 7]>().prop_map(|raw| Reply::BaudRateSet { raw }),
        function().prop_map(|function| Reply::Function { function }),
        // On RS485 a notice always has eight bytes; shorter ones are covered beside the CAN code.
        any::<[u8; 7]>().prop_map(|payload| Reply::TimeoutNotice {
            raw: RawNotice::new(&payload).expect("7 bytes")
        }),
        unknown().prop_map(|data| Reply::Unknown { data }),
    ];
    let values = prop_oneof![
        gains().prop_map(|gains| Reply::Pid { gains }),
        acceleration().prop_map(|acceleration| Reply::Acceleration { acceleration }),
        pulses().prop_map(|position| Reply::EncoderPosition { position }),
        pulses().prop_map(|position| Reply::EncoderRawPosition { position }),
        pulses().prop_map(|offset| Reply::EncoderOffset { offset }),
        pulses().prop_map(|offset| Reply::PositionWrittenAsZero { offset }),
        angle().prop_map(|angle| Reply::MultiTurnAngle { angle }),
        any::<u8>().prop_map(|code| Reply::RunMode { mode: RunMode::from_code(code) }),
        any::<u16>().prop_map(|raw| Reply::Power { power: Deciwatts(raw) }),
        any::<u32>().prop_map(|raw| Reply::RunTime { time: Milliseconds(raw) }),
        any::<u32>().prop_map(|raw| Reply::VersionDate { date: VersionDate(raw) }),
        any::<[u8; 7]>().prop_map(|raw| Reply::Model { model: Model(raw) }),
    ];
    let states = prop_oneof![
        any::<(i8, bool, u16, u16)>().prop_map(|(temperature, brake_released, voltage, faults)| {
            Reply::Status1 {
                temperature: Celsius(temperature),
                brake_released,
                voltage: Decivolts(voltage),
                faults: Faults::from_bits_retain(faults),
            }
        }),
        any::<(i8, i16, i16, i16)>().prop_map(|(temperature, a, b, c)| Reply::Status3 {
            temperature: Celsius(temperature),
            phase_a: Centiamps(a),
            phase_b: Centiamps(b),
            phase_c: Centiamps(c),
        }),
        state().prop_map(|motion| Reply::Status2 { motion }),
        state().prop_map(|motion| Reply::TorqueCurrent { motion }),
        state().prop_map(|motion| Reply::Velocity { motion }),
        state().prop_map(|motion| Reply::PositionTracking { motion }),
        state().prop_map(|motion| Reply::AbsolutePosition { motion }),
        state().prop_map(|motion| Reply::LimitedPositionTracking { motion }),
        state().prop_map(|motion| Reply::IncrementalPosition { motion }),
    ];
    prop_oneof![echoes, values, states]
}

/// The replies under ids of their own, with the motor that they name.
pub fn special_reply() -> impl Strategy<Value = (Node, Reply)> {
    let feedback = (node(), any::<u8>(), any::<u16>(), 0..=0xFFF_u16, 0..=0xFFF_u16).prop_map(
        |(node, id, position, velocity, torque)| {
            (
                node,
                Reply::MotionMode { feedback: MotionFeedback { id, position, velocity, torque } },
            )
        },
    );
    prop_oneof![
        node().prop_map(|id| (id, Reply::CanId { id })),
        node().prop_map(|id| (id, Reply::CanIdSet { id })),
        node().prop_map(|id| (id, Reply::Rs485Id { id })),
        node().prop_map(|id| (id, Reply::Rs485IdSet { id })),
        feedback,
    ]
}
