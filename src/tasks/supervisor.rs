//! Feeds the watchdog while every watched loop checks in.

use embassy_time::{Duration, Instant, Ticker};

use crate::{starts, watchdog};

/// How often every loop has to check in, and the watchdog is fed.
const PERIOD: Duration = Duration::from_millis(10);
/// Periods without a feed after which those who are missing are noted: no longer a late one, and
/// before the watchdog strikes.
const NOTED_AFTER: u32 = 3;

/// For ever. It needs no low priority: where it runs and others do not, these are missing.
#[embassy_executor::task]
pub async fn supervisor() -> ! {
    let mut ticker = Ticker::every(PERIOD);
    let mut late = 0;
    let mut lasts = false;
    loop {
        match watchdog::missing() {
            0 => {
                watchdog::feed();
                if late >= NOTED_AFTER {
                    watchdog::note_missing(0);
                }
                late = 0;
            }
            missing => {
                late += 1;
                if late == NOTED_AFTER {
                    watchdog::note_missing(missing);
                }
            }
        }
        if !lasts && Instant::now() >= Instant::MIN + starts::LASTED {
            lasts = true;
            starts::lasted();
        }
        watchdog::pulse().await;
        ticker.next().await;
    }
}
