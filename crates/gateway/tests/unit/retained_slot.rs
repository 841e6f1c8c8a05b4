//! Tests of `retained/slot.rs`.

use super::*;

const SLOT: Slot = Slot { at: 3, payload: 2 };
const COPY: usize = SLOT.payload + FRAME_WORDS;
const MEMORY: usize = SLOT.at + Slot::words(SLOT.payload);

fn write(words: &mut [u32], generation: u32, payload: &[u32]) {
    SLOT.write(generation, payload, &mut |index, word| words[index] = word);
}

fn written(generation: u32, payload: &[u32]) -> [u32; MEMORY] {
    let mut words = [0; MEMORY];
    write(&mut words, generation, payload);
    words
}

#[track_caller]
fn assert_read(words: &[u32], torn: bool, newest: Option<(u32, &[u32])>, condition: Condition) {
    assert_eq!(SLOT.read(words, torn), Found { newest, condition }, "torn: {torn}");
}

#[test]
fn the_bytes_of_a_slot_are_these() {
    // CRC-32C of the words 3, 1, 7, 8, little-endian.
    let copy = [1, 7, 8, 0x6CE4_48CB];
    assert_eq!(written(1, &[7, 8]), [0, 0, 0, copy[0], 7, 8, copy[3], copy[0], 7, 8, copy[3]]);
}

#[test]
fn what_was_never_written_is_nothing_and_sound() {
    for torn in [false, true] {
        assert_read(&[0; MEMORY], torn, None, Condition::Sound);
        assert_read(&[], torn, None, Condition::Sound);
    }
}

#[test]
fn a_write_cut_short_at_any_word_leaves_what_was_before_or_what_is_new() {
    for (before, older) in [([0; MEMORY], None), (written(2, &[3, 4]), Some((2, &[3, 4][..])))] {
        for whole in 0..=2 * COPY {
            for garbles in [false, true] {
                let mut words = before;
                let mut left = whole;
                SLOT.write(3, &[5, 6], &mut |index, word| {
                    if left > 0 {
                        left -= 1;
                        words[index] = if garbles && left == 0 { !word } else { word };
                    }
                });
                let has_first = whole > COPY || whole == COPY && !garbles;
                let newest = if has_first { Some((3, &[5, 6][..])) } else { older };
                let found = SLOT.read(&words, true);
                assert_eq!(found.newest, newest, "{whole} words, garbled: {garbles}");
                assert_ne!(
                    found.condition,
                    Condition::Damaged,
                    "{whole} words, garbled: {garbles}"
                );
            }
        }
    }
}

#[test]
fn a_flipped_bit_in_either_copy_leaves_the_other_and_is_known() {
    let words = written(2, &[1, 2]);
    for index in SLOT.at..MEMORY {
        for bit in 0..u32::BITS {
            let mut flipped = words;
            flipped[index] ^= 1 << bit;
            assert_read(&flipped, false, Some((2, &[1, 2])), Condition::Damaged);
        }
    }
}

#[test]
fn two_damaged_copies_are_nothing_and_known() {
    let mut words = written(2, &[1, 2]);
    words[SLOT.at] ^= 1;
    words[SLOT.at + COPY + 1] ^= 1 << 31;
    for torn in [false, true] {
        assert_read(&words, torn, None, Condition::Damaged);
    }
    let mut wiped = written(2, &[1, 2]);
    wiped[SLOT.at..SLOT.at + COPY].fill(0);
    assert_read(&wiped, false, Some((2, &[1, 2])), Condition::Damaged);
    wiped[MEMORY - 1] ^= 1;
    assert_read(&wiped, true, None, Condition::Damaged);
}

#[test]
fn copies_of_different_writes_are_sound_only_where_a_reset_fell_between_them() {
    for (first, second, torn, expected) in [
        (3, 2, true, (3, Condition::Torn)),
        (0, u32::MAX, true, (0, Condition::Torn)),
        (3, 2, false, (3, Condition::Damaged)),
        (2, 3, true, (3, Condition::Damaged)),
        (5, 2, true, (5, Condition::Damaged)),
    ] {
        let mut words = written(first, &[first, 9]);
        let other = written(second, &[second, 9]);
        words[SLOT.at + COPY..].copy_from_slice(&other[SLOT.at + COPY..]);
        assert_read(&words, torn, Some((expected.0, &[expected.0, 9])), expected.1);
    }
}

#[test]
fn a_copy_in_another_place_is_no_copy() {
    let words = written(2, &[1, 2]);
    let elsewhere = Slot { at: 2, payload: 2 }.read(&words[1..], false);
    assert_eq!(elsewhere, Found { newest: None, condition: Condition::Damaged });
}
