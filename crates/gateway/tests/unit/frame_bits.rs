use super::*;
use embedded_can::{ExtendedId, StandardId};

fn standard(id: u16) -> Id {
    Id::Standard(StandardId::new(id).unwrap())
}

/// The figures of the simulator's own bits, with intermission: id 0 without data is 34 dominant
/// bits (its CRC is 0) with a stuff bit after 5, 10, … 30 of them.
#[test]
fn a_frame_that_is_known_has_its_own_length() {
    assert_eq!(frame_bits(standard(0), 0, &[]), 34 + 6 + 13);
    // 0xFF and a CRC of one more frame whose bits were stuffed by hand: 0x555 and 0xAA alternate.
    let alternating = frame_bits(standard(0x555), 0, &[]);
    assert!((34 + 13..34 + 13 + 6).contains(&alternating), "{alternating}");
}

/// Nothing known: 135 and 160 bits, F of the bounds (GUARANTEES G5); the id and the length leave
/// one or two stuff bits less.
#[test]
fn an_unknown_frame_is_at_most_the_longest_one() {
    for id in 0..0x7FF {
        let bits = frame_bits(standard(id), 8, &[]);
        assert!((128..=STANDARD_FRAME_BITS).contains(&bits), "{id:#X}: {bits}");
    }
    let extended = Id::Extended(ExtendedId::new(0).unwrap());
    assert!(frame_bits(extended, 8, &[]) <= EXTENDED_FRAME_BITS);
}

/// What more is known makes it never longer, and no frame is longer than what was said of it
/// before its bytes were known.
#[test]
fn no_frame_is_longer_than_is_said_of_what_is_known() {
    let mut word = 0x1234_5678_9ABC_DEF0_u64;
    for id in [0x141, 0x241, 0x00B, 0x7FF, 0x000] {
        for _ in 0..500 {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
            let data = (word & word.rotate_left(17)).to_le_bytes();
            let mut before = u64::MAX;
            for known in 0..=8 {
                let bits = frame_bits(standard(id), 8, &data[..known]);
                assert!(bits <= before, "{id:#X} {data:?} {known}");
                before = bits;
            }
            assert!(before >= 108 + 3);
        }
    }
}
