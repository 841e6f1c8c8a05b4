//! A minute of virtual time at full load. `cargo run --release -p host-tests --example long_run`
//! takes longer ones.

use std::time::Duration;

use host_tests::long_run;

#[test]
fn a_minute_at_full_load_loses_nothing_and_its_counters_agree() {
    let tally = long_run::run(Duration::from_secs(60), |_| true).unwrap_or_else(|e| panic!("{e}"));
    // Two buses of four axes, each asked in every period.
    assert!(tally.transmitted > 60 * 8_000 * 95 / 100, "{tally}");
    assert!(tally.periods > 56_000 && tally.overruns.gateway == 0, "{tally}");
}
