//! Wakes the core when its next deadline is due.

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Instant, Timer};
use gateway::Event;

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
    let mut due = None;
    loop {
        match budget.wait(watch.wait(due_or_changed(gateway, due))).await {
            Some(Either::First(())) => {
                due = None;
                gateway.handle(Event::Tick);
                budget.spend().await;
                Timer::after(LEAST_PAUSE).await;
            }
            Some(Either::Second(changed)) => due = changed,
            None => {}
        }
    }
}

/// Until the deadline, or until there is another one.
async fn due_or_changed(
    gateway: &SharedGateway,
    due: Option<Instant>,
) -> Either<(), Option<Instant>> {
    match due {
        Some(due) => select(Timer::at(due), gateway.due_changed()).await,
        None => Either::Second(gateway.due_changed().await),
    }
}
