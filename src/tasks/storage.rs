//! Loads the configuration at the start, and stores it, and another image, when a host asks for it.
//!
//! Nobody watches it: it waits for the flash, which has deadlines of its own, while the others run.

use config_store::ConfigStore;
use embassy_futures::block_on;
use gateway::{Event, Save, SaveError, StoredState};

use crate::image::{OtherImage, images};
use crate::shared_gateway::SharedGateway;
use crate::storage::Pages;
use crate::watchdog;

/// For ever, unless there is nowhere to store anything. Where a reset has left the running
/// configuration, its axes are stopped before anything is read.
#[embassy_executor::task]
pub async fn storage(gateway: &'static SharedGateway) {
    let store = Pages::of_configuration().and_then(|pages| {
        let all = 0..pages.length();
        ConfigStore::new(pages, all)
    });
    let mut other_image = OtherImage::new();
    // What a reset has left does not wait for the flash.
    gateway.restore();
    gateway.first_stops_have_left().await;
    gateway.set_images(images(other_image.as_mut()).await);
    let Some(mut store) = store else {
        gateway.load(Err(StoredState::SingleBank), &mut |_| None);
        return;
    };
    let found = if gateway.is_bare() { Err(StoredState::NotRead) } else { store.find().await };
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
            Save::Image(job) => match &mut other_image {
                Some(image) => image.store(&job).await,
                None => Err(SaveError::Failed),
            },
        };
        gateway.handle(Event::Saved { result });
    }
}
