//! Loads the configuration at the start, and stores it when a host asks for it.
//!
//! Nobody watches it: it waits for the flash, which has deadlines of its own, while the others run.

use config_store::ConfigStore;
use embassy_futures::block_on;
use gateway::{Event, Found, Save};

use crate::shared_gateway::SharedGateway;
use crate::storage::StorageFlash;
use crate::watchdog;

/// For ever, unless there is nowhere to store anything. Where a reset has left the running configuration, its axes are stopped before anything
/// is read.
#[embassy_executor::task]
pub async fn storage(gateway: &'static SharedGateway) {
    let store =
        StorageFlash::new().and_then(|flash| ConfigStore::new(flash, 0..StorageFlash::length()));
    // What a reset has left does not wait for the flash.
    if gateway.is_remembered() {
        gateway.start();
        gateway.first_stops_have_left().await;
    }
    let Some(mut store) = store else {
        gateway.load(Found::SingleBank, &mut |_| None);
        return;
    };
    let found = if gateway.is_bare() { Found::NotRead } else { store.find().await };
    let mut from = 0;
    gateway.load(found, &mut |bytes| {
        // It reads one row, for less than the watchdog waits.
        watchdog::feed();
        let row = block_on(store.next_row(from, bytes)).transpose()?;
        Some(row.map(|(row, length)| {
            from = row + 1;
            length
        }))
    });
    loop {
        let result = match gateway.save_due().await {
            Save::Rows { digest } => {
                store.save(digest, &mut |row, out| gateway.stored_row(row, out)).await
            }
            Save::Nothing => store.forget().await,
        };
        gateway.handle(Event::Saved { result });
    }
}
