//! Serves the flight recorder when nothing more urgent is to do.

use embassy_futures::yield_now;

use crate::shared_gateway::SharedGateway;

/// For ever: what a host reads, a look at what has come of the calls, a part of a copy, then whoever
/// else has something to do. Nobody watches it: it calls the core as all others do, and waits for nothing else.
#[embassy_executor::task]
pub async fn flight(gateway: &'static SharedGateway) -> ! {
    loop {
        gateway.flight_due().await;
        while gateway.go_on_with_flight() {
            yield_now().await;
        }
    }
}
