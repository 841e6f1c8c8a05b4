//! Wakes the core when its next deadline is due.

use embassy_futures::select::{Either, select};
use embassy_time::{Instant, Timer};
use gateway::Duration;

use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::watchdog::{TaskId, Watch};

/// A deadline that stays in the past does not keep the processor from the other tasks: least time
/// between ticks.
const LEAST_PAUSE: Duration = Duration::from_micros(20);

/// For ever: tick when the deadline is due.
#[embassy_executor::task]
pub async fn tick(gateway: &'static SharedGateway) -> ! {
    let watch = Watch::new(TaskId::TICKS);
    let budget = TaskBudget::new(Urgency::Deadline).await;
    let mut earliest = SharedGateway::now();
    loop {
        let due = gateway.next_tick(earliest);
        let due = due.map_or(Instant::MAX, |due| Instant::from_micros(due.as_micros()));
        let due_or_earlier = select(Timer::at(due), gateway.earlier_tick());
        if let Some(Either::First(())) = budget.wait(watch.wait(due_or_earlier)).await {
            gateway.tick();
            earliest = SharedGateway::now() + LEAST_PAUSE;
        }
    }
}
