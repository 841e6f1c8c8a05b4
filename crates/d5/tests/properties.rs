//! What holds for every value and every byte string.

use codec_testing::{CanFrame, numbers_of};
use d5::serial::Deframer;
use d5::{
    Address, COMMANDS, Celsius, DecodeError, Degrees, DegreesPerSecond, FRAME_LEN, Node, Payload,
    REGISTERS, Reply, Request, answer, can, decode_angle, decode_frame, decode_reply_frame,
    decode_request_frame, decode_speed, decode_temperature, encode_angle, encode_speed,
    encode_temperature, reply_frame, request_frame,
};
use proptest::prelude::*;
use proptest::sample::{Index, select};

/// Five bytes between id and checksum, those of the manual often enough to be met.
fn payload() -> impl Strategy<Value = Payload> {
    let byte = |bytes: Vec<u8>| prop_oneof![select(bytes), any::<u8>()];
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

/// Bytes as a disturbed line carries them: frames, cut frames and bytes that look like the start of
/// one.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let frame = || {
        (node(), payload(), any::<bool>()).prop_map(|(node, payload, header)| {
            framed(if header { 0xD5 } else { 0x5D }, node.get(), payload)
        })
    };
    let piece = prop_oneof![
        frame().prop_map(|frame| frame.to_vec()),
        (frame(), 0..FRAME_LEN).prop_map(|(frame, len)| frame[..len].to_vec()),
        prop::collection::vec(select(vec![0xD5, 0x5D, 0x05, 0x04, 0x0B]), 0..8),
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
    /// What is built is built again from what it shows. A value may lie outside the register's
    /// range.
    #[test]
    fn built_requests_survive(info in select(COMMANDS), row in select(REGISTERS.to_vec()), pick in any::<u16>()) {
        let (min, max) = row.value_range();
        let values = [min, max, min + i64::from(pick) % (max - min + 2)];
        let fields = |field: &str| match field {
            "register" => Some(f64::from(row.register.0)),
            "value" => Some(values[usize::from(pick) % 3] as f64),
            _ => None,
        };
        let Ok(request) = Request::build(info.name, &fields) else { return Ok(()) };
        prop_assert_eq!(request.info(), Some(&info));
        prop_assert_eq!(u16::from(request.command()), info.code);
        let numbers = numbers_of(|visit| request.visit_fields(visit));
        prop_assert_eq!(Request::build(info.name, &|name| numbers.get(name).copied()), Ok(request));
        let id = can::default_request_id(Node::FACTORY);
        let frame: CanFrame = can::request(id, Address::Node(Node::FACTORY), &request).expect("encodable");
        prop_assert_eq!(can::decode_request(&frame), Ok((Address::Node(Node::FACTORY), request)));
    }

    /// `Unknown` does not get around the checks of the variants.
    #[test]
    fn bytes_survive(id in prop_oneof![Just(0x0B), Just(0xFE), any::<u8>()], payload in payload()) {
        if let Ok((address, request)) = decode_request_frame(&framed(0xD5, id, payload)) {
            prop_assert_eq!(Request::decode(&payload), Ok(request));
            if let Ok(sent) = request_frame(address, &request) {
                prop_assert_eq!(sent, framed(0xD5, id, payload));
            }
        }
        let is_unknown = matches!(Request::decode(&payload), Ok(Request::Unknown { .. }));
        prop_assert_eq!(Request::Unknown { raw: payload }.encode().is_ok(), is_unknown);
        let is_unknown = matches!(Reply::decode(&payload), Ok(Reply::Unknown { .. }));
        prop_assert_eq!(Reply::Unknown { raw: payload }.encode().is_ok(), is_unknown);
        if let Ok((node, reply)) = decode_reply_frame(&framed(0x5D, id, payload)) {
            prop_assert_eq!(Reply::decode(&payload), Ok(reply));
            prop_assert_eq!(reply_frame(node, &reply), Ok(framed(0x5D, id, payload)));
        }
    }

    #[test]
    fn any_bytes_decode_or_name_an_error(
        bytes in any::<[u8; 8]>(),
        payload in payload(),
        sent in payload(),
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
            if let Ok(pending) = Request::decode(&sent) {
                answer(&pending, node, node, &reply);
            }
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
    fn the_deframer_finds_what_a_search_finds(line in line(), split in any::<Index>()) {
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
