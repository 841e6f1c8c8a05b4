//! All CAN buses: tells the core what their controllers have done.

use crate::fdcan;
use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::watchdog::{TaskId, Watch};

/// For ever: one event at a time. A full queue must not keep the other tasks waiting.
#[embassy_executor::task]
pub async fn can(gateway: &'static SharedGateway) -> ! {
    let watch = Watch::new(TaskId::CAN);
    let budget = TaskBudget::new(Urgency::Can).await;
    loop {
        budget.wait(watch.wait(fdcan::waiting())).await;
        gateway.follow_can();
    }
}
