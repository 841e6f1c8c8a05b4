//! Tests of `axis/telemetry.rs`.

use super::*;

fn at(us: u64) -> Instant {
    Instant::from_micros(us)
}

#[test]
fn of_each_kind_one_frame_in_a_second_is_told_and_the_others_are_counted() {
    let mut telemetry = Telemetry::NONE;
    assert_eq!(telemetry.tells(at(2_000_000), 0), Some(0));
    assert_eq!(telemetry.tells(at(2_000_100), 2), Some(0));
    for us in 0..1_500 {
        assert_eq!(telemetry.tells(at(2_001_000 + us), 0), None);
    }
    assert_eq!(telemetry.tells(at(2_900_000), 1), Some(1_500));
    assert_eq!(telemetry.tells(at(3_000_000), 0), Some(0));
    assert_eq!(telemetry.tells(at(3_000_000), 0), None);
    assert_eq!(telemetry.tells(at(9_000_000_000), 0), Some(1));
}
