//! Wakes the core when its next deadline is due.

use embassy_futures::select::select;
use embassy_time::{Duration, Instant, Timer};
use gateway::Event;

use crate::shared_gateway::SharedGateway;

/// A deadline that stays in the past does not keep the processor from the other tasks: least time between ticks.
const LEAST_PAUSE: Duration = Duration::from_micros(20);

/// For ever: wait for the deadline or for a change of it, then tick.
#[embassy_executor::task]
pub async fn deadline(gateway: &'static SharedGateway) -> ! {
    let mut earliest = Instant::MIN;
    loop {
        let Some(due) = gateway.next_deadline() else {
            gateway.deadline_changed().await;
            continue;
        };
        let due = Instant::from_micros(due.as_micros()).max(earliest);
        if Instant::now() < due {
            select(Timer::at(due), gateway.deadline_changed()).await;
            continue;
        }
        gateway.handle(Event::Tick);
        earliest = Instant::now() + LEAST_PAUSE;
        embassy_futures::yield_now().await;
    }
}
