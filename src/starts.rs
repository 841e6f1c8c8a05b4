//! Starts that failed early, one after the other.
//!
//! A fault that comes back at each start, as one by the configuration that outlives a reset would,
//! must not be an endless loop: after a few such starts the next run does without that
//! configuration. Each of them has stopped the motors that it knew, as far as it came; the enable
//! output stays inactive until the next power-on or reset by the pin.

use embassy_time::Duration;
use host_protocol::BootReason;

use crate::retained::{self, STARTS};

/// A count, and its complement.
pub const START_WORDS: usize = 2;
const COUNT: usize = 0;
const COMPLEMENT: usize = 1;

/// Failed starts after which the configuration is left out.
const ENOUGH: u32 = 5;
/// A run that has lasted so long has not failed early.
pub const LASTED: Duration = Duration::from_secs(10);

/// Counts this start; once, when the retained RAM has been started. Returns whether this run is to
/// do without what the runs before have left.
pub fn count(boot: BootReason) -> bool {
    let failed = match boot {
        BootReason::Watchdog | BootReason::Software => read(),
        _ => 0,
    };
    write(failed.saturating_add(1));
    failed >= ENOUGH
}

/// This run has lasted. One that does without configuration ends nothing: the next would find
/// nothing either, and count as sound.
pub fn lasted() {
    write(0);
}

fn read() -> u32 {
    let count = retained::read(STARTS, COUNT);
    if retained::read(STARTS, COMPLEMENT) == !count { count } else { 0 }
}

fn write(count: u32) {
    retained::write(STARTS, COUNT, count);
    retained::write(STARTS, COMPLEMENT, !count);
    retained::close();
}
