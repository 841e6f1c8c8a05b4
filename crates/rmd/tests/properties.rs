//! What holds for every value and every byte string.

mod values;

use std::collections::BTreeMap;

use codec::testing::CanFrame;
use embedded_can::{Frame, StandardId};
use proptest::prelude::*;
use rmd::rs485::{self, Deframer, FRAME_LEN, Piece, Scan};
use rmd::{
    DecodeError, EncodeError, FieldValue, Reply, Request, Target, answer, answer_on_line, can,
};
use values::{node, reply, request, special_reply, special_request};

/// Bytes as a disturbed line carries them: frames, cut frames and bytes that look like the start of
/// one.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        (node(), request())
            .prop_map(|(node, value)| rs485::request(node, &value).expect("encodable").to_vec()),
        request().prop_map(|value| rs485::broadcast(&value).expect("encodable").to_vec()),
        (node(), reply(), 0..FRAME_LEN).prop_map(|(node, value, len)| {
            rs485::reply(node, &value).expect("encodable")[..len].to_vec()
        }),
        prop::collection::vec(prop::sample::select(vec![0x3E, 0x01, 0x08, 0x00, 0x9C]), 0..8),
        prop::collection::vec(any::<u8>(), 0..8),
    ];
    prop::collection::vec(piece, 0..8).prop_map(|pieces| pieces.concat())
}

/// The frames of a whole recording, found by trying every position.
fn frames_of(mut line: &[u8]) -> Vec<[u8; FRAME_LEN]> {
    let mut frames = Vec::new();
    while let Some(frame) = line.first_chunk::<FRAME_LEN>() {
        let damaged = matches!(
            rs485::decode_reply(frame),
            Err(DecodeError::Header { .. }
                | DecodeError::Length { .. }
                | DecodeError::Checksum { .. })
        );
        if !damaged {
            frames.push(*frame);
        }
        line = &line[if damaged { 1 } else { FRAME_LEN }..];
    }
    frames
}

/// A request's data without the bytes that mean nothing, by the tables of RMD V3.6 §2.
fn meaning(data: [u8; 8]) -> [u8; 8] {
    let mask: [u8; 8] = match data[0] {
        0x31 | 0x32 => [1, 0, 1, 1, 1, 1, 1, 1],
        0x20 | 0x43 => [1, 1, 0, 0, 1, 1, 1, 1],
        0x63 | 0xA2 | 0xA3 | 0xB3 => [1, 0, 0, 0, 1, 1, 1, 1],
        0xA1 => [1, 0, 0, 0, 1, 1, 0, 0],
        0xA4 | 0xA5 | 0xA8 => [1, 0, 1, 1, 1, 1, 1, 1],
        0xB4 => [1, 0, 0, 0, 0, 0, 0, 1],
        0x30
        | 0x42
        | 0x60..=0x62
        | 0x64
        | 0x70
        | 0x71
        | 0x76..=0x78
        | 0x80
        | 0x81
        | 0x92
        | 0x9A
        | 0x9C
        | 0x9D
        | 0xB1
        | 0xB2
        | 0xB5 => [1, 0, 0, 0, 0, 0, 0, 0],
        _ => [1; 8],
    };
    std::array::from_fn(|at| data[at] * mask[at])
}

/// The same of replies, where the brake byte of 0x9A counts as locked or not.
fn reply_meaning(data: [u8; 8]) -> [u8; 8] {
    let mask: [u8; 8] = match data[0] {
        0x30..=0x32 => [1, 0, 1, 1, 1, 1, 1, 1],
        0x20 | 0x43 => [1, 1, 0, 0, 1, 1, 1, 1],
        0x42 | 0x60..=0x64 | 0x92 | 0xB1..=0xB3 => [1, 0, 0, 0, 1, 1, 1, 1],
        0x9A => [1, 1, 0, 1, 1, 1, 1, 1],
        0x70 => [1, 0, 0, 0, 0, 0, 0, 1],
        0x71 => [1, 0, 0, 0, 0, 0, 1, 1],
        0x77 | 0x78 | 0x80 | 0x81 => [1, 0, 0, 0, 0, 0, 0, 0],
        _ => [1; 8],
    };
    let mut kept: [u8; 8] = std::array::from_fn(|at| data[at] * mask[at]);
    if data[0] == 0x9A {
        kept[3] = kept[3].min(1);
    }
    kept
}

fn is_range_error(error: EncodeError) -> bool {
    matches!(error, EncodeError::OutOfRange { .. })
}

/// Eight bytes that begin with a command more often than not.
fn data() -> impl Strategy<Value = [u8; 8]> {
    let commands =
        rmd::COMMANDS.iter().filter_map(|info| u8::try_from(info.code).ok()).collect::<Vec<_>>();
    let command = prop_oneof![prop::sample::select(commands), any::<u8>()];
    let small = prop_oneof![any::<u8>(), 0..5_u8];
    (command, small, any::<[u8; 2]>(), prop_oneof![any::<[u8; 4]>(), Just([1, 0, 0, 0])])
        .prop_map(|(command, b1, [b2, b3], [b4, b5, b6, b7])| [command, b1, b2, b3, b4, b5, b6, b7])
}

proptest! {
    #[test]
    fn values_survive(node in node(), request in request(), reply in reply()) {
        prop_assert_eq!(Request::decode(&request.encode().expect("encodable")), request);
        prop_assert_eq!(Reply::decode(&reply.encode().expect("encodable")), Ok(reply));

        let frame: CanFrame = can::request(node, &request).expect("encodable");
        prop_assert_eq!(can::decode_request(&frame), Ok((node, request)));
        let frame: CanFrame = can::broadcast(&request).expect("encodable");
        prop_assert_eq!(can::decode_any_request(&frame), Ok((Target::All, request)));
        let frame: CanFrame = can::reply(node, &reply).expect("encodable");
        prop_assert_eq!(can::decode_reply(&frame), Ok((node, reply)));

        let frame = rs485::request(node, &request).expect("encodable");
        prop_assert_eq!(rs485::decode_request(&frame), Ok((node, request)));
        let frame = rs485::reply(node, &reply).expect("encodable");
        prop_assert_eq!(rs485::decode_reply(&frame), Ok((node, reply)));
    }

    #[test]
    fn values_under_ids_of_their_own_survive(
        node in node(),
        request in special_request(),
        (from, reply) in special_reply(),
    ) {
        let on_can = can::request::<CanFrame>(node, &request).map(|frame| can::decode_any_request(&frame));
        let on_rs485 = rs485::request(node, &request).map(|frame| rs485::decode_any_request(&frame));
        prop_assert!(on_can.is_ok() != on_rs485.is_ok());
        let target = match request {
            Request::MotionMode { .. } => Target::Node(node),
            _ => Target::All,
        };
        prop_assert_eq!(on_can.or(on_rs485), Ok(Ok((target, request))));

        let on_can = can::reply::<CanFrame>(from, &reply).map(|frame| can::decode_reply(&frame));
        let on_rs485 = rs485::reply(from, &reply).map(|frame| rs485::decode_reply(&frame));
        prop_assert!(on_can.is_ok() != on_rs485.is_ok());
        prop_assert_eq!(on_can.or(on_rs485), Ok(Ok((from, reply))));
    }

    /// Decoded and encoded again, every bit with a meaning is still there; only values out of range are not encoded.
    #[test]
    fn meaning_survives(data in data()) {
        match Request::decode(&data).encode() {
            Ok(again) => prop_assert_eq!(again, meaning(data)),
            Err(error) => prop_assert!(is_range_error(error), "{}", error),
        }
        match Reply::decode(&data).expect("eight bytes").encode() {
            Ok(again) => prop_assert_eq!(again, reply_meaning(data)),
            Err(error) => prop_assert!(is_range_error(error), "{}", error),
        }
    }

    /// What a tool shows of a request builds that request again. Motion mode is left out: its words are converted by
    /// other divisors one way than the other (RMD V3.6 §5.4).
    #[test]
    fn shown_fields_build_the_request(request in prop_oneof![request(), special_request()]) {
        let mut fields = BTreeMap::new();
        request.visit_fields(&mut |name, value| {
            let number = match value {
                FieldValue::Integer(value) => value as f64,
                FieldValue::Physical(value) => value,
                FieldValue::Bool(value) => f64::from(u8::from(value)),
                _ => return,
            };
            fields.insert(name, number);
        });
        if !matches!(request, Request::Unknown { .. } | Request::MotionMode { .. }) {
            prop_assert_eq!(Request::build(request.name(), &|name| fields.get(name).copied()), Ok(request));
        }
    }

    #[test]
    fn no_bytes_panic(
        id in 0..0x800_u16,
        data in prop::collection::vec(any::<u8>(), 0..=8),
        sent in data(),
        frame in any::<[u8; FRAME_LEN]>(),
    ) {
        let request = Request::decode(&sent);
        if let Ok(reply) = Reply::decode(&data) {
            let _ = (reply.encode(), answer(&request, &reply), answer_on_line(&request, &reply, true));
            reply.visit_fields(&mut |_, _| ());
        }
        request.visit_fields(&mut |_, _| ());
        let can_frame = CanFrame::new(StandardId::new(id).expect("11 bits"), &data).expect("at most 8 bytes");
        if let Ok((_, request)) = can::decode_any_request(&can_frame) {
            request.visit_fields(&mut |_, _| ());
        }
        if let Ok((_, reply)) = can::decode_reply(&can_frame) {
            let _ = answer(&request, &reply);
            reply.visit_fields(&mut |_, _| ());
        }
        let _ = (rs485::decode_any_request(&frame), rs485::decode_reply(&frame));
    }

    #[test]
    fn the_deframer_and_the_scan_find_what_a_search_finds(line in line(), cut in any::<prop::sample::Index>()) {
        let mut deframer = Deframer::new();
        let frames: Vec<_> = deframer.push_slice(&line).collect();
        prop_assert_eq!(&frames, &frames_of(&line));
        let dropped = usize::try_from(deframer.rejected()).expect("small");
        prop_assert!(deframer.pending() < FRAME_LEN);
        prop_assert_eq!(frames.len() * FRAME_LEN + dropped + deframer.pending(), line.len());

        let mut scan = Scan::new(&line);
        let (mut scanned, mut garbage) = (Vec::new(), 0);
        for piece in scan.by_ref() {
            match piece {
                Piece::Frame(frame) => scanned.push(*frame),
                Piece::Garbage(bytes) => garbage += bytes.len(),
            }
        }
        prop_assert_eq!(&scanned, &frames);
        prop_assert_eq!((garbage, scan.rest().len()), (dropped, deframer.pending()));

        // The same bytes in two parts: what the first leaves goes in front of the second.
        let (first, second) = line.split_at(cut.index(line.len() + 1));
        let mut scan = Scan::new(first);
        let count = scan.by_ref().filter(|piece| matches!(piece, Piece::Frame(_))).count();
        let second = [scan.rest(), second].concat();
        let count = count + Scan::new(&second).filter(|piece| matches!(piece, Piece::Frame(_))).count();
        prop_assert_eq!(count, frames.len());
    }
}
