//! What holds for every value and every byte string.

use codec_testing::{CanFrame, fields_in_range, numbers_of};
use embedded_can::{Frame, StandardId};
use proptest::prelude::*;
use proptest::sample::{Index, select};
use rmd::rs485::{self, Deframer, FRAME_LEN, Piece, Scan};
use rmd::{
    Answer, BuildError, COMMANDS, DecodeError, Dialect, Dialects, EncodeError, Node, Reply,
    Request, answer, answer_on_line, can,
};

/// Bytes as a disturbed line carries them: frames, cut frames and bytes that look like the start of
/// one.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let frame = (Node::MIN..=Node::MAX, data()).prop_map(|(node, data)| {
        let node = Node::new(node).expect("1..=32");
        let frame = rs485::request(node, &Request::decode(&data));
        frame.or(rs485::broadcast(&Request::Stop)).expect("a stop is sent").to_vec()
    });
    let cut = (data(), 0..FRAME_LEN)
        .prop_map(|(data, len)| [&[0x3E, 1, 8], &data[..]].concat()[..len.min(11)].to_vec());
    let piece = prop_oneof![
        2 => frame,
        1 => cut,
        1 => prop::collection::vec(select(vec![0x3E, 0x01, 0x08, 0x00, 0x9C]), 0..8),
        1 => prop::collection::vec(any::<u8>(), 0..8),
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

/// Functions 6 and 7 of 0x20 exist in no version.
#[test]
fn a_function_without_meaning_is_refused_as_such() {
    for index in [6, 7] {
        let refused = Request::decode(&[0x20, index, 0, 0, 1, 0, 0, 0]).encode();
        let Err(EncodeError::Forbidden { field, reason, .. }) = refused else {
            panic!("{refused:?}")
        };
        assert_eq!(
            (field, reason),
            ("function_index", "no version of the protocol has this function")
        );
    }
}

/// Eight bytes that begin with a command more often than not.
fn data() -> impl Strategy<Value = [u8; 8]> {
    let commands =
        COMMANDS.iter().filter_map(|info| u8::try_from(info.code).ok()).collect::<Vec<_>>();
    let command = prop_oneof![select(commands), any::<u8>()];
    let small = prop_oneof![any::<u8>(), 0..5_u8];
    (command, small, any::<[u8; 2]>(), prop_oneof![any::<[u8; 4]>(), Just([1, 0, 0, 0])])
        .prop_map(|(command, b1, [b2, b3], [b4, b5, b6, b7])| [command, b1, b2, b3, b4, b5, b6, b7])
}

proptest! {
    /// What is built shows the fields of its row, and is built from them again. Motion mode is left
    /// out: its words are read by other divisors than written (RMD V3.6 §5.4).
    #[test]
    fn built_requests_survive(info in select(COMMANDS), picks in any::<[u16; 5]>()) {
        let node = Node::new(1).expect("1..=32");
        let request = match Request::build(info.name, &fields_in_range(&info, &picks)) {
            Ok(request) => request,
            // Two indexes between those of gains have none.
            Err(BuildError::Encode(EncodeError::Forbidden { field: "index", value: 3 | 6, .. })) => return Ok(()),
            Err(error) => {
                prop_assert_eq!(info.name, "timeout_notice", "{}", error);
                return Ok(());
            }
        };
        prop_assert_eq!(request.info(), Some(&info));
        prop_assert_eq!(u16::from(request.command()), info.code);
        let numbers = numbers_of(|visit| request.visit_fields(visit));
        prop_assert!(info.request.iter().all(|field| numbers.contains_key(field.name)), "{:?}", numbers);
        prop_assert_eq!(numbers.len(), info.request.len());
        if info.name != "motion_mode" {
            prop_assert_eq!(Request::build(info.name, &|name| numbers.get(name).copied()), Ok(request));
        }
        let on_can = can::request::<CanFrame>(node, &request).map(|frame| can::decode_any_request(&frame));
        let on_rs485 = rs485::request(node, &request).map(|frame| rs485::decode_any_request(&frame));
        prop_assert!(on_can.is_ok() || on_rs485.is_ok());
        let is_under_own_id = matches!(info.name, "motion_mode") || info.code == 0x79;
        for dialect in request.dialects().iter().filter(|_| !is_under_own_id) {
            if let Ok(data) = request.encode_in(dialect) {
                prop_assert_eq!(Request::decode_in(dialect, &data), request);
            }
        }
        let has_old_form = request.dialects().iter().any(|dialect| dialect == Dialect::V3_6);
        for decoded in [on_can, on_rs485].into_iter().flatten().filter(|_| has_old_form) {
            prop_assert_eq!(decoded.map(|(_, request)| request), Ok(request));
        }
    }

    /// Decoded and encoded again, every bit with a meaning is still there; only values out of range
    /// are not encoded. `Unknown` does not get around these checks.
    #[test]
    fn meaning_survives(data in data()) {
        let request = Request::decode(&data);
        match request.encode() {
            Ok(again) => {
                prop_assert_eq!(again, meaning(data));
                prop_assert_eq!(Request::decode(&again), request);
            }
            Err(EncodeError::OutOfRange { .. }) => {}
            // Two indexes between those of functions have none.
            Err(EncodeError::Forbidden { field: "function_index", value: 6 | 7, .. }) => {}
            Err(error) => prop_assert!(matches!(request, Request::Unknown { .. }), "{}", error),
        }
        let is_unknown = Request::dialects_of(&data) == Dialects::NONE;
        let is_passed_over = matches!(request, Request::Unknown { .. });
        prop_assert!(is_passed_over || !is_unknown);
        prop_assert_eq!(Request::Unknown { data }.encode().is_ok(), is_unknown);
        for dialect in Dialect::ALL {
            let request = Request::decode_in(dialect, &data);
            if let Ok(again) = request.encode_in(dialect) {
                prop_assert_eq!(Request::decode_in(dialect, &again), request);
            }
            let reply = Reply::decode_in(dialect, &data).expect("eight bytes");
            let _ = (answer(&request, &reply), reply.encode());
        }

        let reply = Reply::decode(&data).expect("eight bytes");
        match reply.encode() {
            Ok(again) => {
                prop_assert_eq!(again, reply_meaning(data));
                prop_assert_eq!(Reply::decode(&again), Ok(reply));
            }
            Err(EncodeError::Forbidden { field: "function_index", value: 6 | 7, .. }) => {}
            Err(error) => prop_assert!(matches!(error, EncodeError::OutOfRange { .. }), "{}", error),
        }
        let is_unknown = matches!(reply, Reply::Unknown { .. });
        prop_assert_eq!(Reply::Unknown { data }.encode().is_ok(), is_unknown);
    }

    /// On either bus a frame is decoded to what its data say, and encoded to itself.
    #[test]
    fn frames_survive(node in Node::MIN..=Node::MAX, data in data()) {
        let node = Node::new(node).expect("1..=32");
        let request = Request::decode(&data);
        if let Ok(frame) = can::request::<CanFrame>(node, &request) {
            prop_assert_eq!(can::decode_request(&frame), Ok((node, request)));
        }
        if let Ok(frame) = rs485::request(node, &request) {
            prop_assert_eq!(rs485::decode_request(&frame), Ok((node, request)));
        }
        let reply = Reply::decode(&data).expect("eight bytes");
        if reply.encode().is_ok() {
            let frame: CanFrame = can::reply(node, &reply).expect("encodable");
            prop_assert_eq!(can::decode_reply(&frame), Ok((node, reply)));
            let frame = rs485::reply(node, &reply).expect("encodable");
            prop_assert_eq!(rs485::decode_reply(&frame), Ok((node, reply)));
        }
    }

    #[test]
    fn no_bytes_panic(
        id in prop_oneof![Just(0x300), 0..0x800_u16],
        data in prop::collection::vec(any::<u8>(), 0..=8),
        sent in data(),
        frame in any::<[u8; FRAME_LEN]>(),
    ) {
        let request = Request::decode(&sent);
        request.visit_fields(&mut |_, _| ());
        let frame_of_can = CanFrame::new(StandardId::new(id).expect("11 bits"), &data).expect("8 bytes");
        if let Ok((_, request)) = can::decode_any_request(&frame_of_can) {
            request.visit_fields(&mut |_, _| ());
        }
        let on_can = can::decode_reply(&frame_of_can).map(|(_, reply)| reply);
        for reply in [on_can, Reply::decode(&data)].into_iter().flatten() {
            let echo = answer_on_line(&request, &reply, true) == Answer::Echo;
            prop_assert!(echo || answer(&request, &reply) == answer_on_line(&request, &reply, true));
            let _ = reply.encode();
            reply.visit_fields(&mut |_, _| ());
        }
        let _ = (rs485::decode_any_request(&frame), rs485::decode_reply(&frame));
    }

    #[test]
    fn the_deframer_and_the_scan_find_what_a_search_finds(line in line(), cut in any::<Index>()) {
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
