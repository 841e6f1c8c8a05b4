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
    assert_eq!(bus_words(Some(&config)), [1_000_000, 0b101, 1, 5_000]);
    assert_eq!(bus_words(None), [0; 4]);
}
