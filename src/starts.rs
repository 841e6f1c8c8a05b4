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
/// What a bare run counts at least.
const BARE: u32 = ENOUGH + 1;
/// A run that has lasted so long has not failed early.
pub const LASTED: Duration = Duration::from_secs(10);

/// A run that begins.
pub struct Start {
    /// So many before it have failed early.
    pub failed: u32,
    /// With what it begins.
    pub begins: Begins,
}

/// With what a run begins.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Begins {
    /// With what the run before has left.
    AsItWas,
    /// With what is stored: the run before was bare, and has left nothing that speaks for the
    /// motors.
    AsStored,
    /// Without configuration.
    Bare,
}

/// Counts this start; once, when the retained RAM has been started.
pub fn count(boot: BootReason) -> Start {
    let counted = read();
    let fails = matches!(boot, BootReason::Watchdog | BootReason::Software);
    write(if fails { counted.saturating_add(1) } else { 1 });
    let begins = match counted {
        ENOUGH.. if fails => Begins::Bare,
        // More than those that have failed: the bare one counts, too.
        BARE.. => Begins::AsStored,
        _ => Begins::AsItWas,
    };
    Start { failed: if fails { counted } else { 0 }, begins }
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
