//! Another firmware for the gateway.

use std::time::Duration;

use host_protocol::replies::ImageReport;
use host_protocol::requests as ask;
use host_protocol::{FirmwareVersion, Text};

use crate::client::Client;
use crate::error::ClientError;
use crate::transport::Transport;

/// A sector of the flash may be erased first.
const WRITE_DEADLINE: Duration = Duration::from_secs(10);
/// All of the image is read back.
const CHECK_DEADLINE: Duration = Duration::from_secs(20);

impl<T: Transport> Client<T> {
    /// Which firmware runs, and whether another may take its place.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn image(&mut self) -> Result<ImageReport, ClientError> {
        self.request(&ask::ReadImage {})
    }

    /// Announces an image of the firmware: its board, version, bytes and their CRC-32C. Nothing
    /// runs otherwise yet.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn begin_image(
        &mut self,
        board: &str,
        version: FirmwareVersion,
        length: u32,
        checksum: u32,
        allow_older: bool,
    ) -> Result<(), ClientError> {
        // A name that is too long is that of no board.
        let board = Text::try_from(board).unwrap_or_default();
        self.request(&ask::BeginImage { board, version, length, checksum, allow_older }).map(drop)
    }

    /// Sends the next bytes of the image, at most
    /// [`MAX_IMAGE_BYTES`](host_protocol::MAX_IMAGE_BYTES), and waits until they are written.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn write_image(&mut self, offset: u32, bytes: &[u8]) -> Result<(), ClientError> {
        let bytes = bytes.iter().copied().take(host_protocol::MAX_IMAGE_BYTES).collect();
        self.request_within(&ask::WriteImage { offset, bytes }, WRITE_DEADLINE).map(drop)
    }

    /// Has the image checked, with its signature or none, and run on trial: 100 ms after the answer
    /// the gateway starts anew. [`reconnect`](Self::reconnect) finds it again.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn finish_image(&mut self, signature: &[u8]) -> Result<(), ClientError> {
        let signature = signature.iter().copied().take(host_protocol::SIGNATURE_SIZE).collect();
        self.request_within(&ask::FinishImage { signature }, CHECK_DEADLINE).map(drop)
    }

    /// Keeps the image that runs on trial.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn confirm_image(&mut self) -> Result<(), ClientError> {
        self.request_within(&ask::ConfirmImage {}, WRITE_DEADLINE).map(drop)
    }
}
