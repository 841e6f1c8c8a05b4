//! What holds for every value and every byte string.

use codec::testing::CanFrame;
use d5::serial::Deframer;
use d5::{
    Access, Address, Celsius, DecodeError, Degrees, DegreesPerSecond, FRAME_LEN, MotorError, Node,
    Payload, REGISTERS, Register, RegisterInfo, Reply, Request, TurnDegrees, Value, Width, answer,
    can, decode_angle, decode_frame, decode_reply_frame, decode_request_frame, decode_speed,
    decode_temperature, encode_angle, encode_speed, encode_temperature, reply_frame, request_frame,
};
use embedded_can::StandardId;
use proptest::prelude::*;

/// Five bytes between id and checksum, those of the manual often enough to be met.
fn payload() -> impl Strategy<Value = Payload> {
    let byte = |bytes: Vec<u8>| prop_oneof![proptest::sample::select(bytes), any::<u8>()];
    let address =
        byte(vec![0x00, 0x01, 0x03, 0x07, 0x10, 0x12, 0x15, 0x20, 0x26, 0x57, 0xCC, 0xFF]);
    let data = || byte(vec![0x00, 0x34, 0x56, 0xEE, 0xCC, 0xFF]);
    (byte(vec![4, 5]), byte(vec![0, 1, 2, 3, 4, 5, 6, 0xCE, 0xCF, 0xD4]), address, data(), data())
        .prop_map(|(length, command, address, low, high)| {
            Payload([length, command, address, low, high])
        })
}

/// The frame of these bytes with the right checksum.
fn framed(header: u8, id: u8, Payload([length, command, address, low, high]): Payload) -> [u8; 8] {
    let sum = [id, length, command, address, low, high].into_iter().fold(0, u8::wrapping_add);
    [header, id, length, command, address, low, high, sum]
}

fn node() -> impl Strategy<Value = Node> {
    (Node::MIN..=Node::MAX).prop_map(|node| Node::new(node).expect("01..=FD"))
}

fn value() -> impl Strategy<Value = Value> {
    prop_oneof![any::<u8>().prop_map(Value::Byte), any::<u16>().prop_map(Value::Word)]
}

/// A register that may be written, and a value that it takes.
fn write() -> impl Strategy<Value = (Register, Value)> {
    let writable: Vec<&RegisterInfo> =
        REGISTERS.iter().filter(|info| info.access == Access::ReadWrite).collect();
    proptest::sample::select(writable).prop_flat_map(|info| {
        let (min, max) = info.value_range();
        (min..=max)
            .prop_map(move |value| (info.register, info.encode(value).expect("in its range")))
    })
}

fn request() -> impl Strategy<Value = Request> {
    let bare = vec![
        Request::QueryId,
        Request::Execute,
        Request::Reset,
        Request::ReadMagneticAngle,
        Request::SelfTest,
        Request::FaultySelfTest,
    ];
    prop_oneof![
        3 => proptest::sample::select(bare),
        1 => proptest::sample::select(REGISTERS.to_vec())
            .prop_map(|info| Request::Read { register: info.register, width: info.width }),
        1 => (0x30..=0x4F_u8, any::<bool>()).prop_map(|(register, word)| Request::Read {
            register: Register(register),
            width: if word { Width::Word } else { Width::Byte },
        }),
        2 => write().prop_map(|(register, value)| Request::Write { register, value }),
        1 => write().prop_map(|(register, value)| Request::AsyncWrite { register, value }),
        1 => any::<[u8; 3]>()
            .prop_map(|[address, low, high]| Request::Unknown { raw: Payload([5, 0xAA, address, low, high]) }),
    ]
}

fn reply() -> impl Strategy<Value = Reply> {
    // EE EE at these addresses is an error.
    let stored = (0x10..=0xFF_u8, value());
    let stored = stored.prop_map(|(register, value)| (Register(register), value));
    let errors = vec![MotorError::Id, MotorError::Command, MotorError::Checksum];
    prop_oneof![
        2 => proptest::sample::select(vec![Reply::Id, Reply::ResetDone]),
        4 => (stored, 0..4_u8).prop_map(|((register, value), command)| match command {
            0 => Reply::Read { register, value },
            1 => Reply::Written { register, value },
            2 => Reply::AsyncWritten { register, value },
            _ => Reply::Executed { register, value },
        }),
        1 => any::<u16>().prop_map(|angle| Reply::MagneticAngle { angle: TurnDegrees(angle) }),
        1 => (proptest::sample::select(errors), any::<u8>())
            .prop_map(|(error, command)| Reply::Error { error, command }),
        1 => (0x10..=0xFF_u8, any::<[u8; 2]>())
            .prop_map(|(address, [low, high])| Reply::SelfTest { raw: Payload([5, 0xCF, address, low, high]) }),
        1 => (0x10..=0xFF_u8, any::<[u8; 2]>())
            .prop_map(|(address, [low, high])| Reply::Unknown { raw: Payload([4, 0xAA, address, low, high]) }),
    ]
}

/// Bytes as a disturbed line carries them: frames, cut frames and bytes that look like the start of
/// one.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        (node(), request()).prop_map(|(node, request)| request_frame(
            Address::Node(node),
            &request
        )
        .expect("valid")
        .to_vec()),
        (node(), reply(), 0..FRAME_LEN).prop_map(|(node, reply, len)| reply_frame(node, &reply)
            .expect("valid")[..len]
            .to_vec()),
        prop::collection::vec(prop::sample::select(vec![0xD5, 0x5D, 0x05, 0x04, 0x0B]), 0..8),
        prop::collection::vec(any::<u8>(), 0..8),
    ];
    prop::collection::vec(piece, 0..8).prop_map(|pieces| pieces.concat())
}

/// The frames of a whole recording, found by trying every position.
fn frames_of(mut line: &[u8]) -> Vec<[u8; FRAME_LEN]> {
    let mut frames = Vec::new();
    while let Some(frame) = line.first_chunk::<FRAME_LEN>() {
        let has_length = matches!(frame[2], 4 | 5);
        let refused = decode_frame(frame).err();
        let is_frame =
            !matches!(refused, Some(DecodeError::Header { .. } | DecodeError::Checksum { .. }))
                && has_length;
        if is_frame {
            frames.push(*frame);
        }
        line = &line[if is_frame { FRAME_LEN } else { 1 }..];
    }
    frames
}

proptest! {
    #[test]
    fn messages_survive(id in 0..0x800_u16, node in node(), request in request(), reply in reply()) {
        let id = StandardId::new(id).expect("11 bits");
        let frame: CanFrame = can::request(id, Address::Node(node), &request).expect("a valid value");
        prop_assert_eq!(can::decode_request(&frame), Ok((Address::Node(node), request)));
        let frame: CanFrame = can::reply(id, node, &reply).expect("a valid value");
        prop_assert_eq!(can::decode_reply(&frame), Ok((node, reply)));
    }

    #[test]
    fn bytes_survive(id in prop_oneof![Just(0x0B), Just(0xFE), any::<u8>()], payload in payload()) {
        if let Ok((address, request)) = decode_request_frame(&framed(0xD5, id, payload)) {
            prop_assert_eq!(Request::decode(&payload), Ok(request));
            if let Ok(sent) = request_frame(address, &request) {
                prop_assert_eq!(sent, framed(0xD5, id, payload));
            }
        }
        if let Ok((node, reply)) = decode_reply_frame(&framed(0x5D, id, payload)) {
            prop_assert_eq!(Reply::decode(&payload), Ok(reply));
            prop_assert_eq!(reply_frame(node, &reply), Ok(framed(0x5D, id, payload)));
        }
    }

    #[test]
    fn any_bytes_decode_or_name_an_error(
        bytes in any::<[u8; 8]>(),
        payload in payload(),
        pending in request(),
        node in node(),
    ) {
        let [header, ..] = bytes;
        prop_assert!(header == 0xD5 || decode_request_frame(&bytes).is_err());
        prop_assert!(header == 0x5D || decode_reply_frame(&bytes).is_err());
        if let Ok(request) = Request::decode(&payload) {
            request.visit_fields(&mut |_, _| {});
        }
        if let Ok(reply) = Reply::decode(&payload) {
            reply.visit_fields(&mut |_, _| {});
            answer(&pending, node, node, &reply);
        }
    }

    #[test]
    fn units_survive_the_wire(speed in -32_767_i16..=32_767, temperature in -127_i8..=127) {
        let angle = Degrees(speed);
        let (speed, temperature) = (DegreesPerSecond(speed), Celsius(temperature));
        prop_assert_eq!(encode_speed(speed).map(decode_speed), Ok(speed));
        prop_assert_eq!(encode_angle(angle).map(decode_angle), Ok(angle));
        prop_assert_eq!(encode_temperature(temperature).map(decode_temperature), Ok(temperature));
    }

    #[test]
    fn the_deframer_finds_what_a_search_finds(line in line(), split in any::<prop::sample::Index>()) {
        let mut deframer = Deframer::new();
        let (first, second) = line.split_at(split.index(line.len() + 1));
        let mut frames: Vec<_> = deframer.push_slice(first).collect();
        frames.extend(deframer.push_slice(second));
        prop_assert_eq!(&frames, &frames_of(&line));
        let dropped = usize::try_from(deframer.rejected()).expect("small");
        prop_assert!(deframer.pending() < FRAME_LEN);
        prop_assert_eq!(frames.len() * FRAME_LEN + dropped + deframer.pending(), line.len());
    }
}
