//! A board whose flash has no room for another image.

use gateway::{FoundImage, ImageJob, SaveError};

/// There is none.
pub struct OtherImage;

impl OtherImage {
    /// None.
    pub fn new() -> Option<Self> {
        None
    }

    /// No bytes.
    pub fn room(&self) -> u32 {
        0
    }

    /// What runs is what there is.
    pub async fn found(&mut self) -> FoundImage {
        FoundImage::Kept
    }

    /// The core asks for none of it.
    pub async fn store(&mut self, _: &ImageJob) -> Result<(), SaveError> {
        Err(SaveError::Failed)
    }
}
