//! Images of the firmware that a host sends.

use core::fmt;

use crate::size::wire;

/// Bytes of an image come in units of as many: the longest word of a flash.
pub const IMAGE_UNIT: usize = 32;
/// Bytes of an image in one message, at most.
pub const MAX_IMAGE_BYTES: usize = 4 * IMAGE_UNIT;
/// Bytes of a signature.
pub const SIGNATURE_SIZE: usize = 64;

wire! {
    /// The version of a firmware; later ones are greater.
    #[derive(Copy, Eq, PartialOrd, Ord)]
    pub struct FirmwareVersion {
        /// Grows with what is not compatible.
        pub major: u16,
        /// Grows with what is new.
        pub minor: u16,
        /// Grows with what is mended.
        pub patch: u16,
    }

    /// What became of the last image that was sent.
    #[derive(Copy, Eq)]
    pub enum ImageState {
        /// The image that runs does so for good.
        Kept,
        /// The image that runs was sent last, and is not confirmed yet.
        OnTrial {
            /// ms until the one before runs again.
            left_ms: u32,
        },
        /// The one that was sent last was not confirmed in its time: the one before runs again.
        RolledBack,
    }
}

impl fmt::Display for FirmwareVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}
