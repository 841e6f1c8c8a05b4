//! Images of the firmware: the one that a host sends, the one that runs on trial, and the start
//! that follows. Whoever runs the core keeps their bytes.

use super::Gateway;
use super::requests::Result;
use crate::axis::Is;
use crate::outbox::Ticket;
use crate::port::{FoundImage, ImageJob, Images, Save, SaveError};
use crate::time::{Duration, Instant};
use host_protocol::{
    Error, IMAGE_UNIT, ImageState, MAX_IMAGE_BYTES, Reply, Request, class, replies, requests,
};
use serde::{Deserialize, Serialize};

#[expect(clippy::cast_possible_truncation, reason = "some bytes")]
const UNIT: u32 = IMAGE_UNIT as u32;
/// How long an image runs on trial.
const TRIAL: Duration = Duration::from_millis(60_000);
/// From the answer to [`Request::FinishImage`] to the start: it leaves meanwhile.
const RESTARTS_AFTER: Duration = Duration::from_millis(100);

/// What is known of images.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Image {
    images: Images,
    /// The image that is being sent.
    announced: Option<requests::BeginImage>,
    /// Its bytes that are in the flash.
    written: u32,
    trial_ends: Option<Instant>,
    restarts: Option<Instant>,
}

impl Image {
    pub const fn new() -> Self {
        let (announced, trial_ends, restarts) = (None, None, None);
        Self { images: Images::NONE, announced, written: 0, trial_ends, restarts }
    }

    /// When the gateway is to start anew.
    fn deadline(&self) -> Option<Instant> {
        self.restarts.or(self.trial_ends)
    }

    fn missing(&self) -> u32 {
        self.announced.as_ref().map_or(0, |image| image.length).saturating_sub(self.written)
    }
}

impl Gateway {
    /// Tells the core of the image that runs and of the room for another; once, before any host is
    /// heard.
    pub fn set_images(&mut self, now: Instant, images: Images) {
        self.image.images = images;
        self.image.trial_ends = (images.found == FoundImage::OnTrial).then_some(now + TRIAL);
    }

    /// Whether the chip's own bootloader, which takes any image, may take the board: all is quiet,
    /// it takes unsigned images anyway, and nothing is being stored or exchanged.
    pub fn may_detach(&self) -> bool {
        let is_exchanged = self.image.deadline().is_some();
        let waits = is_exchanged || self.image.images.needs_signature || self.stored.is_saving();
        !waits && self.unstopped.is_empty() && self.check_quiet().is_ok()
    }

    /// When the gateway is to start anew; `None` also while what is being stored keeps it from
    /// that, and while not all is quiet: as for the [start of another
    /// image](Self::check_quiet), or [for that of the one before](Self::is_stopped).
    pub(crate) fn restart_at(&self) -> Option<Instant> {
        let at = self.image.deadline()?;
        let may = match self.image.restarts {
            Some(_) => self.check_quiet().is_ok(),
            None => self.is_stopped(),
        };
        (may && !self.stored.is_saving()).then_some(at)
    }

    /// Whether nothing is being stopped or remembered as stopped. A motor that holds must not keep
    /// an image on trial for ever: after each start those hold whose stop does.
    fn is_stopped(&self) -> bool {
        !self.e_stopped && self.unstopped.is_empty() && self.axes.which(Is::Moving).is_empty()
    }

    /// While images are exchanged nobody watches a motor, and the next one may not know the words
    /// by which this one remembers an e-stop.
    fn check_quiet(&self) -> Result<()> {
        self.refuse_latched()?;
        self.check_at_rest()
    }

    /// What waits for the image that runs to be confirmed, or for the start of the next one.
    pub(crate) fn refuse_for_image(&self, request: &Request) -> Result<()> {
        let waits = || request.is(class::BEGINS);
        match &*self.image {
            Image { restarts: Some(_), .. } if waits() => Err(Error::Restarting {}),
            Image { trial_ends: Some(_), .. } if waits() => Err(Error::ImageOnTrial {}),
            _ => Ok(()),
        }
    }

    pub(crate) fn image_report(&self, now: Instant) -> replies::ImageReport {
        let Images { version, room, needs_signature, found } = self.image.images;
        let state = match self.image.trial_ends {
            Some(end) => ImageState::OnTrial { left_ms: end.since(now).as_micros_u32() / 1_000 },
            None if found == FoundImage::RolledBack => ImageState::RolledBack,
            None => ImageState::Kept,
        };
        replies::ImageReport { version, room, needs_signature, state }
    }

    pub(crate) fn begin_image(&mut self, image: &requests::BeginImage) -> Result<()> {
        let Images { version: running, room, .. } = self.image.images;
        if room == 0 {
            return Err(Error::NoImageRoom {});
        }
        self.check_quiet()?;
        if image.board.as_str() != self.board.name {
            return Err(Error::ImageForAnotherBoard {});
        }
        if image.version < running && !image.allow_older {
            return Err(Error::OlderImage { running });
        }
        let is_whole = image.length.is_multiple_of(UNIT);
        if image.length == 0 || image.length > room || !is_whole {
            return Err(Error::ImageLength { room });
        }
        (self.image.announced, self.image.written) = (Some(image.clone()), 0);
        Ok(())
    }

    pub(crate) fn write_image(
        &mut self,
        request: &requests::WriteImage,
        ticket: Ticket,
    ) -> Result<()> {
        let requests::WriteImage { offset, ref bytes } = *request;
        if self.image.announced.is_none() {
            return Err(Error::ImageIncomplete { missing: 0 });
        }
        self.check_at_rest()?;
        let fits = bytes.len() <= usize::try_from(self.image.missing()).unwrap_or(usize::MAX);
        let is_whole = !bytes.is_empty() && bytes.len().is_multiple_of(IMAGE_UNIT);
        if offset != self.image.written || !is_whole || !fits {
            return Err(Error::ImageGap { next: self.image.written });
        }
        self.store(Save::Image(ImageJob::Write { offset, bytes: bytes.clone() }), ticket);
        Ok(())
    }

    pub(crate) fn finish_image(
        &mut self,
        request: &requests::FinishImage,
        ticket: Ticket,
    ) -> Result<()> {
        let missing = self.image.missing();
        let Some(announced) = self.image.announced.as_ref().filter(|_| missing == 0) else {
            return Err(Error::ImageIncomplete { missing });
        };
        let image = announced.clone();
        self.check_quiet()?;
        let signature = request.signature.clone();
        self.store(Save::Image(ImageJob::Finish { image, signature }), ticket);
        Ok(())
    }

    pub(crate) fn confirm_image(&mut self, ticket: Ticket) -> Result<()> {
        if self.image.trial_ends.is_none() {
            return Err(Error::NoImageOnTrial {});
        }
        self.store(Save::Image(ImageJob::Confirm), ticket);
        Ok(())
    }

    /// What became of a job with images.
    pub(crate) fn image_stored(
        &mut self,
        now: Instant,
        job: &ImageJob,
        result: core::result::Result<(), SaveError>,
    ) -> Result<Reply> {
        let done = replies::Done {};
        match (job, result) {
            (ImageJob::Write { bytes, .. }, Ok(())) => {
                let written = u32::try_from(bytes.len()).unwrap_or(0);
                self.image.written = self.image.written.saturating_add(written);
                Ok(Reply::WriteImage(done))
            }
            (ImageJob::Finish { .. }, Ok(())) => {
                // A start at another time would take as long as both images take to be exchanged,
                // and no motor would be stopped meanwhile.
                (self.image.announced, self.image.restarts) = (None, Some(now + RESTARTS_AFTER));
                Ok(Reply::FinishImage(done))
            }
            (ImageJob::Confirm, Ok(())) => {
                self.image.trial_ends = None;
                Ok(Reply::ConfirmImage(done))
            }
            (job, Err(error)) => {
                if !matches!(job, ImageJob::Confirm) {
                    // A word of the flash is not written twice.
                    (self.image.announced, self.image.written) = (None, 0);
                }
                Err(match error {
                    SaveError::Damaged => Error::ImageDamaged {},
                    SaveError::NotSigned => Error::ImageNotSigned {},
                    SaveError::Full | SaveError::Failed => Error::ImageNotWritten {},
                })
            }
        }
    }
}

const _: () = assert!(MAX_IMAGE_BYTES.is_multiple_of(IMAGE_UNIT), "whole units in a message");
