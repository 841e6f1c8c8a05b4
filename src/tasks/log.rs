//! Writes the core's log when nothing more urgent is to do.

use embassy_futures::yield_now;

use crate::log;
use crate::shared_gateway::SharedGateway;

/// For ever: a line at a time, so that the ports wait for one line at most.
#[embassy_executor::task]
pub async fn log(gateway: &'static SharedGateway) -> ! {
    loop {
        match gateway.take_log() {
            Some(entry) => {
                log::write(entry);
                yield_now().await;
            }
            None => gateway.log_changed().await,
        }
    }
}
