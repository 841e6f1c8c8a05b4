//! Tests of `retained/layout.rs`.

use super::*;

#[test]
fn one_word_of_the_mark_may_be_damaged() {
    let mut words = [7; RETAINED_WORDS];
    assert!(!is_ours(&words));
    clear(&mut |index, word| words[index] = word);
    assert!(!is_ours(&words));
    mark(&mut |index, word| words[index] = word);
    assert!(is_ours(&words));
    assert_eq!(words[..4], [0x4D47_5752, LAYOUT, !LAYOUT, 0]);
    for index in 0..3 {
        let mut damaged = words;
        damaged[index] ^= 1 << 9;
        assert!(is_ours(&damaged), "{index}");
        damaged[(index + 1) % 3] ^= 1;
        assert!(!is_ours(&damaged), "{index}");
    }
    assert!(!is_ours(&words[1..]));
    assert!(!is_ours(&[]));
}

#[test]
fn slots_lie_side_by_side_and_fill_the_memory() {
    let places = core::iter::once(Place::States)
        .chain((0..MAX_AXES).map(Place::Axis))
        .chain((0..MAX_BUSES).map(Place::Bus))
        .chain((0..INCIDENTS).map(Place::Incident))
        .chain([Place::Gateway]);
    let mut next = STATES_AT;
    for (index, place) in places.enumerate() {
        assert_eq!((place.index(), place.slot().at), (index, next));
        next += Slot::words(place.slot().payload);
    }
    assert_eq!(next, RETAINED_WORDS);
}
