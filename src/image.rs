//! What the image that runs says of itself, and the place of another.

#[cfg(not(has_loader))]
#[path = "image/no_other.rs"]
mod other;
#[cfg(has_loader)]
mod other;

use firmware_image::{HEADER_SIZE, Header, NO_KEY, version};
use gateway::Images;

use crate::board::{FIRMWARE, NAME};
pub use other::OtherImage;

/// Whoever puts a key into an image writes it here.
#[used]
#[unsafe(link_section = ".image_header")]
static HEADER: [u8; HEADER_SIZE] = Header::new(version(FIRMWARE), NAME, NO_KEY).to_bytes();

/// What the image in the flash says of itself.
fn header() -> Header {
    // Safety: it is there. It may have been changed since it was compiled.
    let bytes = unsafe { (&raw const HEADER).read_volatile() };
    // What starts has one.
    Header::read(&bytes).unwrap_or(Header::new(version(FIRMWARE), NAME, NO_KEY))
}

/// What the core is to know.
pub async fn images(other: Option<&mut OtherImage>) -> Images {
    let header = header();
    let (version, needs_signature) = (header.version, header.has_key());
    let Some(other) = other else {
        return Images { version, needs_signature, ..Images::NONE };
    };
    Images { version, room: other.room(), needs_signature, found: other.found().await }
}
