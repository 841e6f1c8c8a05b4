//! Feeds the watchdog while every watched loop checks in or waits.

use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, Ticker};

use crate::shared_gateway::SharedGateway;
use crate::watchdog::TaskId;
use crate::{starts, task_budget, watchdog};

/// How often each loop that does not wait has to check in, and the watchdog is fed.
const PERIOD: Duration = Duration::from_millis(10);
/// Of those that wait, so many are asked in a period to prove that they can be woken.
const ASKED_AT_ONCE: usize = 2;
/// Periods without a feed after which those who are missing are noted: no longer a late one, and
/// before the watchdog strikes.
const NOTED_AFTER: u32 = 3;

/// For ever. It is not urgent, and says when the tasks that are not have had a turn.
#[embassy_executor::task]
pub async fn supervisor(gateway: &'static SharedGateway) -> ! {
    let mut ticker = Ticker::every(PERIOD);
    let mut late = 0;
    let mut lasts = false;
    // All in less than a tenth of a second.
    let mut tasks = TaskId::all().cycle();
    loop {
        if task_budget::others_starve() {
            // Who else is ready has a turn.
            yield_now().await;
        }
        task_budget::others_have_run();
        match watchdog::missing() {
            0 => {
                watchdog::feed();
                if late >= NOTED_AFTER {
                    watchdog::note_missing(0);
                }
                late = 0;
                let watched =
                    tasks.by_ref().take(watchdog::TASKS).filter(|task| watchdog::ask(*task));
                watched.take(ASKED_AT_ONCE).for_each(drop);
            }
            missing => {
                late += 1;
                if late == NOTED_AFTER {
                    watchdog::note_missing(missing);
                }
            }
        }
        // Nothing else may tell of these: the level of the contact, and how a bus is.
        watchdog::ask(TaskId::E_STOP);
        gateway.look_at_can();
        if !lasts && !gateway.is_bare() && Instant::now() >= Instant::MIN + starts::LASTED {
            lasts = true;
            starts::lasted();
        }
        ticker.next().await;
    }
}
