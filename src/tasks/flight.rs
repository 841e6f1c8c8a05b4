//! Copies the core for the flight recorder when nothing more urgent is to do.

use embassy_futures::yield_now;

use crate::shared_gateway::SharedGateway;

/// For ever: a part of a copy, then whoever else has something to do. Nobody watches it: it calls
/// the core as all others do, and waits for nothing else.
#[embassy_executor::task]
pub async fn copy(gateway: &'static SharedGateway) -> ! {
    loop {
        gateway.copy_due().await;
        while gateway.copy_some() {
            yield_now().await;
        }
    }
}
