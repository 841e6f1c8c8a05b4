//! The images of the firmware on a simulated board, and what its loader makes of them at a start.

use firmware_image::{Check, HEADER_OFFSET, HEADER_SIZE, Header, NO_KEY, Wrong, version};
use gateway::{Board, FoundImage, ImageJob, Images, SaveError};
use host_protocol::requests::BeginImage;

/// Bytes of the longest image: as on a NUCLEO-H743ZI.
const ROOM: u32 = 512 << 10;

/// The image that runs, and one that a host sends.
#[derive(Debug, Clone)]
pub struct ImageSlots {
    runs: Vec<u8>,
    /// What was sent; once it runs, the one before.
    other: Vec<u8>,
    marked: bool,
    found: FoundImage,
}

impl ImageSlots {
    /// A board with an image of its own, that takes unsigned ones.
    pub fn new(board: &Board) -> Self {
        let header = Header::new(version(board.firmware), board.name, NO_KEY);
        let (runs, other, found) = (image(&header, &[]), Vec::new(), FoundImage::Kept);
        Self { runs, other, marked: false, found }
    }

    /// What the image that runs says of itself.
    pub fn header(&self) -> Header {
        Header::of_image(&self.runs).expect("what runs has a header")
    }

    /// What the loader does at each start.
    pub(crate) fn start(&mut self) -> Images {
        let is_on_trial = self.found == FoundImage::OnTrial;
        self.found = match (self.marked, is_on_trial) {
            (true, _) => FoundImage::OnTrial,
            (false, true) => FoundImage::RolledBack,
            (false, false) => self.found,
        };
        if self.marked || is_on_trial {
            std::mem::swap(&mut self.runs, &mut self.other);
        }
        self.marked = false;
        let Header { version, .. } = self.header();
        let needs_signature = self.header().has_key();
        Images { version, room: ROOM, needs_signature, found: self.found }
    }

    pub(crate) fn store(&mut self, job: &ImageJob) -> Result<(), SaveError> {
        match job {
            ImageJob::Write { offset, bytes } => {
                self.other.truncate(*offset as usize);
                if self.other.len() != *offset as usize {
                    return Err(SaveError::Failed);
                }
                self.other.extend(bytes);
            }
            ImageJob::Finish { image, signature } => {
                let BeginImage { board, version, checksum, .. } = image;
                let mut check = Check::new(self.header().key);
                check.update(&self.other);
                check.finish(board, *version, *checksum, signature).map_err(
                    |wrong| match wrong {
                        Wrong::Damaged => SaveError::Damaged,
                        Wrong::NotSigned => SaveError::NotSigned,
                    },
                )?;
                self.marked = true;
            }
            ImageJob::Confirm => self.found = FoundImage::Kept,
        }
        Ok(())
    }
}

/// An image without a program: its header with its length, then these bytes, and zeros to the end
/// of a unit.
pub fn image(header: &Header, rest: &[u8]) -> Vec<u8> {
    let used = HEADER_OFFSET + HEADER_SIZE + rest.len();
    let length = u32::try_from(used.next_multiple_of(firmware_image::UNIT)).expect("it fits");
    let mut image = vec![0; HEADER_OFFSET];
    image.extend(header.with_length(length).to_bytes());
    image.extend(rest);
    image.resize(length as usize, 0);
    image
}
