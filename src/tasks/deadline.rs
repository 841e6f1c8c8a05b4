//! Wakes the core when its next deadline is due, and writes its log when the ports have been served.

use embassy_futures::select::select;
use embassy_time::{Duration, Instant, Timer};
use gateway::Event;

use crate::log;
use crate::shared_gateway::SharedGateway;
use crate::watchdog::{Life, Watch};

/// A deadline that stays in the past does not keep the processor from the other tasks: least time between ticks.
const LEAST_PAUSE: Duration = Duration::from_micros(20);

/// For ever: wait for the deadline or for a change of it, then tick.
#[embassy_executor::task]
pub async fn deadline(gateway: &'static SharedGateway) -> ! {
    let life = Watch::new(Life::DEADLINES);
    let mut earliest = Instant::MIN;
    loop {
        life.show();
        while let Some(entry) = gateway.take_log() {
            log::write(entry);
        }
        let due = gateway.next_deadline().map(|due| Instant::from_micros(due.as_micros()).max(earliest));
        if due.is_some_and(|due| due <= Instant::now()) {
            gateway.handle_and_yield(Event::Tick).await;
            earliest = Instant::now() + LEAST_PAUSE;
            continue;
        }
        while life.alive(due_or_changed(gateway, due)).await.is_none() {}
    }
}

async fn due_or_changed(gateway: &SharedGateway, due: Option<Instant>) {
    match due {
        Some(due) => {
            select(Timer::at(due), gateway.deadline_changed()).await;
        }
        None => gateway.deadline_changed().await,
    }
}
