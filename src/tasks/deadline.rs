//! Wakes the core when its next deadline is due.

use embassy_futures::select::select;
use embassy_time::{Duration, Instant, Timer};
use gateway::Event;

use crate::shared_gateway::SharedGateway;
use crate::turn::Turn;
use crate::watchdog::{Life, Watch};

/// A deadline that stays in the past does not keep the processor from the other tasks: least time between ticks.
const LEAST_PAUSE: Duration = Duration::from_micros(20);

/// For ever: wait for the deadline or for a change of it, then tick.
#[embassy_executor::task]
pub async fn deadline(gateway: &'static SharedGateway) -> ! {
    let life = Watch::new(Life::DEADLINES);
    let turn = Turn::urgent().await;
    let mut earliest = Instant::MIN;
    loop {
        life.show();
        let due = gateway.next_deadline().map(|due| Instant::from_micros(due.as_micros()).max(earliest));
        if due.is_some_and(|due| due <= Instant::now()) {
            gateway.handle(Event::Tick);
            turn.end().await;
            earliest = Instant::now() + LEAST_PAUSE;
            continue;
        }
        while turn.wait(life.alive(due_or_changed(gateway, due))).await.is_none() {}
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
