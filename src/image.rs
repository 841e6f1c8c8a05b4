//! What the image that runs says of itself, and the place of another.

#[cfg(not(has_loader))]
#[path = "image/no_other.rs"]
mod other;
#[cfg(has_loader)]
mod other;

use firmware_image::{HEADER_SIZE, Header, MAGIC, NO_KEY, version};
use gateway::Images;

use crate::board::{FIRMWARE, NAME};
pub use other::OtherImage;

/// What an image without a key says of itself, but for its length, which the linker knows.
const HEADER: Header = Header::new(version(FIRMWARE), NAME, NO_KEY);
/// Bytes of the header behind the length.
const BEHIND_LENGTH: usize = HEADER_SIZE - MAGIC.len() - size_of::<u32>();

#[used]
#[unsafe(link_section = ".image_header.magic")]
static BEGIN: [u8; MAGIC.len()] = MAGIC;
/// Whoever puts a key into an image writes it here.
#[used]
#[unsafe(link_section = ".image_header.rest")]
static REST: [u8; BEHIND_LENGTH] = match HEADER.to_bytes().last_chunk() {
    Some(rest) => *rest,
    None => panic!("it is as long"),
};

unsafe extern "C" {
    /// Of memory.x: where the header lies.
    static __image_header: [u8; HEADER_SIZE];
}

/// What the image in the flash says of itself.
pub fn header() -> Header {
    // Safety: it is there. It may have been changed since it was compiled.
    let bytes = unsafe { (&raw const __image_header).read_volatile() };
    // What starts has one.
    Header::read(&bytes).unwrap_or(HEADER)
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
