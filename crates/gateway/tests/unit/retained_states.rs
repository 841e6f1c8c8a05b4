//! Tests of `retained/states.rs`.

use super::*;
use crate::gateway::retained::layout::Place;

const STATES: States = States {
    starts: 3,
    moving: Set::from_bits(0b0010),
    tripped: Set::from_bits(0b1101),
    unreachable: Set::from_bits(0b1000),
    flags: E_STOPPED,
    silence_us: 250_000,
};

#[test]
fn the_words_of_the_states_are_these() {
    let slot = Place::States.slot();
    let mut words = [0; 20];
    slot.write(1, &STATES.words(), &mut |index, word| words[index] = word);
    // CRC-32C of the words 4 (place), 1 (generation) and the payload, little-endian.
    let copy = [1, 3, 0b0010, 0b1101, 0b1000, 1, 250_000, 0xB2D4_5E44];
    assert_eq!(words[..4], [0; 4]);
    assert_eq!(words[4..12], copy);
    assert_eq!(words[12..], copy);
    let found = slot.read(&words, false);
    assert_eq!(found.newest.and_then(|(_, payload)| States::from_words(payload)), Some(STATES));
}

#[test]
fn words_of_another_length_are_none() {
    assert_eq!(States::from_words(&STATES.words()[1..]), None);
    assert_eq!(States::from_words(&[]), None);
}
