//! Tests of `retained.rs`.

use super::*;
use host_protocol::Protocol;

#[test]
fn the_words_of_a_bus_are_these() {
    let config = BusConfig {
        bitrate: 1_000_000,
        protocols: ProtocolSet::of(&[Protocol::Rmd, Protocol::D5]),
        exclusive: true,
        reply_window_us: 5_000,
    };
    let words = [1_000_000, 0b101, 1, 5_000, 1, 2, 3, 4];
    assert_eq!(bus_words(Some(&config), [1, 2, 3, 4]), words);
    assert_eq!(bus_from_words(&words), Some((config, &words[4..])));
    assert_eq!(bus_words(None, [0; 4]), [0; 8]);
}
