//! Tests of `axis/restart.rs`.

use super::*;

#[test]
fn a_run_time_that_has_not_gone_on_as_our_clock_has_shows_a_restart() {
    let cases = [
        // Read, when (ms), asked again, read, restarted.
        (17, 1_000, 1_775, 468, true),
        (10_000, 0, 800, 10_800, false),
        // A clock slower by 5 %, and 50 ms for the reading.
        (10_000, 0, 100_000, 104_950, false),
        (10_000, 0, 100_000, 104_949, true),
        // It went back, however soon it is asked.
        (10_000, 0, 20, 9_999, true),
        // Nothing is known but that the gateway has run for a minute.
        (0, 0, 60_000, 30_000, true),
        (0, 0, 60_000, 56_950, false),
        // Its count begins again.
        (u32::MAX - 400, 0, 800, 399, false),
    ];
    for (before, at, asked, told, restarted) in cases {
        let ms = |ms: u64| Instant::default() + Duration::from_millis(ms);
        let read = RunTime { ms: before, at: ms(at) };
        assert_eq!(
            read.is_before_a_restart(ms(asked), told),
            restarted,
            "{before} {at} {asked} {told}"
        );
    }
}
