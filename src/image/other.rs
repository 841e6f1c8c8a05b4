//! The place of another image, which the loader exchanges with the one that runs.

use embassy_boot::{FirmwareState, FirmwareUpdaterError, State};
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use firmware_image::{Check, Wrong};
use gateway::{FoundImage, ImageJob, SaveError};
use host_protocol::requests::BeginImage;

use super::header;
use crate::board::flash::{PAGE, WORD};
use crate::storage::Pages;
use crate::watchdog;

/// What is read of it at once.
const PIECE: usize = 128;

/// The place of another image.
pub struct OtherImage {
    pages: Pages,
    state: Pages,
}

impl OtherImage {
    /// That of this board; once.
    pub fn new() -> Option<Self> {
        let [pages, state] = Pages::of_images();
        Some(Self { pages, state })
    }

    /// Bytes of the longest image: the loader needs a page more.
    pub fn room(&self) -> u32 {
        self.pages.length().saturating_sub(PAGE_BYTES)
    }

    /// What the start has found.
    pub async fn found(&mut self) -> FoundImage {
        match self.state().await {
            State::Swap => FoundImage::OnTrial,
            State::Revert => FoundImage::RolledBack,
            State::Boot | State::DfuDetach => FoundImage::Kept,
        }
    }

    /// Carries a job out.
    pub async fn store(&mut self, job: &ImageJob) -> Result<(), SaveError> {
        match job {
            ImageJob::Write { offset, bytes } => self.write(*offset, bytes).await,
            ImageJob::Finish { image, signature } => {
                self.check(image, signature).await?;
                self.mark(true).await
            }
            ImageJob::Confirm => self.mark(false).await,
        }
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), SaveError> {
        // Half of an image must not wait for the next start.
        if offset == 0 && self.state().await == State::Swap {
            self.mark(false).await?;
        }
        // The page that begins in this piece: at its first byte, or behind it.
        let page = offset.next_multiple_of(PAGE_BYTES);
        if ((page - offset) as usize) < bytes.len() {
            let erased = self.pages.erase(page, page + PAGE_BYTES).await;
            erased.map_err(|_| SaveError::Failed)?;
        }
        self.pages.write(offset, bytes).await.map_err(|_| SaveError::Failed)
    }

    /// Reads all of it back.
    async fn check(&mut self, image: &BeginImage, signature: &[u8]) -> Result<(), SaveError> {
        let mut check = Check::new(header().key);
        let (mut offset, mut bytes) = (0, [0; PIECE]);
        while offset < image.length {
            let count = (image.length - offset).min(PIECE_BYTES);
            let bytes = bytes.get_mut(..count as usize).unwrap_or_default();
            self.pages.read(offset, bytes).await.map_err(|_| SaveError::Failed)?;
            check.update(bytes);
            offset += count;
            yield_now().await;
        }
        // A signature takes less than the watchdog waits.
        watchdog::feed();
        let checked = check.finish(&image.board, image.version, image.checksum, signature);
        watchdog::feed();
        checked.map_err(|wrong| match wrong {
            Wrong::Damaged => SaveError::Damaged,
            Wrong::NotSigned => SaveError::NotSigned,
        })
    }

    /// Has the other image run from the next start on, or keeps the one that runs.
    async fn mark(&mut self, exchange: bool) -> Result<(), SaveError> {
        let mut word = [0; WORD];
        let mut state = FirmwareState::new(&mut self.state, &mut word);
        let marked = if exchange { state.mark_updated().await } else { state.mark_booted().await };
        marked.map_err(|_: FirmwareUpdaterError| SaveError::Failed)
    }

    async fn state(&mut self) -> State {
        let mut word = [0; WORD];
        let state = FirmwareState::new(&mut self.state, &mut word).get_state().await;
        // Reading does not fail.
        state.unwrap_or(State::Boot)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "some KiB")]
const PAGE_BYTES: u32 = PAGE as u32;
#[expect(clippy::cast_possible_truncation, reason = "some bytes")]
const PIECE_BYTES: u32 = PIECE as u32;
