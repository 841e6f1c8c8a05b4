//! What holds for every value and every byte string.

use codec_testing::{CanFrame, fields_in_range, numbers_of};
use proptest::prelude::*;
use proptest::sample::select;
use thruster::{COMMANDS, Headerless, Node, Payload, Reply, Request, answer, can};

/// Any command word, the named ones often; `EE EE` and sign extensions often enough to be met.
fn data_field() -> impl Strategy<Value = Vec<u8>> {
    let word = |words: Vec<u16>| prop_oneof![select(words), any::<u16>()];
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
    /// What is built shows the fields of its row, and is built from them again.
    #[test]
    fn built_requests_survive(node in Node::MIN..=Node::MAX, info in select(COMMANDS), picks in any::<[u16; 2]>()) {
        let node = Node::new(node).expect("1..=127");
        let Ok(request) = Request::build(info.name, &fields_in_range(&info, &picks)) else { return Ok(()) };
        prop_assert_eq!(request.info(), Some(&info));
        prop_assert_eq!(request.command(), info.code);
        let numbers = numbers_of(|visit| request.visit_fields(visit));
        prop_assert!(info.request.iter().all(|field| numbers.contains_key(field.name)), "{:?}", numbers);
        prop_assert_eq!(numbers.len(), info.request.len());
        prop_assert_eq!(Request::build(info.name, &|name| numbers.get(name).copied()), Ok(request));
        let frame: CanFrame = can::request(node, &request).expect("encodable");
        prop_assert_eq!(can::decode_request(&frame), Ok((node, request)));
    }

    /// `Unknown` does not get around the checks of the variants.
    #[test]
    fn bytes_survive(node in Node::MIN..=Node::MAX, bytes in data_field()) {
        let node = Node::new(node).expect("1..=127");
        if let Ok(request) = Request::decode(&bytes)
            && let Ok(payload) = request.encode()
        {
            prop_assert_eq!(meaning(payload.as_slice()), meaning(&bytes));
            let frame: CanFrame = can::request(node, &request).expect("encodable");
            prop_assert_eq!(can::decode_request(&frame), Ok((node, request)));
        }
        if let Ok(reply) = Reply::decode(&bytes)
            && let Ok(payload) = reply.encode()
        {
            prop_assert_eq!(meaning(payload.as_slice()), meaning(&bytes));
            let frame: CanFrame = can::reply(node, &reply).expect("encodable");
            prop_assert_eq!(can::decode_reply(&frame), Ok((node, reply)));
        }
        if let Ok(payload) = Payload::try_from(bytes.as_slice()) {
            let is_unknown = matches!(Reply::decode(&bytes), Ok(Reply::Unknown { .. }));
            prop_assert_eq!(Reply::Unknown { payload }.encode().is_ok(), is_unknown);
            let is_refusal = bytes.ends_with(&[0, 0, 0xEE, 0xEE]) && bytes.len() == 8;
            let is_unknown = matches!(Request::decode(&bytes), Ok(Request::Unknown { .. }));
            prop_assert_eq!(Request::Unknown { payload }.encode().is_ok(), is_unknown && !is_refusal);
        }
        if let Ok(values) = Headerless::decode(&bytes) {
            let payload = values.encode();
            prop_assert_eq!(payload.as_slice(), &bytes);
        }
    }

    #[test]
    fn any_bytes_decode_or_name_an_error(
        bytes in proptest::collection::vec(any::<u8>(), 0..12),
        sent in data_field(),
        received in data_field(),
    ) {
        let valid_length = bytes.len() == 4 || bytes.len() == 8;
        prop_assert!(valid_length || Request::decode(&bytes).is_err());
        prop_assert!(valid_length || Reply::decode(&bytes).is_err());
        let pending = Request::decode(&sent);
        for bytes in [bytes, received] {
            if let Ok(request) = Request::decode(&bytes) {
                request.visit_fields(&mut |_, _| {});
            }
            if let Ok(reply) = Reply::decode(&bytes) {
                reply.visit_fields(&mut |_, _| {});
                if let Ok(pending) = &pending {
                    answer(pending, &reply);
                }
            }
        }
    }
}
