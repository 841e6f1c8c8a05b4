//! Properties over arbitrary bytes.

use proptest::prelude::*;
use thruster::{Reply, Request};

/// Any command word, the named ones often; `EE EE` and sign extensions often enough to be met.
fn data_field() -> impl Strategy<Value = Vec<u8>> {
    let word = |words: Vec<u16>| prop_oneof![proptest::sample::select(words), any::<u16>()];
    let commands =
        [b"TC", b"VC", b"QV", b"QC", b"QP", b"QT", b"EQ", b"EF", b"CF", b"FR", b"ST", b"LA", b"QA", b"LS"];
    let commands = commands.iter().map(|letters| u16::from_be_bytes(**letters)).collect();
    let words = (word(commands), word(vec![0]), word(vec![0, 0xFFFF]), word(vec![0, 0xEEEE]));
    (words, 0..=9_usize).prop_map(|((command, parameter, upper, lower), len)| {
        let mut bytes = [command, parameter, upper, lower, 0].map(u16::to_be_bytes).concat();
        bytes.truncate(if len < 4 { 8 } else { len });
        bytes
    })
}

proptest! {
    #[test]
    fn what_decodes_and_encodes_decodes_to_itself(bytes in data_field()) {
        if let Ok(request) = Request::decode(&bytes)
            && let Ok(payload) = request.encode()
        {
            prop_assert_eq!(Request::decode(payload.as_slice()), Ok(request));
        }
        if let Ok(reply) = Reply::decode(&bytes)
            && let Ok(payload) = reply.encode()
        {
            prop_assert_eq!(Reply::decode(payload.as_slice()), Ok(reply));
        }
    }

    #[test]
    fn any_bytes_decode_or_name_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..12)) {
        let valid_length = bytes.len() == 4 || bytes.len() == 8;
        prop_assert!(valid_length || Request::decode(&bytes).is_err());
        prop_assert!(valid_length || Reply::decode(&bytes).is_err());
    }
}
