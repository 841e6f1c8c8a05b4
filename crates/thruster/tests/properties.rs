//! What holds for every value and every byte string.

use codec::testing::CanFrame;
use proptest::prelude::*;
use thruster::{
    BITRATES, COMMANDS, Celsius, Deciamps, Decidegrees, Decivolts, Faults, Headerless, Kilobits,
    LimitDecidegrees, Milliseconds, Node, Payload, Percent, Reply, Request, ReturnFlags,
    ReturnFrames, ReturnSource, Returned, ReturnedFrame, Rpm, RpmLimit, answer, can,
};

/// Any command word, the named ones often; `EE EE` and sign extensions often enough to be met.
fn data_field() -> impl Strategy<Value = Vec<u8>> {
    let word = |words: Vec<u16>| prop_oneof![proptest::sample::select(words), any::<u16>()];
    let commands = COMMANDS.iter().map(|info| info.code).collect();
    let words = (
        word(commands),
        word(vec![0, 0x4C41]),
        word(vec![0, 0xFFFF]),
        word(vec![0, 1, 0x0103, 0xEEEE]),
    );
    (words, 0..=9_usize).prop_map(|((command, parameter, upper, lower), len)| {
        let mut bytes = [command, parameter, upper, lower, 0].map(u16::to_be_bytes).concat();
        bytes.truncate(if len < 4 { 8 } else { len });
        bytes
    })
}

fn bitrate() -> impl Strategy<Value = Kilobits> {
    proptest::sample::select(BITRATES.iter().map(|info| info.setting).collect::<Vec<_>>())
}

fn timeout() -> impl Strategy<Value = Milliseconds> {
    prop_oneof![Just(0), 100..=60_000_u16].prop_map(Milliseconds)
}

fn speed() -> impl Strategy<Value = Rpm> {
    prop_oneof![Just(0), 30..=i16::MAX, i16::MIN..=-4371, -4369..=-30_i16].prop_map(Rpm)
}

/// Data that are no refusal.
fn data() -> impl Strategy<Value = [u8; 4]> {
    any::<[u8; 4]>().prop_filter("a refusal", |data| *data != [0, 0, 0xEE, 0xEE])
}

fn parameter() -> impl Strategy<Value = u16> {
    any::<u16>().prop_filter("has a variant", |parameter| *parameter != 0x4C41)
}

fn relative() -> impl Strategy<Value = (RpmLimit, Decidegrees)> {
    let position = any::<i32>().prop_filter("a refusal", |position| *position != 0xEEEE);
    (any::<u16>(), position).prop_map(|(speed, position)| (RpmLimit(speed), Decidegrees(position)))
}

fn absolute() -> impl Strategy<Value = (RpmLimit, Decidegrees)> {
    (any::<u16>(), -1799..=1799)
        .prop_map(|(speed, position)| (RpmLimit(speed), Decidegrees(position)))
}

fn limits() -> impl Strategy<Value = (LimitDecidegrees, LimitDecidegrees)> {
    (i16::MIN..=0, 0..=i16::MAX)
        .prop_map(|(reverse, forward)| (LimitDecidegrees(reverse), LimitDecidegrees(forward)))
}

fn frames() -> impl Strategy<Value = ReturnFrames> {
    (0..8_u8).prop_map(ReturnFrames::from_bits_retain)
}

fn unknown() -> impl Strategy<Value = Payload> {
    let full = (any::<[u8; 2]>(), data()).prop_map(|([p0, p1], [d0, d1, d2, d3])| {
        Payload::Full([0x5A, 0x5A, p0, p1, d0, d1, d2, d3])
    });
    prop_oneof![any::<[u8; 2]>().prop_map(|[p0, p1]| Payload::Short([0x5A, 0x5A, p0, p1])), full]
}

fn request() -> impl Strategy<Value = Request> {
    let bare = vec![
        Request::ReadSpeed,
        Request::ReadCurrent,
        Request::ReadVoltage,
        Request::ReadMotorTemperature,
        Request::ReadDriverTemperature,
        Request::ReadFaults,
        Request::ClearFaults,
        Request::RequestMode,
        Request::LowSpeedMode,
        Request::MediumSpeedMode,
        Request::ReadFaultRecord,
        Request::ReadAbsolutePosition,
        Request::SetAbsoluteZero,
        Request::ReadPositionLimits,
        Request::ReadRelativePosition,
        Request::SetRelativeZero,
        Request::ClearRelativePosition,
        Request::EmergencyStop,
    ];
    prop_oneof![
        8 => proptest::sample::select(bare),
        1 => (-100..=100_i16).prop_map(|signal| Request::Signal { signal: Percent(signal) }),
        1 => speed().prop_map(|speed| Request::Speed { speed }),
        1 => (1..=127_u16).prop_map(|id| Request::SetId { id }),
        1 => bitrate().prop_map(|bitrate| Request::SetBitrate { bitrate }),
        1 => timeout().prop_map(|timeout| Request::SetTimeout { timeout }),
        1 => (0..4_u8, frames()).prop_map(|(flags, frames)| Request::ConfigureReturn {
            flags: ReturnFlags::from_bits_retain(flags),
            frames,
        }),
        1 => (frames(), 0..0xEEEE_u16).prop_map(|(frames, interval)| Request::ConfigureStream {
            frames,
            interval: Milliseconds(interval),
        }),
        1 => (parameter(), data()).prop_map(|(parameter, data)| Request::SetParameter { parameter, data }),
        1 => parameter().prop_map(|parameter| Request::ReadParameter { parameter }),
        1 => absolute().prop_map(|(speed, position)| Request::AbsolutePosition { speed, position }),
        1 => limits().prop_map(|(reverse, forward)| Request::SetPositionLimits { reverse, forward }),
        1 => relative().prop_map(|(speed, position)| Request::RelativePosition { speed, position }),
        1 => unknown().prop_map(|payload| Request::Unknown { payload }),
    ]
}

fn returned() -> impl Strategy<Value = Returned> {
    let source = proptest::sample::select(vec![
        ReturnSource::Signal,
        ReturnSource::Speed,
        ReturnSource::Stream,
    ]);
    let frame = prop_oneof![
        any::<(i16, u16, i16)>().prop_map(|(speed, voltage, current)| ReturnedFrame::Motion {
            speed: Rpm(speed),
            voltage: Decivolts(voltage),
            current: Deciamps(current),
        }),
        any::<(u16, i16, i16)>().prop_map(|(faults, motor, driver)| ReturnedFrame::Condition {
            faults: Faults::from_bits_retain(faults),
            motor_temperature: Celsius(motor),
            driver_temperature: Celsius(driver),
        }),
        any::<[u8; 6]>().prop_map(|raw| ReturnedFrame::Position { raw }),
    ];
    (source, frame).prop_map(|(source, frame)| Returned { source, frame })
}

fn reply() -> impl Strategy<Value = Reply> {
    let bare = vec![
        Reply::FaultsCleared,
        Reply::RequestMode,
        Reply::LowSpeedMode,
        Reply::MediumSpeedMode,
        Reply::AbsoluteZeroSet,
        Reply::RelativeZeroSet,
        Reply::RelativePositionCleared,
        Reply::EmergencyStop,
        Reply::Refused { command: 0x5443, parameter: 0 },
        Reply::Refused { command: 0x4C52, parameter: 300 },
        Reply::Refused { command: 0x5350, parameter: 0x4C41 },
    ];
    let echoes = prop_oneof![
        (-100..=100_i16).prop_map(|signal| Reply::Signal { signal: Percent(signal) }),
        speed().prop_map(|speed| Reply::Speed { speed }),
        (1..=127_u16).prop_map(|id| Reply::Id { id }),
        bitrate().prop_map(|bitrate| Reply::Bitrate { bitrate }),
        timeout().prop_map(|timeout| Reply::Timeout { timeout }),
        (0..0xEE_u8, any::<u8>()).prop_map(|(flags, frames)| Reply::ReturnConfigured {
            flags: ReturnFlags::from_bits_retain(flags),
            frames: ReturnFrames::from_bits_retain(frames),
        }),
        (any::<u8>(), 0..0xEEEE_u16).prop_map(|(frames, interval)| Reply::StreamConfigured {
            frames: ReturnFrames::from_bits_retain(frames),
            interval: Milliseconds(interval),
        }),
        (parameter(), data()).prop_map(|(parameter, data)| Reply::ParameterSet { parameter, data }),
        absolute().prop_map(|(speed, position)| Reply::AbsolutePosition { speed, position }),
        limits().prop_map(|(reverse, forward)| Reply::PositionLimitsSet { reverse, forward }),
        relative().prop_map(|(speed, position)| Reply::RelativePosition { speed, position }),
    ];
    let values = prop_oneof![
        any::<i16>().prop_map(|speed| Reply::MeasuredSpeed { speed: Rpm(speed) }),
        any::<i16>().prop_map(|current| Reply::Current { current: Deciamps(current) }),
        any::<u16>().prop_map(|voltage| Reply::Voltage { voltage: Decivolts(voltage) }),
        any::<i16>()
            .prop_map(|temperature| Reply::MotorTemperature { temperature: Celsius(temperature) }),
        any::<i16>()
            .prop_map(|temperature| Reply::DriverTemperature { temperature: Celsius(temperature) }),
        any::<u16>().prop_map(|faults| Reply::Faults { faults: Faults::from_bits_retain(faults) }),
        any::<u16>()
            .prop_map(|faults| Reply::FaultRecord { faults: Faults::from_bits_retain(faults) }),
        (parameter(), any::<[u8; 4]>())
            .prop_map(|(parameter, data)| Reply::Parameter { parameter, data }),
        any::<i32>()
            .prop_map(|position| Reply::MeasuredPosition { position: Decidegrees(position) }),
        any::<i32>().prop_map(|position| Reply::MeasuredRelativePosition {
            position: Decidegrees(position)
        }),
        any::<(i16, i16)>().prop_map(|(reverse, forward)| Reply::PositionLimits {
            reverse: LimitDecidegrees(reverse),
            forward: LimitDecidegrees(forward),
        }),
        returned().prop_map(Reply::Returned),
        unknown().prop_map(|payload| Reply::Unknown { payload }),
    ];
    prop_oneof![proptest::sample::select(bare), echoes, values]
}

/// What of a received data field has a meaning: the zero padding of queries and sign extensions
/// have none.
fn meaning(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if let [_, _, _, _, 0xFF, 0xFF, ..] = bytes[..]
        && [*b"TC", *b"VC", *b"QV", *b"QC", *b"QT", *b"EQ"]
            .iter()
            .any(|word| bytes.starts_with(word))
    {
        bytes[4..6].fill(0);
    }
    if bytes.get(4..) == Some(&[0; 4]) {
        bytes.truncate(4);
    }
    bytes
}

proptest! {
    #[test]
    fn values_survive(node in Node::MIN..=Node::MAX, request in request(), reply in reply()) {
        let node = Node::new(node).expect("1..=127");
        let frame: CanFrame = can::request(node, &request).expect("a valid value");
        prop_assert_eq!(can::decode_request(&frame), Ok((node, request)));
        let frame: CanFrame = can::reply(node, &reply).expect("a valid value");
        prop_assert_eq!(can::decode_reply(&frame), Ok((node, reply)));
    }

    #[test]
    fn bytes_survive(bytes in data_field()) {
        if let Ok(request) = Request::decode(&bytes)
            && let Ok(payload) = request.encode()
        {
            prop_assert_eq!(meaning(payload.as_slice()), meaning(&bytes));
        }
        if let Ok(reply) = Reply::decode(&bytes)
            && let Ok(payload) = reply.encode()
        {
            prop_assert_eq!(meaning(payload.as_slice()), meaning(&bytes));
        }
        if let Ok(values) = Headerless::decode(&bytes) {
            let payload = values.encode();
            prop_assert_eq!(payload.as_slice(), &bytes);
        }
    }

    #[test]
    fn any_bytes_decode_or_name_an_error(
        bytes in proptest::collection::vec(any::<u8>(), 0..12),
        pending in request(),
        received in data_field(),
    ) {
        let valid_length = bytes.len() == 4 || bytes.len() == 8;
        prop_assert!(valid_length || Request::decode(&bytes).is_err());
        prop_assert!(valid_length || Reply::decode(&bytes).is_err());
        for bytes in [bytes, received] {
            if let Ok(request) = Request::decode(&bytes) {
                request.visit_fields(&mut |_, _| {});
            }
            if let Ok(reply) = Reply::decode(&bytes) {
                reply.visit_fields(&mut |_, _| {});
                answer(&pending, &reply);
            }
        }
    }
}
