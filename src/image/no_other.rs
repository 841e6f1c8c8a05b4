//! A board whose flash has no room for another image.

use gateway::{FoundImage, ImageJob, SaveError};

/// There is none.
pub enum OtherImage {}

impl OtherImage {
    /// None.
    pub fn new() -> Option<Self> {
        None
    }

    /// Of none.
    pub fn room(&self) -> u32 {
        match *self {}
    }

    /// Of none.
    pub async fn found(&mut self) -> FoundImage {
        match *self {}
    }

    /// Of none.
    pub async fn store(&mut self, _: &ImageJob) -> Result<(), SaveError> {
        match *self {}
    }
}
