//! Images of the firmware in a scenario.

use super::bench::Bench;
use super::steps::StepError;
use super::words::parse;
use firmware_image::{CHECKSUM, FirmwareVersion, Header, NO_KEY, version};
use host_protocol::{ImageState, MAX_IMAGE_BYTES};
use mgw_client::Client;
use mgw_sim::images::{ImageSlots, image};
use mgw_sim::{BOARD, SimTransport};

/// The image of a version for the simulated board.
fn image_of(version: FirmwareVersion) -> Vec<u8> {
    image(&Header::new(version, BOARD.name, NO_KEY), &[0x5A; 500])
}

impl Bench {
    /// `images`: the board has room for another firmware, and starts anew as after a loss of power.
    pub fn images(&mut self) -> Result<(), String> {
        self.world.borrow_mut().set_images(ImageSlots::new(&BOARD));
        self.client.reconnect().map_err(|error| error.to_string())
    }

    /// `begin-image VERSION [older]`, `write-image VERSION FROM`, `finish-image`, `confirm-image`
    pub fn image(&mut self, verb: &str, words: &[&str]) -> Result<(), StepError> {
        let version = version(words.first().copied().unwrap_or_default());
        match verb {
            "begin-image" => {
                let image = image_of(version);
                let length = u32::try_from(image.len()).map_err(|error| error.to_string())?;
                let (checksum, older) = (CHECKSUM.checksum(&image), words.get(1) == Some(&"older"));
                self.client.begin_image(BOARD.name, version, length, checksum, older)?;
            }
            "write-image" => {
                let (image, from): (_, usize) = (image_of(version), parse(words, 1, "place")?);
                let parts = image.get(from..).unwrap_or_default().chunks(MAX_IMAGE_BYTES);
                for (at, part) in (from..).step_by(MAX_IMAGE_BYTES).zip(parts) {
                    let at = u32::try_from(at).map_err(|error| error.to_string())?;
                    self.client.write_image(at, part)?;
                }
            }
            "finish-image" => self.client.finish_image(&[])?,
            _ => self.client.confirm_image()?,
        }
        Ok(())
    }

    /// `image VERSION kept|on-trial|rolled-back`: what runs.
    pub fn expect_image(&mut self, words: &[&str]) -> Result<(), String> {
        let seen = runs(&mut self.client)?;
        if seen == words.join(" ") { Ok(()) } else { Err(format!("it is {seen}")) }
    }
}

/// The firmware that runs: `VERSION kept|on-trial|rolled-back`.
pub(crate) fn runs(client: &mut Client<SimTransport>) -> Result<String, String> {
    let image = client.image().map_err(|error| error.to_string())?;
    let state = match image.state {
        ImageState::Kept => "kept",
        ImageState::OnTrial { .. } => "on-trial",
        ImageState::RolledBack => "rolled-back",
    };
    Ok(format!("{} {state}", image.version))
}
