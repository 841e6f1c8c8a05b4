//! Stores the history of trips when nothing more urgent is to do.

use crate::shared_gateway::SharedGateway;
use crate::watchdog::{TaskId, Watch};

/// For ever. What is not stored when a host is told something is stored then.
#[embassy_executor::task]
pub async fn history(gateway: &'static SharedGateway) -> ! {
    let watch = Watch::new(TaskId::HISTORY);
    loop {
        gateway.save(|| watch.check_in()).await;
        while watch.wait(gateway.history_changed()).await.is_none() {}
    }
}
